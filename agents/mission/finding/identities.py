"""Decides which person carries which phone: cameras and microphones show people, receivers identify phones.

    sightings near each other     are taken for one person (`person_track.py`)
    all people and all phones     are assigned at once, so that all received powers together are most likely
    a person's phone is certain   when every other assignment of this person is far less likely (`confirmation.py`)

A survivor is known by the id of the phone. The cost of a pair of person and phone tells how much less likely the
phone's received powers are from the person's place than from the best place. It is twice a difference of
log-likelihoods, so for the true pair it has a chi-square distribution with 2 degrees of freedom.
"""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.confirmation import (
    GREATEST_MARGIN,
    SECOND_SIGMA_M,
    is_confirmable,
    is_seen_enough,
    required_margin,
)
from agents.mission.finding.known_survivors import SAME_PLACE_M, KnownSurvivors, estimate_of
from agents.mission.finding.person_track import PersonTrack
from agents.mission.finding.phone_localization import Estimate
from agents.mission.hungarian import assign
from fanet_mw.units import Enu
from fanet_mw.wire.survivors import Found

_SAME_SIGMAS: Final = 2.5
"""A sighting also belongs to a person within this number of its standard deviations; voices have wide ones."""
_GATE: Final = 16.0
"""The cost of assigning no phone to a person, so that a phone of a greater cost is never assigned. The value is above
11.8, the 99.7 % quantile of chi-square with 2 degrees of freedom, because the shadowing of neighboring samples is not
independent."""
_NEAR_M: Final = 400.0
"""A person does not carry a phone if the middle of its filter's grid, near the strongest power, is farther away."""
_BESIDE_M: Final = 150.0
"""A confirmed survivor can only have been mistaken for people within this distance."""
_BY_SIDE_M: Final = 15.0
"""People at no more than this distance are found together, so it makes no difference which of their phones is whose."""
_IMPOSSIBLE: Final = 1e6
"""The cost of a pair that is excluded."""
_REFUTED_COST: Final = 9.0
"""An additional cost at a place where the same survivor was confirmed by mistake, because other UAVs know better."""
_SECOND_GATE: Final = 6.0
"""The cost of assigning no phone to a second person, who is then not taken for a second one."""


