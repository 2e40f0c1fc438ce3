"""Which of the people seen carries a phone: how likely each of them does, and how likely none.

assignment     of all people and all phones at once; its cost is twice a negative log-likelihood
probability    of a carrier is that of the best assignment with this pair, among those of all carriers and of none
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from agents.mission.finding.phone_localization import Estimate, weighted
from agents.mission.hungarian import assign

IMPOSSIBLE: Final = 1e6
"""The cost of a pair that is excluded."""
_NEVER: Final = 1e-9
_NEARLY_ALL: Final = 0.95
RAYLEIGH_95: Final = math.sqrt(-2 * math.log(1 - _NEARLY_ALL))
"""Of a place that errs alike in two directions, 95 of 100 are within so many standard deviations."""


class Carriers(NamedTuple):
    """Who may carry one phone."""

    places: Sequence[Estimate]
    shares: Sequence[float]
    """The probability of each person at `places`; with that of nobody, they sum to 1."""

    @property
    def nobody(self) -> float:
        return 1 - math.fsum(self.shares)

    def margin(self, row: int, *, within_m: float) -> float:
        """By how much all other carriers together cost more than this person and those within a distance."""
        at = self.places[row].at
        near = (
            share for place, share in zip(self.places, self.shares, strict=True) if place.distance_m(at) <= within_m
        )
        likely = math.fsum(near)
        return 2 * math.log(likely / max(_NEVER, 1 - likely)) if likely else -math.inf

    def doubt_m(self, row: int) -> float:
        """The standard deviation, about the place of a person, with which 95 % of the likely carriers are in it."""
        at, left = self.places[row].at, _NEARLY_ALL * math.fsum(self.shares)
        for away_m, share in sorted(
            (place.distance_m(at), share) for place, share in zip(self.places, self.shares, strict=True)
        ):
            left -= share
            if left <= 0:
                return away_m / RAYLEIGH_95
        return 0.0

    def middle(self, *, grain_m: float) -> Estimate:
        """Where the carrier is if nothing more is known: the mean of all places, and how far they spread."""
        points = [(share, place.east_m, place.north_m) for place, share in zip(self.places, self.shares, strict=True)]
        return weighted(points, grain_m=grain_m)


def carriers(
    costs: Sequence[Sequence[float]], nobody: Sequence[float], column: int, places: Sequence[Estimate]
) -> Carriers:
    """Weigh who carries the phone in a column; `nobody`: the cost that each person carries none."""
    totals = [cost_with(costs, nobody, row, column) for row in range(len(costs))]
    without = [[IMPOSSIBLE if at == column else cost for at, cost in enumerate(row)] for row in costs]
    totals.append(assigned(without, nobody)[0])
    least = min(totals)
    weights = [math.exp((least - total) / 2) for total in totals]
    whole = math.fsum(weights)
    return Carriers(places, [weight / whole for weight in weights[:-1]])


def cost_with(costs: Sequence[Sequence[float]], nobody: Sequence[float], row: int, column: int) -> float:
    """The least total cost with this person as the carrier of this phone."""
    kept = [cost if at == column else IMPOSSIBLE for at, cost in enumerate(costs[row])]
    return assigned([*costs[:row], kept, *costs[row + 1 :]], [*nobody[:row], IMPOSSIBLE, *nobody[row + 1 :]])[0]


def assigned(costs: Sequence[Sequence[float]], nobody: Sequence[float]) -> tuple[float, list[int | None]]:
    """The least total cost, and the phone of each person; `nobody` has the cost that a person carries none of them."""
    phones, people = len(costs[0]), len(costs)
    table = [[*row, *(nobody[i] if i == j else IMPOSSIBLE for j in range(people))] for i, row in enumerate(costs)]
    chosen = assign(table)
    total = math.fsum(table[i][column] for i, column in enumerate(chosen))
    return total, [column if column < phones else None for column in chosen]
