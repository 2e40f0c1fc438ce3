"""Decides that a survivor is inside a building: the phone is most probably there, and nobody lies around it.

probability of a place   by the received powers, little of that where cameras have looked and seen nobody
verdict                  buildings have `_SURE` of the probability: the one of the map that has `_NAMED` of it is named,
                         else ground where the map lacks buildings, if that has as much
after a while            the mean place in all buildings
"""

import math
from collections.abc import Callable
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivor
from agents.mission.finding.phone_localization import CELL_M, Estimate, weighted
from agents.mission.navigation.onboard_map import Building, OnboardMap

_LIKELY: Final = 12.0
"""Places less probable than the most probable one by more than this count for nothing (twice a log-likelihood)."""
_MISSED: Final = (1.0, 0.03, 0.01, 0.003)
"""The probability that cameras have not shown a person at a place at which they looked from no side, one, two, more."""
_UNKNOWN: Final = 0.015
"""The share of the ground, where buildings are, on which there is one that the map lacks."""
_SURE: Final = 0.7
_NAMED: Final = 0.6
_HEARD_M: Final = 60.0
"""There is no verdict on a phone whose place, by received powers, has a greater standard deviation than this."""
_UNKNOWN_M: Final = 40.0
"""The same of the place in a building that the map lacks, or in one of several."""
_STEPS: Final = 4
"""Each cell of the phone's filter is divided into so many rows and columns, because buildings are as small as cells."""

_Point = tuple[float, float, float]
"""A place: its weight, east and north."""


def place_in_building(
    known: KnownSurvivor, onboard_map: OnboardMap, sides: Callable[[float, float], int], *, patient: bool = True
) -> Estimate | None:
    """A survivor's place in the most probable building; None if not certain enough to be in one. `sides`: from how many
    sides cameras have shown a place (`looked_at.py`); `patient`: wait until it is clear in which one.
    """
    if not onboard_map.buildings or not known.is_heard_within(_HEARD_M):
        return None
    inside, outside = _weighed(known, onboard_map, sides)
    by_building = {building: math.fsum(weight for weight, _, _ in points) for building, points in inside.items()}
    total = math.fsum([*by_building.values(), outside])
    if math.fsum(by_building.values()) < _SURE * total:
        return None
    unknown = by_building.pop(None, 0.0)
    named = max(by_building, key=lambda one: (by_building[one], one), default=None)
    if named is not None and by_building[named] >= _NAMED * total:
        return weighted(inside[named], grain_m=CELL_M / _STEPS)
    if patient and unknown < _NAMED * total:
        return None
    somewhere = inside[None] if unknown >= _NAMED * total else [point for points in inside.values() for point in points]
    place = weighted(somewhere, grain_m=CELL_M / _STEPS)
    return place if place.sigma_m <= _UNKNOWN_M else None


def _weighed(
    known: KnownSurvivor, onboard_map: OnboardMap, sides: Callable[[float, float], int]
) -> tuple[dict[Building | None, list[_Point]], float]:
    """Where in each building a phone may be, in None for those that the map lacks; and the weight of all outside."""
    inside: dict[Building | None, list[_Point]] = {}
    outside, half_m = 0.0, known.filter.half_m
    for east, north, deficit in known.filter.likely_cells(_LIKELY):
        weight = math.exp(-deficit / 2) / (_STEPS * _STEPS)
        near = [one for one in onboard_map.buildings if one.outside(east, north)[0] <= CELL_M]
        for step in range(_STEPS * _STEPS):
            at_east = east + CELL_M * ((step % _STEPS + 0.5) / _STEPS - 0.5)
            at_north = north + CELL_M * ((step // _STEPS + 0.5) / _STEPS - 0.5)
            if max(abs(at_east), abs(at_north)) > half_m:
                continue
            building = next((one for one in near if one.outside(at_east, at_north)[0] <= 0.0), None)
            share = _UNKNOWN if building is None else 1.0
            inside.setdefault(building, []).append((weight * share, at_east, at_north))
            missed = _MISSED[min(sides(at_east, at_north), len(_MISSED) - 1)]
            outside += weight * (1 - share) * missed
    return inside, outside
