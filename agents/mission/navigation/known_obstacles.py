"""The obstacles that one UAV knows from its map and its radar, and how it flies around them.

The way leads the UAV on, and half-planes keep it clear: the nearer an obstacle is, the slower a UAV may fly towards it.
It flies over roofs that are below it, and around everything else (docs/explanation/search-flight.md, Obstacles).
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

from agents.mission.navigation.half_planes import HalfPlane
from agents.mission.navigation.onboard_map import CELL_M, TILE_M, Cell, OnboardMap, cell_of, indexed, middle_of
from agents.mission.navigation.shortest_way import Place, first_corner, is_clear, nearest_free, way_around
from fanet_mw.bus.messages import Echo
from fanet_mw.units import Enu, S, seconds_to_ns

OVER_M: Final = 7.0
"""A UAV flies over a roof that is at least this far below it, and climbs this far above one in its way."""
_CLEAR_M: Final = 6.0
"""A UAV chooses no velocity that brings it nearer to a wall than this."""
_MARGIN_M: Final = 11.0
"""Ways keep this distance from walls, at which walls do not slow a UAV down."""
_APPROACH_S: Final = 2.5
"""A UAV approaches the clearance so slowly that the remaining distance would take at least this time."""
_WATCH_M: Final = 35.0
"""Walls farther away than this do not limit a UAV that flies at 10 m/s."""
_MOST_PLANES: Final = 6
"""The number of obstacles, the nearest ones, that limit the velocity."""
_LOCAL_M: Final = 150.0
"""The way is searched up to this distance."""
_MOST_CELLS: Final = 3000
"""The greatest number of cells that a search for a way examines."""
_REPLAN_NS: Final = 1 * S
"""The interval at which a way is searched anew."""
_AHEAD_S: Final = 20
"""If the goal is inside a wall, the UAV waits where it will come out, if that is within this time."""
_RINGS: Final = 16
"""The greatest distance in cells between a goal inside an obstacle and the free place to fly to instead."""
_EXPLAINED_M: Final = 4.0
"""An echo this near to a wall on the map comes from that wall."""
_NEIGHBOR_M: Final = 15.0
"""An echo this near to the stated place of a neighbor comes from that neighbor."""
_MOVES_M_S: Final = 2.0
"""An echo that moves along the ray faster than this is not a wall."""
_ONCE_NS: Final = 3 * S
_AGAIN_NS: Final = 15 * S
"""How long an echo counts as solid. A first echo may be noise; a second one beside it hardly is."""
_MOVER_NS: Final = seconds_to_ns(1.2)
"""How long a flying body that the radar has shown is avoided; half as long once there is a further scan."""

_Circle = tuple[float, float, float]
"""East, north and radius."""


class Mover(NamedTuple):
    """Something that flies, as the radar shows it; only the part of its velocity along the ray is known."""

    position: Enu
    velocity: Enu
    at_ns: int


class _Echoed(NamedTuple):
    """An obstacle in a cell, as echoes show it."""

    top_m: float
    until_ns: int


class KnownObstacles:
    """The known obstacles of one UAV, and the way around them."""

    def __init__(self, onboard_map: OnboardMap, no_fly_m: Sequence[_Circle] = ()) -> None:
        self._map = onboard_map
        self._index = indexed(onboard_map, margin_m=_MARGIN_M, watch_m=_WATCH_M)
        self._no_fly = tuple(no_fly_m)
        self._echoes: dict[Cell, _Echoed] = {}
        self._taken: dict[Cell, _Echoed] = {}
        """The cells with echoes, and those within the margin around them."""
        self._movers: list[Mover] = []
        self.hovering: Sequence[tuple[Enu, float]] = ()
        """Where lost UAVs may be in the way, each with a radius, as `NeighborMotions.hovering` says."""
        self._corner: Place | None = None
        self._planned_ns: int | None = None
        self._any = bool(onboard_map.buildings or no_fly_m)

    # --- input ----------------------------------------------------------------------------------------------------

    def radar(self, echoes: Sequence[Echo], *, at: Enu, velocity: Enu, neighbors: Sequence[Enu], now_ns: int) -> None:
        """A scan of the radar; `neighbors` are the present places of the neighbors that are received."""
        self._movers = [mover for mover in self._movers if now_ns - mover.at_ns < _MOVER_NS // 2]
        for cells in (self._echoes, self._taken):  # each fix looks at all echoes, and false ones would pile up
            for cell in [cell for cell, echoed in cells.items() if echoed.until_ns <= now_ns]:
                del cells[cell]
        for echo in echoes:
            flat, up = echo.range_m * math.cos(echo.elevation_rad), echo.range_m * math.sin(echo.elevation_rad)
            east, north = math.sin(echo.bearing_rad), math.cos(echo.bearing_rad)
            place = Enu(at.east + flat * east, at.north + flat * north, at.up + up)
            if any(place.minus(neighbor).norm() <= _NEIGHBOR_M for neighbor in neighbors):
                continue
            level = math.cos(echo.elevation_rad)
            towards = level * (velocity.east * east + velocity.north * north)
            towards += velocity.up * math.sin(echo.elevation_rad)
            if abs(towards - echo.closing_m_s) > _MOVES_M_S:
                away = (towards - echo.closing_m_s) * level
                self._movers.append(Mover(place, Enu(away * east, away * north, 0.0), now_ns))
            elif not self._explained(place):
                self._keep(place, now_ns)

    def _explained(self, place: Enu) -> bool:
        """True if the echo comes from something on the map, or from the ground."""
        if place.up <= self.ground_m(place) + _EXPLAINED_M:
            return True
        near = self._index.near.get(cell_of(place.east, place.north, TILE_M), ())
        return any(
            place.up <= building.roof_m + _EXPLAINED_M and building.outside(place.east, place.north)[0] <= _EXPLAINED_M
            for building in near
        )

    def _keep(self, place: Enu, now_ns: int) -> None:
        column, row = cell = cell_of(place.east, place.north)
        again = any(
            (known := self._echoes.get((column + i, row + j))) is not None and known.until_ns > now_ns
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        )
        fresh = _Echoed(place.up, now_ns + (_AGAIN_NS if again else _ONCE_NS))
        _put(self._echoes, cell, fresh, now_ns)
        reach = math.ceil(_MARGIN_M / CELL_M)
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                if math.hypot(i, j) * CELL_M <= _MARGIN_M:
                    _put(self._taken, (column + i, row + j), fresh, now_ns)

    def close(self, east_m: float, north_m: float, radius_m: float) -> None:
        """One more no-fly area, from now on."""
        self._no_fly = (*self._no_fly, (east_m, north_m, radius_m))
        self._any = True

    # --- queries --------------------------------------------------------------------------------------------------

    @property
    def hides(self) -> bool:
        """True if there is something on the map that may stand between two UAVs."""
        return bool(self._map.buildings) or self.has_hills

    @property
    def has_hills(self) -> bool:
        """True if the map has the heights of the ground."""
        return bool(self._map.heights_m)

    def ground_m(self, place: Enu) -> float:
        """The height of the ground at a place, by the map."""
        return self._map.ground_m(place.east, place.north) if self._map.heights_m else 0.0

    def roof_m(self, place: Enu) -> float | None:
        """The height of the highest roof below a place, or within `_MARGIN_M` of it; None if there is none."""
        return self._index.roofs_m.get(cell_of(place.east, place.north))

    def least_up_m(self, at: Enu, velocity: Enu) -> float:
        """The least height on this course: `OVER_M` above the roofs that the UAV is high enough to fly over."""
        if not self._index.roofs_m:
            return -math.inf
        ahead = [
            self._index.roofs_m.get(cell_of(at.east + s * velocity.east, at.north + s * velocity.north), -math.inf)
            for s in (0.0, 1.0, 2.0, 3.0)
        ]
        return max((roof for roof in ahead if roof + OVER_M <= at.up), default=-math.inf) + OVER_M

    def rises_m(self, at: Enu, velocity: Enu, after_s: Iterable[float]) -> list[float]:
        """By how much the ground is higher after each of these times of a flight; empty without a map of the ground."""
        if not self._map.heights_m:
            return []
        here = self.ground_m(at)
        return [self._map.ground_m(at.east + s * velocity.east, at.north + s * velocity.north) - here for s in after_s]

    def movers(self, now_ns: int) -> list[Mover]:
        """The flying bodies that the radar has recently seen, without neighbors whose hellos are received."""
        return [mover for mover in self._movers if now_ns - mover.at_ns <= _MOVER_NS]

    def planes(self, at: Enu, now_ns: int) -> list[HalfPlane]:
        """The limits of the velocity, one for each of the nearest obstacles, the nearest first."""
        found = [
            building.outside(at.east, at.north)
            for building in self._index.near.get(cell_of(at.east, at.north, TILE_M), ())
            if building.roof_m + OVER_M > at.up
        ]
        for east, north, radius in self._circles(at.up):
            off_east, off_north = at.east - east, at.north - north
            distance = max(1e-6, math.hypot(off_east, off_north))
            found.append((distance - radius, off_east / distance, off_north / distance))
        for cell, echoed in self._echoes.items():
            middle = middle_of(cell)
            off_east, off_north = at.east - middle[0], at.north - middle[1]
            if abs(off_east) > _WATCH_M or abs(off_north) > _WATCH_M:
                continue
            if echoed.until_ns > now_ns and echoed.top_m + OVER_M > at.up:
                distance = max(1e-6, math.hypot(off_east, off_north))
                found.append((distance - CELL_M / 2, off_east / distance, off_north / distance))
        near = sorted(wall for wall in found if wall[0] <= _WATCH_M)[:_MOST_PLANES]
        return [HalfPlane(east, north, (_CLEAR_M - distance) / _APPROACH_S) for distance, east, north in near]

    def way_to(self, at: Enu, goal: Enu, moves: Enu, *, now_ns: int) -> Enu | None:
        """The place to fly to on the way to a moving goal; None to fly straight to it, because that way is clear, or no
        other was found.
        """
        if not self._any and not self._taken and not self.hovering:
            return None

        circles = self._circles(at.up)

        def taken(cell: Cell) -> bool:
            return self._is_taken(cell, at.up, circles, now_ns)

        here, there = (at.east, at.north), _reachable(goal, moves, taken)
        if there is None:
            return None
        distance = math.hypot(there[0] - here[0], there[1] - here[1])
        if distance > _LOCAL_M:
            share = _LOCAL_M / distance
            there = here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])
        if is_clear(here, there, taken):
            self._planned_ns = self._corner = None
            moved = there != (goal.east, goal.north) and distance <= _LOCAL_M
            return Enu(there[0], there[1], goal.up) if moved else None
        if self._planned_ns is None or self._at_corner(here) or now_ns - self._planned_ns >= _REPLAN_NS:
            end = nearest_free(there, taken, within=_RINGS)
            way = [] if end is None else way_around(here, end, taken, most_cells=_MOST_CELLS)
            self._planned_ns, self._corner = now_ns, first_corner(here, way, taken)
        corner = self._corner
        return None if corner is None else Enu(corner[0], corner[1], goal.up)

    def _at_corner(self, here: Place) -> bool:
        corner = self._corner
        return corner is not None and math.hypot(corner[0] - here[0], corner[1] - here[1]) <= CELL_M

    def _circles(self, up_m: float) -> Sequence[_Circle]:
        """What must be flown around at a height: no-fly areas, and lost UAVs near it."""
        if not self.hovering:
            return self._no_fly
        at_height = ((at.east, at.north, radius) for at, radius in self.hovering if abs(at.up - up_m) <= OVER_M)
        return [*self._no_fly, *at_height]

    def _is_taken(self, cell: Cell, up_m: float, circles: Sequence[_Circle], now_ns: int) -> bool:
        roof_m = self._index.roofs_m.get(cell)
        if roof_m is not None and roof_m + OVER_M > up_m:
            return True
        if circles:
            east, north = middle_of(cell)
            if any(math.hypot(east - e, north - n) <= radius + _MARGIN_M for e, n, radius in circles):
                return True
        echoed = self._taken.get(cell)
        return echoed is not None and echoed.until_ns > now_ns and echoed.top_m + OVER_M > up_m


def _put(cells: dict[Cell, _Echoed], cell: Cell, fresh: _Echoed, now_ns: int) -> None:
    """Note an echo in a cell; of it and one that still counts there the greater height and the later end hold."""
    before = cells.get(cell)
    if before is not None and before.until_ns > now_ns:
        fresh = _Echoed(max(before.top_m, fresh.top_m), max(before.until_ns, fresh.until_ns))
    cells[cell] = fresh


def _reachable(goal: Enu, moves: Enu, taken: Callable[[Cell], bool]) -> Place | None:
    """The goal; or the place where a moving goal leaves an obstacle; or a free place beside it."""
    for seconds in range(_AHEAD_S + 1):
        place = goal.east + seconds * moves.east, goal.north + seconds * moves.north
        if not taken(cell_of(*place)):
            return place
        if not (moves.east or moves.north):
            break
    cell = nearest_free((goal.east, goal.north), taken, within=_RINGS)
    return None if cell is None else middle_of(cell)
