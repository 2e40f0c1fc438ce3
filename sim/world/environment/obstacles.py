"""The hills and buildings of a world, from the scenario and its seed. ENU metres; no physics here.

Random hills are a sum of a few cosine waves, scaled to [0, `terrain_m`]. Buildings are upright boxes, which extend from
0 to their height above the ground at their middle. Random buildings are aligned with the axes, and keep clear of all
starts. Hills and buildings may come from files instead (`heightmap.py`, `footprints.py`). Not modeled: streets,
bridges, trees, and anything with a hole.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from fanet_mw.errors import ConfigError
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario, World
from fanet_mw.units import Enu
from sim.world.arrays import Rows, Values
from sim.world.environment import footprints, heightmap

_NEAR_DEG: Final = 1.0
"""Buildings this near to the exchanged origin are told to have longitude and latitude exchanged."""
_CLEAR_M: Final = 5.0
"""The least distance between a random building and a UAV at its start."""
_TRIES: Final = 200
"""The number of random places that are tried for a building."""
_CELLS: Final = 96
"""The greatest number of grid cells of the hills per side."""
_FILE_CELLS: Final = 255
"""The same for hills from a file; pybullet accepts no more."""
_WAVES: Final = 8
_EXACT_M: Final = 1e-3
"""The ground may be this much lower than the file."""
_ROUNDS: Final = 12
"""The number of times that a grid is raised; one that is still too low takes at each of its points the highest of the
file around it.
"""
_BEYOND_M: Final = 1000.0
"""The mesh of the ground extends this far beyond the area."""
Indices = npt.NDArray[np.int64]


class Box(NamedTuple):
    """One building: its middle, its extents, and its roof above 0."""

    east: float
    north: float
    width: float
    depth: float
    roof: float
    yaw: float = 0.0
    """The angle by which it is rotated, from east towards north [rad]."""

    def near(self, places: Rows, *, margin_m: float) -> bool:
        """True if any of these places is inside the box, or closer to it than the margin."""
        east, north = places[:, 0] - self.east, places[:, 1] - self.north
        along = math.cos(self.yaw) * east + math.sin(self.yaw) * north
        across = math.cos(self.yaw) * north - math.sin(self.yaw) * east
        return bool(
            (
                (np.abs(along) < self.width / 2 + margin_m)
                & (np.abs(across) < self.depth / 2 + margin_m)
                & (places[:, 2] < self.roof + margin_m)
            ).any()
        )


def covered_by(boxes: Sequence[Box]) -> Callable[[Enu], bool]:
    """Says of a place whether it is inside any of these boxes, as `Box.near` does, of all of them at once."""
    east, north, width, depth, roof, yaw = np.array(boxes, dtype=np.float64).reshape(-1, len(Box._fields)).T
    cos, sin = (np.array([turn(angle) for angle in yaw], dtype=np.float64) for turn in (math.cos, math.sin))

    def inside(at: Enu) -> bool:
        off_east, off_north = at.east - east, at.north - north
        along, across = cos * off_east + sin * off_north, cos * off_north - sin * off_east
        return bool(((np.abs(along) < width / 2) & (np.abs(across) < depth / 2) & (at.up < roof)).any())

    return inside


class Hills(NamedTuple):
    """The ground as triangles over a square grid of heights above 0, centered at the origin, row by row to the north.
    Each cell is divided from southwest to northeast; beyond the grid its edge continues.
    """

    heights: Rows
    cell_m: float

    def at(self, places: Rows) -> Values:
        """The height of the ground at each place [n, 2 or 3]."""
        last = self.heights.shape[0] - 1
        column = np.clip(places[:, 0] / self.cell_m + last / 2, 0, last)
        row = np.clip(places[:, 1] / self.cell_m + last / 2, 0, last)
        i, j = np.minimum(row.astype(np.int64), last - 1), np.minimum(column.astype(np.int64), last - 1)
        v, u = row - i, column - j
        beside = np.where(u > v, self.heights[i, j + 1], self.heights[i + 1, j])
        low, high = np.minimum(u, v), np.maximum(u, v)
        return np.asarray(self.heights[i, j] * (1 - high) + self.heights[i + 1, j + 1] * low + beside * (high - low))

    def normals(self, places: Rows) -> Rows:
        """The upward unit normal of the triangle at each place [n, 2 or 3]."""
        last = self.heights.shape[0] - 1
        column, row = places[:, 0] / self.cell_m + last / 2, places[:, 1] / self.cell_m + last / 2
        i, j = (np.clip(part.astype(np.int64), 0, last - 1) for part in (row, column))
        below = row - i <= column - j
        h, southwest, northeast = self.heights, self.heights[i, j], self.heights[i + 1, j + 1]
        east = np.where(below, h[i, j + 1] - southwest, northeast - h[i + 1, j])
        north = np.where(below, northeast - h[i, j + 1], h[i + 1, j] - southwest)
        upright = np.stack([-east / self.cell_m, -north / self.cell_m, np.ones(len(places))], axis=1)
        return np.asarray(upright / np.linalg.norm(upright, axis=1)[:, None])

    @property
    def steepest(self) -> float:
        """The greatest slope of any triangle is at most this."""
        steps = (np.abs(np.diff(self.heights, axis=axis)).max() / self.cell_m for axis in (0, 1))
        return math.hypot(*steps)

    def height_m(self, east: float, north: float) -> float:
        return float(self.at(np.array([[east, north]]))[0])

    def mesh(self) -> tuple[Rows, Indices]:
        """Corners [n, 3], and three of them for each triangle, up to `_BEYOND_M` beyond the grid."""
        side = self.heights.shape[0] + 2
        axis = (np.arange(side) - (side - 1) / 2) * self.cell_m
        axis[[0, -1]] += [self.cell_m - _BEYOND_M, _BEYOND_M - self.cell_m]
        east, north = np.meshgrid(axis, axis)
        corners = np.stack([east.ravel(), north.ravel(), np.pad(self.heights, 1, mode="edge").ravel()], axis=1)
        first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)[None]).ravel()
        triangles = np.stack([first, first + 1, first + side + 1, first, first + side + 1, first + side], axis=1)
        return corners, triangles.reshape(-1, 3)


class Obstacles(NamedTuple):
    """All obstacles; the flat ground is none."""

    hills: Hills | None
    boxes: tuple[Box, ...]

    @property
    def top_m(self) -> float:
        hill = float(self.hills.heights.max()) if self.hills else 0.0
        return max([hill, *(box.roof for box in self.boxes)])


def terrain(scenario: Scenario) -> Hills | None:
    """The hills of a scenario, from its file or its seed; None if the ground is flat."""
    world = scenario.world
    if world.heightmap:
        return _hills_of_file(scenario)
    return _hills(world, stream(scenario.seed, "terrain")) if world.terrain_m else None


def obstacles(scenario: Scenario, starts: Rows) -> Obstacles:
    """The obstacles of a scenario whose UAVs start at `starts` [nodes, 3]; raises ConfigError if one is in the way."""
    world = scenario.world
    hills = terrain(scenario)
    if hills is not None:
        key = f"world.heightmap = {world.heightmap}" if world.heightmap else f"world.terrain_m = {world.terrain_m:g}"
        for node, (up, ground_m) in enumerate(zip(starts[:, 2].tolist(), hills.at(starts).tolist(), strict=True), 1):
            if up < ground_m:
                raise ConfigError(
                    f"node {node} starts at {up:g} m, below the ground there, which is {ground_m:.2f} m high; "
                    f"{key} must leave room for nodes.altitude_m"
                )
    if world.buildings_geojson:
        return Obstacles(hills, tuple(_of_file(world, hills, starts)))
    if isinstance(world.buildings, int):
        random = stream(scenario.seed, "buildings")
        return Obstacles(hills, tuple(_seeded(world, random, hills, starts) for _ in range(world.buildings)))
    boxes = []
    for east, north, width, depth, height in world.buildings:
        box = Box(east, north, width, depth, height + (hills.height_m(east, north) if hills else 0.0))
        if box.near(starts, margin_m=0.0):
            raise ConfigError(
                f"world.buildings: node {_first_in(box, starts)} starts within the building at [{east:g}, {north:g}]"
            )
        boxes.append(box)
    return Obstacles(hills, tuple(boxes))


def _first_in(box: Box, starts: Rows) -> int:
    """The first node that starts within a building."""
    return next(row + 1 for row in range(len(starts)) if box.near(starts[row : row + 1], margin_m=0.0))


def town_of(world: World) -> footprints.Town:
    return footprints.read(
        Path(world.buildings_geojson),
        origin_deg=world.origin_deg,
        height_m=sum(world.building_height_m) / 2,
        area_m=world.area_m,
        digest=world.buildings_sha256,
    )


def heightmap_of(world: World) -> heightmap.Heightmap:
    return heightmap.read(
        Path(world.heightmap),
        origin_deg=world.origin_deg,
        area_m=world.area_m,
        digest=world.heightmap_sha256,
    )


def _of_file(world: World, hills: Hills | None, starts: Rows) -> Iterator[Box]:
    """The buildings of the scenario's GeoJSON file whose middle lies in the area."""
    town = town_of(world)
    if not town.boxes:
        lat, lon = town.middle_deg
        exchanged = math.hypot(lat - world.origin_deg[1], lon - world.origin_deg[0]) < _NEAR_DEG
        raise ConfigError(
            f"world.buildings_geojson: none of the {town.buildings} buildings of {world.buildings_geojson} lies within "
            f"world.area_m = {world.area_m:g} about world.origin_deg = [{world.origin_deg[0]:g}, "
            f"{world.origin_deg[1]:g}]; the middle of the file is [{lat:.5f}, {lon:.5f}]: "
            f"{'are longitude and latitude exchanged in it?' if exchanged else 'is world.origin_deg right?'}"
        )
    for east, north, width, depth, yaw, height in town.boxes:
        box = Box(east, north, width, depth, height + (hills.height_m(east, north) if hills else 0.0), yaw)
        if box.near(starts, margin_m=0.0):
            raise ConfigError(
                f"world.buildings_geojson: node {_first_in(box, starts)} starts within the building at "
                f"[{east:.0f}, {north:.0f}]"
            )
        yield box