class Identities:
    """The people whom one UAV has seen, and the phones that they carry."""

    def __init__(self, survivors: KnownSurvivors) -> None:
        self._survivors = survivors
        self._people: list[PersonTrack] = []

    def on_sighting(self, at: Enu, *, sigma_m: float, close: bool, now_ns: int, sensor: str = "camera") -> int | None:
        """A sensor has shown a person; `close`: from so near that it certainly is one. All that one reading of a sensor
        shows has the same instant.

        Returns the survivor whose phone was last assigned to that person.
        """
        near = min(self._people, key=lambda person: person.place.distance_m(at), default=None)
        variance = sigma_m * sigma_m
        if near is None or near.place.distance_m(at) > max(SAME_PLACE_M, _SAME_SIGMAS * sigma_m):
            place = Estimate(at.east, at.north, variance, 0.0, variance)
            near = PersonTrack(place, now_ns, now_ns, shown_by=(sensor, now_ns))
            self._people.append(near)
        else:
            near.on_sighting(at, variance, (sensor, now_ns))
        near.close_sightings += close
        return near.survivor

    def review(self, now_ns: int) -> list[int]:
        """Assign phones to people anew; returns the survivors who may be confirmed now, in the order of ids."""
        self._people = [person for person in self._people if person.is_remembered(now_ns)]
        for person in self._people:
            person.on_neighborhood(confirmed=self._confirmed_at(person.place.at), now_ns=now_ns)
            person.survivor = None if person.unnamed else person.survivor
        for survivor in self._survivors.unconfirmed():
            self._survivors.by_id[survivor].filter.on_sighting(None)
        people = [person for person in self._people for _ in range(person.unnamed)]
        phones = self._phones(people)
        if not people or not phones:
            return []
        costs = [[self._cost_of(person, phone) for phone in phones] for person in people]
        nobody = [_SECOND_GATE if person.confirmed else _GATE for person in people]
        least, chosen = _assigned(costs, nobody)
        sure = []
        for person, column in zip(people, chosen, strict=True):
            if column is None:
                continue
            person.survivor = survivor = phones[column]
            known = self._survivors.by_id[survivor]
            known.filter.on_sighting(person.place)
            if is_confirmable(person, known):
                margin = self._next_best(costs, nobody, people, column, person) - least
                if margin >= required_margin(person, now_ns):
                    sure.append(survivor)
        return sorted(sure)

    def against(self, confirmed: Found) -> float:
        """How much less likely a confirmed pair is than the best assignment without it.

        The result is 0 or less if the pair belongs to the best assignment. All people near the place of this
        confirmation are considered, those who were seen and those who are confirmed.
        """
        at = estimate_of(confirmed).at
        named = {
            survivor: place
            for survivor, known in sorted(self._survivors.by_id.items())
            if known.confirmed is not None
            and (place := known.place()) is not None
            and place.distance_m(at) <= _BESIDE_M
        }
        seen = [
            person.place
            for person in self._people
            if is_seen_enough(person) and person.place.distance_m(at) <= _BESIDE_M
            if all(place.distance_m(person.place.at) > SAME_PLACE_M for place in named.values())
        ]
        people = [*named.values(), *seen]
        phones = [*named, *self._unconfirmed_near(people)]
        costs = [[self._cost(place, phone) for phone in phones] for place in people]
        nobody = [_GATE] * len(people)
        least, _ = _assigned(costs, nobody)
        row = phones.index(confirmed.survivor)
        kept = [[cost if column == row else _IMPOSSIBLE for column, cost in enumerate(costs[row])]]
        only = [_IMPOSSIBLE if at_row == row else cost for at_row, cost in enumerate(nobody)]
        return _assigned([*costs[:row], *kept, *costs[row + 1 :]], only)[0] - least

    def _confirmed_at(self, at: Enu) -> int:
        """The number of survivors who are confirmed at this place."""
        return sum(
            known.confirmed is not None
            and (place := known.place()) is not None
            and place.distance_m(at) <= SAME_PLACE_M
            for known in self._survivors.by_id.values()
        )

    def _next_best(
        self,
        costs: Sequence[Sequence[float]],
        nobody: Sequence[float],
        people: Sequence[PersonTrack],
        column: int,
        person: PersonTrack,
    ) -> float:
        """The least total cost if neither this person nor anybody beside carries this phone: whoever finds one of them
        finds the others.

        Carrying none is made more expensive by `GREATEST_MARGIN`, except for a second person at a confirmed place.
        """
        others = [list(one) for one in costs]
        bound = list(nobody)
        for row, other in enumerate(people):
            if other.place.distance_m(person.place.at) <= _BY_SIDE_M:
                others[row][column] = _IMPOSSIBLE
            if other is person:
                bound[row] += 0.0 if person.confirmed else GREATEST_MARGIN
        return _assigned(others, bound)[0]

    def _phones(self, people: Sequence[PersonTrack]) -> list[int]:
        """The unconfirmed survivors whose phones one of these people may carry."""
        return self._unconfirmed_near([person.place for person in people])

    def _unconfirmed_near(self, places: Sequence[Estimate]) -> list[int]:
        """The unconfirmed survivors whose phones were received near one of these places."""
        return [
            survivor
            for survivor in self._survivors.unconfirmed()
            if self._survivors.by_id[survivor].reporters
            and any(self._survivors.by_id[survivor].filter.near(place.at, within_m=_NEAR_M) for place in places)
        ]

    def _cost_of(self, person: PersonTrack, survivor: int) -> float:
        """The cost of one pair.

        At a place where a survivor is confirmed, a second person can only carry a phone whose place is well known,
        because any other phone that was received not far from there would fit, too.
        """
        if person.confirmed and not self._survivors.by_id[survivor].is_heard_within(SECOND_SIGMA_M):
            return _IMPOSSIBLE
        return self._cost(person.place, survivor)

    def _cost(self, place: Estimate, survivor: int) -> float:
        """The cost of one pair by received powers, and by earlier refutations."""
        known, at = self._survivors.by_id[survivor], place.at
        doubt = _REFUTED_COST if known.was_mistaken_at(at) else 0.0
        return min(_IMPOSSIBLE, known.filter.deficit(at.east, at.north) + doubt)


def _assigned(costs: Sequence[Sequence[float]], nobody: Sequence[float]) -> tuple[float, list[int | None]]:
    """The least total cost, and the phone of each person; `nobody` has the cost that a person carries none of them."""
    phones, people = len(costs[0]), len(costs)
    table = [[*row, *(nobody[i] if i == j else _IMPOSSIBLE for j in range(people))] for i, row in enumerate(costs)]
    chosen = assign(table)
    total = math.fsum(table[i][column] for i, column in enumerate(chosen))
    return total, [column if column < phones else None for column in chosen]
