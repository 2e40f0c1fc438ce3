"""The formation `lines`: two lines abreast that part from the middle of the area, a chain between them, and followers.

            line 0   o--o--o--o--o--o--o        both lines begin beside the middle of the area, as wide as the area,
                              |                 and sweep away from each other to its edges, then back, and again
            followers   x  x  |  x  x           followers fly behind their line and are free to leave it
                              |  chain          the chain between the lines stretches as they part
            line 1   o--o--o--o--o--o--o

Between two turns each place moves on a straight line at constant speed, so the distance of two places is a convex
function of time: a pair that is within reach at both turns is within reach all the time.
"""

import math
from typing import Final

from agents.mission.formation.shape import (
    EDGE_M,
    FIRST_M,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    swept_m,
)
from fanet_mw.units import Enu

_CHAIN_HIGHER_M: Final = 6.0
_BUNCHED_M: Final = 280.0
"""While the lines are near each other, the chain between them is slanted, and extends this far to either side."""
_STRAIGHT_M: Final = 300.0
"""The chain is straight once the lines have flown this far."""
_SIDE_M: Final = 65.0
"""The outermost lanes are this near to the edge of the area; a UAV may leave them sideways."""
_LEAST_LANES: Final = 2


class Lines:
    """The lines and the chain of one search."""

    def __init__(self, formation: Dimensions) -> None:
        self._formation = formation

    @property
    def sweep_s(self) -> float:
        return (self._formation.last_m - self._formation.first_m) / self._formation.speed_m_s

    @property
    def lane_m(self) -> float:
        return 2 * self._formation.half_width_m / (self._formation.lanes - 1)

    def at(self, place: int, swept_s: float) -> Enu:
        formation = self._formation
        north, lanes = swept_m(formation, swept_s), formation.lanes
        if place < 2 * lanes:
            line, lane = divmod(place, lanes)
            return Enu(self._lane(lane), north if line == 0 else -north, formation.height_m)
        if place < formation.fixed:
            share = 1 - 2 * (place - 2 * lanes + 1) / (formation.relays + 1)
            east = -_BUNCHED_M * share * max(0.0, 1 - (north - formation.first_m) / _STRAIGHT_M)
            return Enu(self._lane(lanes // 2) + east, share * north, formation.height_m + _CHAIN_HIGHER_M)
        line, share = formation.follower(place)
        behind = max(north - FOLLOW_M, formation.first_m * 0.5)
        east = formation.half_width_m * (2 * share - 1)
        return Enu(east, behind if line == 0 else -behind, formation.height_m + FOLLOWER_HIGHER_M)

    def tethers(self, place: int) -> tuple[int, ...]:
        lanes, relays = self._formation.lanes, self._formation.relays
        middle = lanes // 2
        found: list[int] = []
        if place < 2 * lanes:
            line, lane = divmod(place, lanes)
            found += [place - 1] if lane > 0 else []
            found += [place + 1] if lane < lanes - 1 else []
            if lane == middle:
                chain_end = 2 * lanes + (0 if line == 0 else relays - 1)
                found.append(chain_end if relays else (lanes + middle if line == 0 else middle))
        elif place < 2 * lanes + relays:
            found.append(place - 1 if place > 2 * lanes else middle)
            found.append(place + 1 if place < 2 * lanes + relays - 1 else lanes + middle)
        return tuple(found)

    def outward(self, place: int) -> range:
        lanes = self._formation.lanes
        if place >= 2 * lanes:
            return range(place, place + 1)
        first = place // lanes * lanes
        return range(place, first + lanes) if place - first >= lanes // 2 else range(place, first - 1, -1)

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a place from a line, which is its distance to the north or south, since a line is as wide as
        the area.
        """
        north = swept_m(self._formation, swept_s)
        return abs(north_m - (north if team == 0 else -north))

    def _lane(self, lane: int) -> float:
        return self._formation.half_width_m * (2 * lane / (self._formation.lanes - 1) - 1)


def fitted(count: int, demands: Demands) -> Dimensions | None:
    """The lines with which this number of UAVs can sweep a square area in one piece; None if they are too few."""
    half = demands.area_m / 2
    edge, side = min(EDGE_M, half / 2), min(_SIDE_M, half / 2)
    half_width = half - side
    lanes = max(_LEAST_LANES, math.ceil(2 * half_width / demands.apart_m(demands.reach_m)) + 1)
    last = half - edge
    relays = max(0, math.ceil(2 * last / demands.hop_m) - 1)
    followers = count - 2 * lanes - relays
    if followers < 0:
        return None
    first = min(FIRST_M, last / 2)
    return Dimensions(lanes, relays, followers, half_width, first, last, demands.height_m, demands.speed_m_s)