def _hills_of_file(scenario: Scenario) -> Hills:
    """The heights of the file on a square grid, nowhere lower than it: ridges and towers keep their highest point."""
    world = scenario.world
    found = heightmap_of(world)
    cells = max(8, min(_FILE_CELLS, math.ceil(world.area_m / found.cell_m - 1e-6)))
    axis = np.linspace(-world.area_m / 2, world.area_m / 2, cells + 1)
    heights = found.sample(*np.meshgrid(axis, axis))
    east, north = found.places()
    inside = (np.maximum(np.abs(east), np.abs(north)) <= world.area_m / 2) & np.isfinite(found.metres)
    return Hills(
        _not_below(heights, world.area_m / cells, east[inside], north[inside], found.metres[inside]),
        world.area_m / cells,
    )


def _not_below(heights: Rows, cell_m: float, east: Values, north: Values, least: Values) -> Rows:
    """A grid of heights, raised so that it is nowhere lower than the heights `least` at places of the file, but at no
    point above the highest of the places in the cells around it.
    """
    side = len(heights)
    x, y = (np.clip(part / cell_m + (side - 1) / 2, 0, side - 1 - 1e-9) for part in (east, north))
    i, j = y.astype(np.int64), x.astype(np.int64)
    v, u = y - i, x - j
    corners = [  # with their weights in the triangle of the place
        (i, j, 1 - np.maximum(u, v)), (i + 1, j + 1, np.minimum(u, v)),
        (i, j + 1, np.maximum(u - v, 0.0)), (i + 1, j, np.maximum(v - u, 0.0)),
    ]  # fmt: skip
    highest = heights.copy()
    for row, column, _ in corners:
        np.maximum.at(highest, (row, column), least)
    raised = heights.copy()
    for _ in range(_ROUNDS):
        lacking = least - sum(raised[row, column] * weight for row, column, weight in corners)
        if lacking.max(initial=0.0) < _EXACT_M:
            return raised
        more = np.zeros_like(raised)
        for row, column, weight in corners:
            np.maximum.at(more, (row, column), np.where(weight > 0, lacking, 0.0))
        raised = np.minimum(raised + more, highest)
    return highest


