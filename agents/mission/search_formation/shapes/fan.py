r"""The formation `fan`: all UAVs on a front that spreads from the base over the area, to its far sides.

    o---o---o---o---o     each UAV flies straight away from the base to a place of its own on the far sides of the area,
    |   \   |   /   |     and waits there; neighbors stay within radio reach, so the front is one chain from one end of
    o-.  \  |  /  .-o     the far sides to the other
       `-. \|/ .-'
           base           no time is lost on the way to the places: it is a part of the search

All begin at the same share of their ways, and fly at the same speed. A few UAVs left over fly behind the front. A fan
is one team without relays (`contract.py`).
"""

import math
from itertools import pairwise
from typing import Final

from agents.mission.search_formation.shapes.contract import (
    BACK,
    FOLLOW_M,
    FOLLOWER_HIGHER_M,
    Demands,
    Dimensions,
    Shape,
    ShapeName,
    swept_m,
)
from fanet_mw.units import Enu

_APART_M: Final = 30.0
"""The distance of two neighbors when the front begins to spread."""
_HALVINGS: Final = 20

Corners = tuple[tuple[float, float], ...]


class Fan(Shape):
    """The places of one fan; `first_m` and `last_m` are the base, east and north of the area's middle."""

    def __init__(self, formation: Dimensions, *, most_m: float = math.inf) -> None:
        self._formation = formation
        self._base = formation.first_m, formation.last_m
        self._corners = _far_sides(formation.half_width_m, self._base)
        self._along_m = math.fsum(math.dist(a, b) for a, b in pairwise(self._corners))
        self._begins = min(0.5, _APART_M / self.lane_m)
        """The share of its way that each UAV has flown when the front begins to spread."""
        self._most_m = most_m
        self._ways: dict[float, tuple[float, float, float]] = {}
        farthest_m = max(math.dist(self._base, corner) for corner in self._corners)
        self._spread = formation._replace(
            first_m=self._begins * farthest_m, last_m=farthest_m, speed_m_s=BACK * formation.speed_m_s
        )

    @property
    def sweep_s(self) -> float:
        return (self._spread.last_m - self._spread.first_m) / self._spread.speed_m_s

    @property
    def lane_m(self) -> float:
        return self._along_m / max(1, self._formation.lanes - 1)

    def at(self, place: float, swept_s: float) -> Enu:
        formation = self._formation
        flown_m = swept_m(self._spread, swept_s, faster_back=1.0) - self._spread.first_m
        if place <= formation.lanes - 1:
            east, north = self._on_front(place * self.lane_m, flown_m)
            return Enu(east, north, formation.height_m)
        along_m = formation.follower(round(place))[1] * self._along_m
        east, north = self._on_front(along_m, flown_m, behind_m=FOLLOW_M)
        return Enu(east, north, formation.height_m + FOLLOWER_HIGHER_M)

    def _on_front(self, along_m: float, flown_m: float, *, behind_m: float = 0.0) -> tuple[float, float]:
        """East and north of a UAV bound for a place so far along the far sides, so far after the front began."""
        east, north, way_m = self._way(along_m)
        out_m = min(way_m, self._begins * way_m + flown_m, self._most_m)
        share = max(out_m - behind_m, self._begins * way_m / 2) / way_m if behind_m else out_m / way_m
        return self._base[0] + share * east, self._base[1] + share * north

    def _way(self, along_m: float) -> tuple[float, float, float]:
        """How far to the east and the north of the base a place on the far sides is, and how far at all."""
        way = self._ways.get(along_m)
        if way is None:
            east, north = self._on_sides(along_m)
            east, north = east - self._base[0], north - self._base[1]
            way = self._ways[along_m] = east, north, math.hypot(east, north)
        return way

    def _on_sides(self, along_m: float) -> tuple[float, float]:
        """East and north of a place on the far sides of the area."""
        for (east, north), (to_east, to_north) in pairwise(self._corners):
            side_m = math.hypot(to_east - east, to_north - north)
            if along_m <= side_m or (to_east, to_north) == self._corners[-1]:
                share = min(1.0, along_m / side_m)
                return east + share * (to_east - east), north + share * (to_north - north)
            along_m -= side_m
        raise AssertionError("a fan has sides")

    def tethers(self, place: int) -> tuple[int, ...]:
        lanes = self._formation.lanes
        if place >= lanes:
            return ()
        return tuple(other for other in (place - 1, place + 1) if 0 <= other < lanes)

    def drawn_in(self, vacant: frozenset[int], hop_m: float) -> "Fan":
        """The fan whose front stops where the UAVs that are left still span it with gaps of at most a hop."""
        row = self.rows()[0]
        flown = row.shared(frozenset(row.places[max(1, row.left(vacant)) :])).values() or row.places

        def is_spanned(most_m: float) -> bool:
            fan = Fan(self._formation, most_m=most_m)
            front = [fan.at(place, self.sweep_s) for place in flown]
            return all(a.horizontal_to(b) <= hop_m for a, b in pairwise(front))

        least, most = 0.0, self._spread.last_m
        if is_spanned(most):
            return Fan(self._formation)
        for _ in range(_HALVINGS):
            middle = (least + most) / 2
            least, most = (middle, most) if is_spanned(middle) else (least, middle)
        return Fan(self._formation, most_m=least)


def _far_sides(half_m: float, base: tuple[float, float]) -> Corners:
    """Corners of the sides of the square turned away from a base outside it, in order; none for one inside."""
    east, north = base
    corners = ((half_m, -half_m), (half_m, half_m), (-half_m, half_m), (-half_m, -half_m))
    away = (east < half_m, north < half_m, east > -half_m, north > -half_m)  # the eastern side first
    if all(away):
        return ()
    first = next(side for side in range(4) if away[side] and not away[side - 1])
    count = sum(away)
    return tuple(corners[(first + step) % 4] for step in range(count + 1))


def fitted(count: int, demands: Demands) -> Dimensions | None:
    """The fan of this number of UAVs; None if they are too few for the far sides, or the base is in the area."""
    half = demands.area_m / 2 - demands.edge_m
    corners = _far_sides(half, demands.base_m)
    if not corners:
        return None
    along_m = math.fsum(math.dist(a, b) for a, b in pairwise(corners))
    lanes = max(2, 1 + math.ceil(along_m / demands.apart_m(demands.reach_m)))
    if lanes > count:
        return None
    east, north = demands.base_m
    return Dimensions(lanes, 0, count - lanes, half, east, north, demands.height_m, demands.speed_m_s, ShapeName.FAN, 1)
