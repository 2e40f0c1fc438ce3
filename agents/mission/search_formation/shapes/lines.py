"""The formation `lines`: two lines of UAVs that part from the middle of the area, a chain between them, and followers.

            line 0   o--o--o--o--o--o--o        both lines, nearly as wide as the area, begin near its middle and
                              |                 sweep away from each other to its edges, then back, and again
            followers   x  x  |  x  x           followers fly behind their line and are free to leave it
                              |  chain          the relays of the chain spread as the lines part
            line 1   o--o--o--o--o--o--o

The words place, lane, team, relay and follower are explained in `contract.py`; the teams of this formation are its
lines.

Between two turns each place of a line moves straight at constant speed. A relay does so, too, but changes its velocity
once, when the lines have flown `_STRAIGHT_M`. The distance of two such places is therefore a convex function of time
from a turn to that instant, and from that instant to the next turn: a pair that is within radio reach at these three
instants is within reach all the time. Followers start later than their line, and need not stay within reach of any
single place.
"""

import math
from typing import Final

from agents.mission.search_formation.shapes.contract import (
    EDGE_M,
    FIRST_M,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    RowKind,
    RowOfPlaces,
    swept_m,
)
from fanet_mw.units import Enu

_CHAIN_HIGHER_M: Final = 6.0
"""Relays fly this much higher than the lines."""
_BUNCHED_M: Final = 280.0
"""While the lines are near each other, relays due north and south of each other would be too close together. They are
therefore displaced to the east and the west as well, at first by up to this distance."""
_STRAIGHT_M: Final = 300.0
"""Once the lines have flown this far, the relays are no longer displaced: the chain is a straight line to the north."""
_SIDE_M: Final = 65.0
"""The distance of the outermost lanes from the edge of the area, at most a quarter of the area's side; a UAV there may
still shift to either side."""
_LEAST_LANES: Final = 2
"""The least number of lanes of a line, which has one at each end."""


class Lines:
    """The positions of the places of two lines, their chain and their followers."""

    def __init__(self, formation: Dimensions, *, most_m: float = math.inf) -> None:
        """`most_m`: how far from the middle the lines may be for the relays that are left."""
        self._formation = formation
        self._most_m = most_m

    @property
    def sweep_s(self) -> float:
        return (self._formation.last_m - self._formation.first_m) / self._formation.speed_m_s

    @property
    def lane_m(self) -> float:
        return 2 * self._formation.half_width_m / (self._formation.lanes - 1)

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        north, lanes = self._north_m(swept_s), formation.lanes
        if place <= 2 * lanes - 1:
            line, lane = divmod(place, lanes)
            return Enu(self._lane(lane), north if line == 0 else -north, formation.height_m)
        if place < formation.fixed:
            share = 1 - 2 * (place - 2 * lanes + 1) / (formation.relays + 1)
            east = -_BUNCHED_M * share * max(0.0, 1 - (north - formation.first_m) / _STRAIGHT_M)
            return Enu(self._lane(lanes // 2) + east, share * north, formation.height_m + _CHAIN_HIGHER_M)
        line, share = formation.follower(round(place))
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

    def rows(self) -> tuple[RowOfPlaces, ...]:
        lanes, relays = self._formation.lanes, self._formation.relays
        two = tuple(RowOfPlaces(first, lanes, RowKind.SPAN) for first in (0, lanes))
        return (*two, RowOfPlaces(2 * lanes, relays, RowKind.BETWEEN))

    def drawn_in(self, left: tuple[int, ...], hop_m: float) -> "Lines":
        formation = self._formation
        half_width_m = min(formation.half_width_m, max(1, min(left[:2]) - 1) * hop_m / 2)
        return Lines(formation._replace(half_width_m=half_width_m), most_m=(left[2] + 1) * hop_m / 2)

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        """The distance of a point from a line to the north or south; a line is taken to be as wide as the area."""
        north = self._north_m(swept_s)
        return abs(north_m - (north if team == 0 else -north))

    def _north_m(self, swept_s: float) -> float:
        return min(self._most_m, swept_m(self._formation, swept_s))

    def _lane(self, lane: float) -> float:
        """East of a lane [m]."""
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
