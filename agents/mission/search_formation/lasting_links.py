"""Who flies to which place of a formation, so that the swarm is one network all the way.

All leave and arrive at one instant and fly straight, so a link lasts if it exists at both ends of the way. From the
assignment with the least sum of squared distances, pairs exchange places, at first also if that is for the worse
(simulated annealing; Kirkpatrick, Gelatt and Vecchi, Science 220, 1983), until links that last join all UAVs that are
joined at the start: who is known of but not of whom it hears is joined with nobody, and must not stop this. Links are
bit masks, because a node can do nothing else meanwhile: 45 are mostly joined within 40 ms
(`tests/benchmarks/keeping_together.py`).
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from agents.mission.hungarian import assign
from fanet_mw.units import Enu

LASTING: Final = 0.97
"""A link is relied on that is at most this share of the radio's reach long."""
_TRIES: Final = 12_000
"""So many exchanges are tried at most."""
_SHORTENED: Final = 1_500
"""Once links join all, so many exchanges are tried that make ways shorter and leave all joined."""
_PART_M2: Final = 425.0**2
"""Squared ways may be longer by so much in sum if the UAVs fall into one part less."""
_HEAT: Final = 0.6
"""The first temperature of the annealing, as a multiple of `_PART_M2`; it falls to 0 linearly."""
_LONGEST: Final = 1.08
"""No way becomes longer than this multiple of the longest one of the first assignment."""


def keep_together(
    starts: Sequence[Enu],
    goals: Sequence[Enu],
    dearer_m2: Callable[[int, int], float],
    *,
    reach_m: float,
    random: Callable[[], float],
) -> tuple[list[int], bool]:
    """The goal of each UAV (there are at least as many goals as UAVs), and whether links that last join all UAVs that
    are joined at the start; if not, the goals are those of the least sum. `dearer_m2`: the extra cost of a UAV at a
    goal [m2], added to its squared way there.
    """
    ways = [[start.horizontal_to(goal) for goal in goals] for start in starts]
    costs = [[way * way + dearer_m2(uav, goal) for goal, way in enumerate(row)] for uav, row in enumerate(ways)]
    least = assign(costs)
    links = _Links(starts, goals, list(least), LASTING * reach_m)
    longest_m = _LONGEST * max((ways[uav][goal] for uav, goal in enumerate(least)), default=0.0)
    allowed = [[goal for goal, way in enumerate(row) if way <= longest_m] for row in ways]
    return (links.chosen, True) if _join(links, costs, allowed, random) else (least, False)


def _join(
    links: "_Links", costs: Sequence[Sequence[float]], allowed: Sequence[Sequence[int]], random: Callable[[], float]
) -> bool:
    """Exchange allowed goals until all UAVs are joined that are at the start, and then to shorten ways; False if they
    cannot be joined.
    """
    chosen, parts, least, left = links.chosen, links.parts(), links.parts_at_start, _SHORTENED
    if parts <= least:
        return True  # no ways are shorter than the first ones
    holder = {goal: uav for uav, goal in enumerate(chosen)}
    for tried in range(_TRIES):
        joined = parts <= least
        left -= joined
        if not left:
            break
        a = int(random() * len(chosen))
        b = holder.get(allowed[a][int(random() * len(allowed[a]))], a)
        if a == b or chosen[a] not in allowed[b]:
            continue
        longer_m2 = costs[a][chosen[b]] + costs[b][chosen[a]] - costs[a][chosen[a]] - costs[b][chosen[b]]
        if joined and longer_m2 >= 0:
            continue
        masks = links.exchanged(a, b)
        after = _parts(masks)
        worse_m2 = (after - parts) * _PART_M2 + longer_m2
        heat_m2 = _HEAT * _PART_M2 * (1 - tried / _TRIES)
        if after <= least or (not joined and (worse_m2 <= 0 or random() < math.exp(-worse_m2 / heat_m2))):
            links.exchange(a, b, masks)
            holder[chosen[a]], holder[chosen[b]] = a, b
            parts = after
    return parts <= least


class _Links:
    """The links that last while each UAV flies to the goal that is `chosen` for it."""

    def __init__(self, starts: Sequence[Enu], goals: Sequence[Enu], chosen: list[int], reach_m: float) -> None:
        self.chosen = chosen
        self._near = _near(starts, reach_m)
        self._goals_near = [set(row) for row in _near(goals, reach_m)]
        self._masks = [self._mask(uav, goal) for uav, goal in enumerate(chosen)]

    def _mask(self, uav: int, goal: int) -> int:
        """The links of a UAV if it flew to a goal."""
        near, chosen, mask = self._goals_near[goal], self.chosen, 0
        for other in self._near[uav]:
            if chosen[other] in near:
                mask |= 1 << other
        return mask

    def exchanged(self, a: int, b: int) -> list[int]:
        """The links of all UAVs if two exchanged their goals."""
        chosen, masks = self.chosen, self._masks.copy()
        to_a, to_b = chosen[b], chosen[a]
        chosen[a], chosen[b] = to_a, to_b
        for uav, goal in ((a, to_a), (b, to_b)):
            after = self._mask(uav, goal)
            changed, masks[uav] = masks[uav] ^ after, after
            while changed:
                low = changed & -changed
                masks[low.bit_length() - 1] ^= 1 << uav
                changed ^= low
        chosen[a], chosen[b] = to_b, to_a
        return masks

    def exchange(self, a: int, b: int, masks: list[int]) -> None:
        """Two UAVs exchange their goals, after which these are the links of all."""
        self.chosen[a], self.chosen[b] = self.chosen[b], self.chosen[a]
        self._masks = masks

    @property
    def parts_at_start(self) -> int:
        return _parts([sum(1 << other for other in near) for near in self._near])

    def parts(self) -> int:
        """The number of parts into which the UAVs fall that are joined by links that last."""
        return _parts(self._masks)


def _parts(masks: Sequence[int]) -> int:
    """The number of parts of a graph, given the bits of the neighbors of each vertex."""
    left, parts = (1 << len(masks)) - 1, 0
    while left:
        parts += 1
        reached = left & -left
        left ^= reached
        while reached and left:
            low = reached & -reached
            new = masks[low.bit_length() - 1] & left
            left ^= new
            reached ^= low | new
    return parts


def _near(points: Sequence[Enu], reach_m: float) -> list[list[int]]:
    return [
        [b for b, other in enumerate(points) if b != a and point.horizontal_to(other) <= reach_m]
        for a, point in enumerate(points)
    ]