def _seeded(world: World, random: Random, hills: Hills | None, starts: Rows) -> Box:
    half = world.area_m / 2
    for _ in range(_TRIES):
        east, north = random.uniform(-half, half), random.uniform(-half, half)
        width, depth = random.uniform(*world.building_size_m), random.uniform(*world.building_size_m)
        roof = random.uniform(*world.building_height_m) + (hills.height_m(east, north) if hills else 0.0)
        box = Box(east, north, width, depth, roof)
        if not box.near(starts, margin_m=_CLEAR_M):
            return box
    raise ConfigError(
        f"world.buildings = {world.buildings}: no place found for one, clear of every start by {_CLEAR_M:g} m"
    )


def _hills(world: World, random: Random) -> Hills:
    cells = max(8, min(_CELLS, math.ceil(4 * world.area_m / world.terrain_scale_m)))
    axis = np.linspace(-world.area_m / 2, world.area_m / 2, cells + 1)
    east, north = np.meshgrid(axis, axis)
    surface = np.zeros_like(east)
    for _ in range(_WAVES):
        heading, phase = random.uniform(0, 2 * math.pi), random.uniform(0, 2 * math.pi)
        per_m = 2 * math.pi / (world.terrain_scale_m * random.uniform(0.7, 1.4))
        surface += np.cos(per_m * (math.cos(heading) * east + math.sin(heading) * north) + phase)
    surface -= surface.min()
    return Hills(np.asarray(surface * (world.terrain_m / max(float(surface.max()), 1e-9))), world.area_m / cells)
