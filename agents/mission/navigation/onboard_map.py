"""The map that a UAV carries: heights of the ground, and the buildings that are known before the flight. ENU metres.

Buildings are upright boxes, which may be turned about the vertical. The ground is made of triangles between the
points of a square grid about the origin, two for each cell. A UAV must notice by itself whatever is not on the map.
"""

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

Cell = tuple[int, int]
"""A cell of a grid: its column, counted to the east, and its row, counted to the north."""
CELL_M: Final = 5.0
TILE_M: Final = 50.0


class Building(NamedTuple):
    """A building: its middle, its extents, its roof above 0, and its angle from east towards north [rad]."""

    east_m: float
    north_m: float
    width_m: float
    depth_m: float
    roof_m: float
    yaw_rad: float = 0.0

    def outside(self, east_m: float, north_m: float) -> tuple[float, float, float]:
        """Distance from the nearest wall, negative inside, and the direction (east, north) away from it."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        off_east, off_north = east_m - self.east_m, north_m - self.north_m
        along, across = cos * off_east + sin * off_north, cos * off_north - sin * off_east
        beyond_along, beyond_across = abs(along) - self.width_m / 2, abs(across) - self.depth_m / 2
        out_along, out_across = max(0.0, beyond_along), max(0.0, beyond_across)
        distance = math.hypot(out_along, out_across)
        if distance == 0.0:
            distance = max(beyond_along, beyond_across)
            out_along, out_across = (1.0, 0.0) if beyond_along > beyond_across else (0.0, 1.0)
        length = math.hypot(out_along, out_across)
        to_along = math.copysign(out_along / length, along)
        to_across = math.copysign(out_across / length, across)
        return distance, cos * to_along - sin * to_across, sin * to_along + cos * to_across


class OnboardMap(NamedTuple):
    """The ground and the buildings that a UAV knows before its flight."""

    buildings: tuple[Building, ...] = ()
    heights_m: tuple[tuple[float, ...], ...] = ()
    """The heights of the ground, row by row to the north; empty if the ground is flat, at 0."""
    cell_m: float = 1.0
    """The distance between two points of the grid of heights."""

    def ground_m(self, east_m: float, north_m: float) -> float:
        """The height of the ground at a place; outside of the grid, the height at its nearest edge."""
        rows = self.heights_m
        if not rows:
            return 0.0
        last = len(rows) - 1
        column = min(last - 1e-9, max(0.0, east_m / self.cell_m + last / 2))
        row = min(last - 1e-9, max(0.0, north_m / self.cell_m + last / 2))
        i, j = int(row), int(column)
        v, u = row - i, column - j
        low, high = min(u, v), max(u, v)
        beside = rows[i][j + 1] if u > v else rows[i + 1][j]
        return rows[i][j] * (1 - high) + rows[i + 1][j + 1] * low + beside * (high - low)


NO_MAP: Final = OnboardMap()


def cell_of(east_m: float, north_m: float, size_m: float = CELL_M) -> Cell:
    return math.floor(east_m / size_m), math.floor(north_m / size_m)


def middle_of(cell: Cell) -> tuple[float, float]:
    """East and north of the middle of a cell."""
    return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M


class MapIndex(NamedTuple):
    """A map prepared for quick queries; all UAVs that carry the same map share it."""

    roofs_m: Mapping[Cell, float]
    """The highest roof within the margin of the middle of each cell of `CELL_M`."""
    near: Mapping[Cell, tuple[Building, ...]]
    """The buildings near each cell of `TILE_M`, which a UAV there must watch."""


@lru_cache(maxsize=4)
def indexed(onboard_map: OnboardMap, *, margin_m: float, watch_m: float) -> MapIndex:
    roofs: dict[Cell, float] = {}
    near: dict[Cell, list[Building]] = {}
    for building in onboard_map.buildings:
        for cell in _cells_within(building, margin_m, CELL_M):
            higher = building.roof_m > roofs.get(cell, -math.inf)
            if higher and building.outside(*middle_of(cell))[0] <= margin_m:  # which takes longer
                roofs[cell] = building.roof_m
        for tile in _cells_within(building, watch_m, TILE_M):
            near.setdefault(tile, []).append(building)
    return MapIndex(roofs, {tile: tuple(found) for tile, found in near.items()})


def _cells_within(building: Building, margin_m: float, size_m: float) -> Iterator[Cell]:
    """The cells of a square around a building."""
    reach_m = math.hypot(building.width_m, building.depth_m) / 2 + margin_m
    first = cell_of(building.east_m - reach_m, building.north_m - reach_m, size_m)
    last = cell_of(building.east_m + reach_m, building.north_m + reach_m, size_m)
    for column in range(first[0], last[0] + 1):
        for row in range(first[1], last[1] + 1):
            yield column, row
