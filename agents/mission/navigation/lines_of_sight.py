"""When the line of sight to each neighbor ends: a building of the map cuts a link at once, however short it is.

Both UAVs are taken to fly straight on. Because they may turn, a building counts as wider and higher the farther ahead
an instant is.
"""

import math
from collections.abc import Iterable
from typing import Final

from agents.mission.navigation.onboard_map import Building, OnboardMap
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, NodeId, S

_AHEAD_S: Final = 10
"""How far ahead each line of sight is looked along. Bounds in rounds count on links for less than that in swarms of up
to about 250 UAVs; in greater ones a building may break a bound.
"""
_MARGIN_M: Final = 2.0
"""A building counts as wider on each side, and higher, by this."""
_TURNS_M_S: Final = 1.0
"""For an instant ahead it does so by this per second more."""
_MOST_MARGIN_M: Final = _MARGIN_M + _TURNS_M_S * _AHEAD_S


class LinesOfSight:
    """The lines of sight of one UAV among the buildings of its map."""

    def __init__(self, onboard_map: OnboardMap) -> None:
        self._buildings = [(one, math.hypot(one.width_m, one.depth_m) / 2) for one in onboard_map.buildings]
        self._highest_m = max((one.roof_m for one in onboard_map.buildings), default=-math.inf)

    def ends_ns(self, own: Motion, neighbors: Iterable[tuple[int, Motion]]) -> dict[NodeId, int]:
        """The instants at which lines of sight to these neighbors end, rounded to whole seconds from now; without those
        that do not end within `_AHEAD_S`.
        """
        found = ((node, self._left_s(own, motion)) for node, motion in neighbors)
        return {NodeId(node): own.at_ns + left_s * S for node, left_s in found if left_s is not None}

    def _left_s(self, own: Motion, other: Motion) -> int | None:
        """The whole seconds until a building comes between two UAVs; None if none does within `_AHEAD_S`."""
        here, there = own.position, other.position_at(own.at_ns)
        sinks_m = _AHEAD_S * max(0.0, -own.velocity.up, -other.velocity.up)
        if min(here.up, there.up) - sinks_m > self._highest_m + _MOST_MARGIN_M:
            return None
        east, north = (here.east + there.east) / 2, (here.north + there.north) / 2
        flown_m = _AHEAD_S * max(own.velocity.horizontal(), other.velocity.horizontal())
        reach_m = here.horizontal_to(there) / 2 + flown_m + _MOST_MARGIN_M
        near = [
            one
            for one, radius_m in self._buildings
            if math.hypot(one.east_m - east, one.north_m - north) <= reach_m + radius_m
        ]
        for at_s in range(_AHEAD_S + 1) if near else ():
            ends = here.plus(own.velocity, at_s), there.plus(other.velocity, at_s)
            if any(hides(one, *ends, margin_m=_MARGIN_M + _TURNS_M_S * at_s) for one in near):
                return at_s
        return None


def hides(building: Building, here: Enu, there: Enu, *, margin_m: float) -> bool:
    """True if a building, wider and higher by a margin, is between two places: the part of the line between them that
    lies within its walls leads below its roof.
    """
    cos, sin = math.cos(building.yaw_rad), math.sin(building.yaw_rad)
    first, last = 0.0, 1.0
    for extent_m, east, north in ((building.width_m, cos, sin), (building.depth_m, -sin, cos)):
        wall = extent_m / 2 + margin_m
        begin = east * (here.east - building.east_m) + north * (here.north - building.north_m)
        way = east * (there.east - here.east) + north * (there.north - here.north)
        if abs(way) < 1e-9:
            if abs(begin) > wall:
                return False
            continue
        enters, leaves = sorted(((-wall - begin) / way, (wall - begin) / way))
        first, last = max(first, enters), min(last, leaves)
        if first > last:
            return False
    rises = there.up - here.up
    return here.up + min(first * rises, last * rises) <= building.roof_m + margin_m
