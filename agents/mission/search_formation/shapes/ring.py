"""The formation `ring`: all UAVs on a square about the middle of the area that grows to its edges, and back, and again.

Neighbors along the square stay within radio reach, so the loss of any one separates nobody. While it is small, every
second UAV far from a corner may leave it for a survivor; one near a corner would not catch up with it. Every side has
the same number of UAVs, and up to three that are left over fly behind the ring.
"""

import math
from typing import Final

from agents.mission.search_formation.shapes.contract import (
    BACK,
    EDGE_M,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    RowKind,
    RowOfPlaces,
    Shape,
    ShapeName,
    Swarm,
    swept_m,
)
from fanet_mw.units import Enu

_FIRST_M: Final = 45.0
"""The distance of two neighbors along the square when it begins to grow, if it is no larger than `_INNER` then."""
_INNER: Final = 0.8
"""At first the middle is within this share of the radio's reach from the ring: UAVs may leave it for there."""
_BEHIND: Final = 0.4
"""At first a follower is at this share of the ring's half-side, to receive what lies in the middle."""
_ENOUGH: Final = 0.9
"""The ring turns `EDGE_M` from the edge if neighbors are at most this share of the greatest distance apart there."""
_CORNERS: Final = 4
_CATCHES_UP: Final = 0.6
"""A UAV within this share of half a side from its middle catches up with the ring when it has left it."""
_TURN_S: Final = 30.0
"""How long the ring waits at the edge: all is searched, and who was heard there last is still to be seen."""
_SLOWER: Final = BACK / math.sqrt(2)
"""The speed of the sides, as a multiple of the speed of the sweep: the corners, which are faster by the root of 2, fly
no faster than others on a way back, so that whoever has fallen behind can catch up."""


class Ring(Shape):
    """The positions of the places of one ring."""

    def __init__(self, formation: Dimensions, *, most_m: float = math.inf) -> None:
        self._formation = formation
        self._most_m = most_m
        self._followers = range(formation.fixed, formation.places)

    @property
    def sweep_s(self) -> float:
        return (self._formation.last_m - self._formation.first_m) / (self._formation.speed_m_s * _SLOWER)

    @property
    def lane_m(self) -> float:
        return 8 * self._formation.last_m / self._formation.lanes

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        half_m, up_m = self._half_m(swept_s), formation.height_m
        along = float(place)
        if place in self._followers:
            half_m = max(half_m - FOLLOW_M, _BEHIND * formation.first_m)
            along, up_m = formation.follower(int(place))[1] * formation.lanes, up_m + FOLLOWER_HIGHER_M
        side, share = self._side(along)
        east, north = ((1.0, share), (-share, 1.0), (-1.0, -share), (share, -1.0))[side]
        return Enu(half_m * east, half_m * north, up_m)

    def _side(self, place: float) -> tuple[int, float]:
        """The side of a place, and where on it the place is, from -1 to 1."""
        side, on_side = divmod(place, self._formation.lanes / _CORNERS)
        return int(side) % _CORNERS, 2 * on_side * _CORNERS / self._formation.lanes - 1

    def flown_at(self, place: float, swept_s: float) -> Enu:
        lanes = self._formation.lanes
        return self.at((place + self._turned(swept_s)) % lanes if place < lanes else place, swept_s)

    def _turned(self, swept_s: float) -> float:
        """By how many places all of the ring have moved along it: between their ways at each turn, as lines do."""
        turn, into_s = divmod(swept_s - self.sweep_s, 2 * self.sweep_s + _TURN_S)
        share = min(1.0, into_s / _TURN_S)
        return 0.0 if turn < 0 else (1 - share if turn % 2 else share) / 2

    def tethers(self, place: int) -> tuple[int, ...]:
        lanes = self._formation.lanes
        if place >= lanes:
            return ()
        return tuple(sorted({(place - 1) % lanes, (place + 1) % lanes} - {place}))

    def rows(self) -> tuple[RowOfPlaces, ...]:
        return (RowOfPlaces(0, self._formation.lanes, RowKind.AROUND),)

    def drawn_in(self, vacant: frozenset[int], hop_m: float) -> "Ring":
        return Ring(self._formation, most_m=self.rows()[0].left(vacant) * hop_m / 8)

    def may_leave(self, place: float, swept_s: float, *, reach_m: float, left: int) -> bool:
        _, share = self._side(place)
        return abs(share) <= _CATCHES_UP and self._half_m(swept_s) <= left * reach_m / 16

    def begun_around(self, swarm: Swarm) -> tuple[Dimensions, ...]:
        """The ring that begins as large as the swarm that stands about the middle, rather than draw together first."""
        made = self._formation
        if min(swarm.sides_m) <= 0:
            return ()
        return (made._replace(first_m=max(made.first_m, min(made.last_m / 2, math.fsum(swarm.sides_m) / 4))),)

    def apart_m(self, team: int, east_m: float, north_m: float, swept_s: float) -> float:
        half_m = self._half_m(swept_s)
        off_e, off_n = abs(east_m) - half_m, abs(north_m) - half_m
        if off_e <= 0 and off_n <= 0:
            return -max(off_e, off_n)
        return math.hypot(max(off_e, 0.0), max(off_n, 0.0))

    def _half_m(self, swept_s: float) -> float:
        formation = self._formation
        slower = formation._replace(speed_m_s=formation.speed_m_s * _SLOWER)
        return min(self._most_m, swept_m(slower, swept_s, faster_back=1.0, turn_s=_TURN_S))


def fitted(count: int, demands: Demands) -> Dimensions | None:
    """The ring of this number of UAVs; None if they are too few to span the edge of the area."""
    half, of_side = demands.area_m / 2, count // _CORNERS
    for edge_m, share in ((min(EDGE_M, demands.edge_m), _ENOUGH), (demands.edge_m, 1.0)):
        last = half - edge_m
        apart_m = share * min(demands.hop_m, 2 * math.sqrt(demands.seen_m**2 - edge_m**2))
        if of_side >= 2 and of_side * apart_m >= 2 * last:
            break
    else:
        return None
    lanes = of_side * _CORNERS
    first = min(lanes * _FIRST_M / 8, _INNER * demands.reach_m, last / 2)
    return Dimensions(
        lanes, 0, count - lanes, half, first, last, demands.height_m, demands.speed_m_s, ShapeName.RING, 1
    )
