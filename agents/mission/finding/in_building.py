"""Decides that a survivor is inside a building: the phone is most probably there, and nobody lies around it.

probability of a place   by the received powers, little of that where cameras have looked and seen nobody
verdict                  buildings together are `_SURE` of that: the most probable one of the map is named, or the place
                         at which there is one that the map lacks
"""

import math
from collections.abc import Callable
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.phone_localization import CELL_M, Estimate, weighted
from agents.mission.navigation.onboard_map import Building, OnboardMap

_LIKELY: Final = 12.0
"""Places less probable than the most probable one by more than this count for nothing (twice a log-likelihood)."""
_MISSED: Final = (1.0, 0.03, 0.01)
"""The probability that the camera has not shown a person at a place at which it looked from no side, one, or more."""
_UNKNOWN: Final = 0.03
"""The share of the ground, where buildings are, on which there is one that the map lacks."""
_SURE: Final = 0.7
_HEARD_M: Final = 40.0
"""There is no verdict on a phone whose place, by received powers, has a greater standard deviation than this."""
_STEPS: Final = 4
"""Each cell of the phone's filter is divided into so many rows and columns, because buildings are as small as cells."""


def place_in_building(
    known: KnownSurvivor, onboard_map: OnboardMap, sides: Callable[[float, float], int]
) -> Estimate | None:
    """A survivor's place in the most probable building; None if not certain enough to be in one. `sides`: from how many
    sides cameras have shown a place (`looked_at.py`).
    """
    if not onboard_map.buildings or not known.is_heard_within(_HEARD_M):
        return None
    inside: dict[Building | None, list[tuple[float, float, float]]] = {}
    outside = 0.0
    for east, north, deficit in known.filter.likely_cells(_LIKELY):
        weight = math.exp(-deficit / 2) / (_STEPS * _STEPS)
        near = [one for one in onboard_map.buildings if one.outside(east, north)[0] <= CELL_M]
        missed = _MISSED[min(sides(east, north), len(_MISSED) - 1)]
        for step in range(_STEPS * _STEPS):
            at_east = east + CELL_M * ((step % _STEPS + 0.5) / _STEPS - 0.5)
            at_north = north + CELL_M * ((step // _STEPS + 0.5) / _STEPS - 0.5)
            building = next((one for one in near if one.outside(at_east, at_north)[0] <= 0.0), None)
            share = _UNKNOWN if building is None else 1.0
            inside.setdefault(building, []).append((weight * share, at_east, at_north))
            outside += weight * (1 - share) * missed
    by_building = {building: math.fsum(weight for weight, _, _ in points) for building, points in inside.items()}
    total = math.fsum(by_building.values())
    if total < _SURE * (total + outside):
        return None
    unknown = by_building.pop(None, 0.0)
    named = max(by_building, key=lambda one: (by_building[one], one), default=None)
    likeliest = None if unknown > math.fsum(by_building.values()) else named
    return weighted(inside[likeliest], grain_m=CELL_M / _STEPS)
