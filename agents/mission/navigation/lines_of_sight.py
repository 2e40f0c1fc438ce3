"""When the line of sight to each neighbor ends: a building of the map cuts a link at once, whatever its distance.

Both fly straight on. Because they turn, buildings count as wider and higher the farther ahead an instant is.
"""

import math
from collections.abc import Iterable
from typing import Final

from agents.mission.navigation.onboard_map import Building, OnboardMap
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, NodeId, S

_AHEAD_S: Final = 10
"""A bound looks no farther ahead than this, whatever the number of nodes."""
_MARGIN_M: Final = 2.0
_TURNS_M_S: Final = 1.0
_MOST_MARGIN_M: Final = _MARGIN_M + _TURNS_M_S * _AHEAD_S


class LinesOfSight:
    """The lines of sight of one UAV among the buildings of its map."""

    def __init__(self, onboard_map: OnboardMap) -> None:
        self._buildings = [(one, math.hypot(one.width_m, one.depth_m) / 2) for one in onboard_map.buildings]
        self._highest_m = max((one.roof_m for one in onboard_map.buildings), default=-math.inf)

    def ends_ns(self, own: Motion, neighbors: Iterable[tuple[int, Motion]]) -> dict[NodeId, int]:
        """When each of these lines of sight ends that does so soon, in whole seconds from now."""
        found = ((node, self._left_s(own, motion)) for node, motion in neighbors)
        return {NodeId(node): own.at_ns + left_s * S for node, left_s in found if left_s is not None}

    def _left_s(self, own: Motion, other: Motion) -> int | None:
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
    """True if a building with a margin around it is between two places: the line between them, clipped to each pair of
    its walls, leads below its roof.
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
