"""Rays against hills and buildings, in numpy: for sensors, and for engines that know no obstacles themselves.

Buildings are upright boxes, which may be rotated about the vertical. Hills are a grid of heights with bilinear
interpolation. The flat ground at height 0 is not among them and stops no ray.
"""

import math
from typing import Final

import numpy as np

from sim.world.engines.contract import Flags, Rows, Values
from sim.world.environment.obstacles import Obstacles

_STEPS_PER_CELL: Final = 2
"""The number of samples of a ray over hills, for each cell of their grid that it crosses."""
_MOST_STEPS: Final = 2000


class Solids:
    """The hills and buildings of a world, as obstacles to bodies and rays."""

    def __init__(self, obstacles: Obstacles | None) -> None:
        boxes = obstacles.boxes if obstacles else ()
        self._middle = np.array([[b.east, b.north, b.roof / 2] for b in boxes], dtype=np.float64).reshape(-1, 3)
        self._half = np.array([[b.width / 2, b.depth / 2, b.roof / 2] for b in boxes], dtype=np.float64).reshape(-1, 3)
        yaw = np.array([b.yaw for b in boxes], dtype=np.float64)
        self._cos, self._sin = np.cos(yaw), np.sin(yaw)
        self._radius = np.hypot(self._half[:, 0], self._half[:, 1])
        self._hills = obstacles.hills if obstacles else None
        self.top_m = obstacles.top_m if obstacles else 0.0

    @property
    def any(self) -> bool:
        """True if there is anything solid."""
        return bool(len(self._middle)) or self._hills is not None

    def ground_m(self, places: Rows) -> Values:
        """Height of the ground at each place [n, 2 or 3]: hills, or the plain."""
        if self._hills is None:
            return np.zeros(len(places))
        heights, cell_m = self._hills
        side = heights.shape[0]
        column = np.clip(places[:, 0] / cell_m + (side - 1) / 2, 0, side - 1 - 1e-9)
        row = np.clip(places[:, 1] / cell_m + (side - 1) / 2, 0, side - 1 - 1e-9)
        i, j = row.astype(np.int64), column.astype(np.int64)
        v, u = row - i, column - j
        low = heights[i, j] * (1 - u) + heights[i, j + 1] * u
        high = heights[i + 1, j] * (1 - u) + heights[i + 1, j + 1] * u
        return np.asarray(low * (1 - v) + high * v)

    def surface_m(self, at: Rows) -> Values:
        """The height of the surface straight below each place [n, 3]: a roof or the ground. For a place inside a
        building it is the roof.
        """
        surface = self.ground_m(at)
        if len(self._middle):
            inside = (np.abs(self._local(at)[..., :2]) <= self._half[None, :, :2]).all(axis=2)
            roofs = np.where(inside, 2 * self._half[None, :, 2], 0.0)
            surface = np.maximum(surface, roofs.max(axis=1))
        return surface

    def gap_m(self, at: Rows) -> Values:
        """The distance from each place [n, 3] to the nearest wall, roof, hillside or flat ground; negative below the
        ground.
        """
        gap: Values = at[:, 2] - self.ground_m(at)
        if len(self._middle):
            out = np.maximum(np.abs(self._local(at)) - self._half[None], 0.0)
            gap = np.minimum(gap, np.sqrt((out**2).sum(axis=2)).min(axis=1))
        return gap

    def blocked(self, first: Rows, second: Rows) -> Flags:
        """True where something stands between `first` and `second` [n, 3]."""
        way = second - first
        length = np.linalg.norm(way, axis=1)
        direction = way / np.maximum(length, 1e-9)[:, None]
        return np.asarray(self.first_hit_m(first, direction, length) < length)

    def first_hit_m(self, origin: Rows, direction: Rows, range_m: Values | float) -> Values:
        """The distance at which each ray [n, 3] of unit direction hits something; infinite if nothing is within its
        range.
        """
        reach = np.broadcast_to(np.asarray(range_m, dtype=np.float64), (len(origin),))
        hit = np.full(len(origin), math.inf)
        if len(origin) == 0:
            return hit
        if len(self._middle):
            hit = np.minimum(hit, self._boxes_hit_m(origin, direction, reach))
        if self._hills is not None:
            hit = np.minimum(hit, self._hills_hit_m(origin, direction, reach))
        return np.where(hit <= reach, hit, math.inf)

    def _local(self, at: Rows) -> Values:
        """Each place in the axes of each box [n, boxes, 3]."""
        off = at[:, None] - self._middle[None]
        return self._turned(off)

    def _turned(self, vectors: Values) -> Values:
        east, north = vectors[..., 0], vectors[..., 1]
        along = self._cos * east + self._sin * north
        across = -self._sin * east + self._cos * north
        return np.stack([along, across, vectors[..., 2]], axis=-1)

    def _boxes_hit_m(self, origin: Rows, direction: Rows, reach: Values) -> Values:
        """The slab method: a ray is inside a box where it is between the planes of all three pairs (Kay and Kajiya,
        1986).
        """
        middle = origin[:, :2] + direction[:, :2] * (reach / 2)[:, None]
        span = reach / 2 * np.linalg.norm(direction[:, :2], axis=1)
        apart = np.linalg.norm(middle[:, None] - self._middle[None, :, :2], axis=2)
        ray, box = np.nonzero(apart <= span[:, None] + self._radius[None])
        hit = np.full(len(origin), math.inf)
        if not len(ray):
            return hit
        cos, sin = self._cos[box], self._sin[box]

        def local(vector: Values) -> Values:
            return np.stack(
                [cos * vector[:, 0] + sin * vector[:, 1], cos * vector[:, 1] - sin * vector[:, 0], vector[:, 2]], axis=1
            )

        start, step = local(origin[ray] - self._middle[box]), local(direction[ray])
        step = np.where(np.abs(step) < 1e-12, 1e-12, step)
        near, far = (-self._half[box] - start) / step, (self._half[box] - start) / step
        enter = np.minimum(near, far).max(axis=1)
        leave = np.maximum(near, far).min(axis=1)
        enter = np.where((enter <= leave) & (leave >= 0), np.maximum(enter, 0.0), math.inf)
        np.minimum.at(hit, ray, enter)
        return hit

    def _hills_hit_m(self, origin: Rows, direction: Rows, reach: Values) -> Values:
        """Sample each ray; where a sample is below ground, the hit is interpolated between it and the sample before."""
        assert self._hills is not None, "only hills are sampled"
        hit = np.full(len(origin), math.inf)
        lowest = np.minimum(origin[:, 2], origin[:, 2] + direction[:, 2] * reach)
        rows = np.flatnonzero(lowest <= float(self._hills.heights.max()))
        if not len(rows):
            return hit
        longest = float(reach[rows].max())
        steps = min(_MOST_STEPS, max(2, math.ceil(_STEPS_PER_CELL * longest / self._hills.cell_m) + 1))
        along = np.linspace(0.0, 1.0, steps)[None] * reach[rows][:, None]
        points = origin[rows][:, None] + direction[rows][:, None] * along[..., None]
        above = points[..., 2] - self.ground_m(points.reshape(-1, 3)).reshape(points.shape[:2])
        below = above <= 0
        first = below.argmax(axis=1)
        met = below[np.arange(len(rows)), first]
        before = np.maximum(first - 1, 0)
        every = np.arange(len(rows))
        high, low = above[every, before], above[every, first]
        share = np.where(first > 0, high / np.maximum(high - low, 1e-12), 0.0)
        distance = along[every, before] + share * (along[every, first] - along[every, before])
        hit[rows] = np.where(met, distance, math.inf)
        return hit
