"""Decides that a survivor is inside a building: the phone is most probably there, and nobody lies around it.

probability of a place   by the received powers, little of that where the camera has looked and seen nobody
verdict                  all buildings of the map together are `_SURE` of that; the most probable one is named
"""

import math
from collections.abc import Callable
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.phone_localization import CELL_M, Estimate
from agents.mission.navigation.onboard_map import Building, OnboardMap

_LIKELY: Final = 12.0
"""Places less probable than the most probable one by more than this count for nothing (twice a log-likelihood)."""
_MISSED: Final = (1.0, 0.03, 0.01)
"""The probability that the camera has not shown a person at a place at which it looked from no side, one, or more."""
_SURE: Final = 0.7
_HEARD_M: Final = 40.0
"""There is no verdict on a phone whose place, by received powers, has a greater standard deviation than this."""
_STEPS: Final = 4
"""Each cell of the phone's filter is divided into so many rows and columns, because buildings are as small as cells."""


def place_in_building(
    known: KnownSurvivor, onboard_map: OnboardMap, looked_at: Callable[[float, float], int]
) -> Estimate | None:
    """A survivor's place in the most probable building; None if not certain enough to be in one. `looked_at`: from how
    many sides the camera has shown a place.
    """
    if not onboard_map.buildings or not known.is_heard_within(_HEARD_M):
        return None
    inside: dict[Building, list[tuple[float, float, float]]] = {}
    outside = 0.0
    for east, north, deficit in known.filter.likely_cells(_LIKELY):
        weight = math.exp(-deficit / 2) / (_STEPS * _STEPS)
        near = [one for one in onboard_map.buildings if one.outside(east, north)[0] <= CELL_M]
        outside_weight = weight * _MISSED[min(looked_at(east, north), len(_MISSED) - 1)]
        for step in range(_STEPS * _STEPS):
            at_east = east + CELL_M * ((step % _STEPS + 0.5) / _STEPS - 0.5)
            at_north = north + CELL_M * ((step // _STEPS + 0.5) / _STEPS - 0.5)
            building = next((one for one in near if one.outside(at_east, at_north)[0] <= 0.0), None)
            if building is None:
                outside += outside_weight
            else:
                inside.setdefault(building, []).append((weight, at_east, at_north))
    by_building = {building: math.fsum(weight for weight, _, _ in points) for building, points in inside.items()}
    total = math.fsum(by_building.values())
    if total <= 0.0 or total < _SURE * (total + outside):
        return None
    likeliest = max(by_building, key=lambda building: (by_building[building], building))
    return _moments(inside[likeliest], by_building[likeliest])


def _moments(points: list[tuple[float, float, float]], total: float) -> Estimate:
    east = math.fsum(weight * e for weight, e, _ in points) / total
    north = math.fsum(weight * n for weight, _, n in points) / total
    grain_m2 = (CELL_M / _STEPS) ** 2 / 12
    return Estimate(
        east,
        north,
        math.fsum(weight * (e - east) ** 2 for weight, e, _ in points) / total + grain_m2,
        math.fsum(weight * (e - east) * (n - north) for weight, e, n in points) / total,
        math.fsum(weight * (n - north) ** 2 for weight, _, n in points) / total + grain_m2,
    )
