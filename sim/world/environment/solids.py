"""Rays against hills and buildings, in numpy: for sensors, and for engines that know no obstacles themselves.

Buildings are upright boxes, which may be rotated about the vertical. Hills are triangles (`obstacles.py`): between the
places where a straight line crosses an edge of one, its height above them is linear, so a ray meets them exactly. The
flat ground at height 0 stops no ray.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from sim.world.arrays import Flags, Rows, Values
from sim.world.environment.obstacles import Obstacles

RAYS: Final = 1000
"""Rays that are cast over hills at once; more would take much memory."""
_SHORT_M: Final = 0.01
"""A body stops this far before a wall or the ground."""
_ROUND: Final = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0.7, -0.7, 0], [-0.7, 0.7, 0]])
"""Places around one, on whose hillsides that nearest to it may lie."""
_DOWN: Final = np.array(
    [
        [math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), -math.cos(tilt)]
        for tilt in (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
        for turn in (math.pi * share / 8 for share in range(16))
    ]
)
"""Directions downwards, for edges."""
_ROUNDS: Final = 40
"""Rounds of the search for the place at which a path is nearest to a box; each leaves two thirds of the path."""


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
        self._steepest = self._hills.steepest if self._hills else 0.0
        self.top_m = obstacles.top_m if obstacles else 0.0

    @property
    def hilly(self) -> bool:
        return self._hills is not None

    @property
    def any(self) -> bool:
        return bool(len(self._middle)) or self._hills is not None

    def ground_m(self, places: Rows) -> Values:
        """Height of the ground at each place [n, 2 or 3]: hills, or the plain."""
        if self._hills is None:
            return np.zeros(len(places))
        return self._hills.at(places)

    def surface_m(self, at: Rows) -> Values:
        """The height of the roof or ground straight below each place [n, 3]; inside a building the roof."""
        surface = self.ground_m(at)
        if len(self._middle):
            inside = (np.abs(self._local(at)[..., :2]) <= self._half[None, :, :2]).all(axis=2)
            roofs = np.where(inside, 2 * self._half[None, :, 2], 0.0)
            surface = np.maximum(surface, roofs.max(axis=1))
        return surface

    def gap_m(self, at: Rows) -> Values:
        """The distance of each place [n, 3] from the nearest solid; negative below the ground."""
        gap: Values = at[:, 2] - self.ground_m(at)
        return gap if not len(self._middle) else np.minimum(gap, self._boxes_gap_m(at).min(axis=1))

    def least_gap_m(self, before: Rows, after: Rows, *, within_m: float) -> Values:
        """The least gap on each straight path; that at its end where none leads nearer than `within_m`. Over a slope at
        most `within_m` where the path leads so near to it.
        """
        gap = self.gap_m(after)
        path = after - before
        length = np.linalg.norm(path, axis=1)
        near = np.flatnonzero(gap <= (length + within_m) * math.hypot(1.0, self._steepest))
        if not len(near):
            return gap
        start, way = before[near], path[near]
        least = np.minimum(gap[near], self.gap_m(start))
        if self._hills is not None:
            _, above = self.above_hills(start, way, np.ones(len(near)))
            least = np.minimum(least, above.min(axis=1))
            beside = np.flatnonzero(least > within_m)
            if len(beside):
                touch = self._hill_within(start[beside], way[beside], within_m)
                least[beside[touch]] = within_m
        if len(self._middle):
            least = np.minimum(least, self._boxes_least_m(start, way, within_m=within_m))
        gap[near] = least
        return gap

    def stop(self, before: Rows, after: Rows, velocity: Rows) -> Flags:
        """Put bodies of `after` where something stops them on their way from `before`, from where they may still rise
        or fall beside a wall, and change their velocities; returns which these are.
        """
        up = after[:, 2].copy()
        stopped = self._put_back(before, after)
        rows = np.flatnonzero(stopped)
        if len(rows):
            beside = after[rows]
            beside[:, 2] = up[rows]
            held = self._put_back(after[rows], beside)
            after[rows] = beside
            velocity[rows, :2] = 0.0
            velocity[rows[held], 2] = 0.0
        return stopped

    def _put_back(self, before: Rows, after: Rows) -> Flags:
        """Put those bodies of `after` where something solid stops them; returns which these are."""
        path = after - before
        length = np.linalg.norm(path, axis=1)
        if (after[:, 2] - self.top_m > length * math.hypot(1.0, self._steepest)).all():
            return np.zeros(len(after), bool)  # all are above everything
        gap = self.gap_m(after)
        stopped = gap <= 0
        near = np.flatnonzero(gap <= length * math.hypot(1.0, self._steepest))
        near = near[(length[near] > 0) & (self.gap_m(before[near]) > 0)]
        if len(near):
            direction = path[near] / length[near, None]
            hit = self.first_hit_m(before[near], direction, length[near])
            met = np.isfinite(hit)
            rows = near[met]
            after[rows] = before[rows] + direction[met] * np.maximum(hit[met] - _SHORT_M, 0.0)[:, None]
            stopped[near] = met | stopped[near]
            inside = np.setdiff1d(np.flatnonzero(stopped), rows)
        else:
            inside = np.flatnonzero(stopped)
        after[inside] = before[inside]
        if stopped.any():
            after[stopped, 2] = np.maximum(after[stopped, 2], self.ground_m(after[stopped]))
        return stopped

    def nearest_walls(self, at: Values) -> Rows:
        """The place on each building that is nearest to a place [3]."""
        local = np.clip(self._local(at[None])[0], -self._half, self._half)
        east = self._cos * local[:, 0] - self._sin * local[:, 1]
        north = self._sin * local[:, 0] + self._cos * local[:, 1]
        return np.stack([east, north, local[:, 2]], axis=1) + self._middle

    def corners_near(self, start: Rows, way: Rows, *, margin_m: float) -> tuple[npt.NDArray[np.int64], Values, Values]:
        """The buildings near straight paths from above: the row of the path, corners [4, 2], roof."""
        middle, span = start[:, :2] + way[:, :2] / 2, np.linalg.norm(way[:, :2], axis=1) / 2
        apart = np.linalg.norm(middle[:, None] - self._middle[None, :, :2], axis=2)
        ray, box = np.nonzero(apart <= span[:, None] + self._radius[None] + margin_m)
        along, across = self._middle[box, :2] - start[ray, :2], way[ray, :2] / np.maximum(2 * span[ray], 1e-9)[:, None]
        beside = np.abs(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) <= self._radius[box] + margin_m
        ray, box = ray[beside], box[beside]
        signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        local = self._half[box, None, :2] * signs
        cos, sin = self._cos[box, None], self._sin[box, None]
        east = cos * local[..., 0] - sin * local[..., 1]
        north = sin * local[..., 0] + cos * local[..., 1]
        return ray, np.stack([east, north], axis=2) + self._middle[box, None, :2], 2 * self._half[box, 2]

    def blocked(self, first: Rows, second: Rows) -> Flags:
        """True where something stands between `first` and `second` [n, 3]."""
        way = second - first
        length = np.linalg.norm(way, axis=1)
        direction = way / np.maximum(length, 1e-9)[:, None]
        return np.asarray(self.first_hit_m(first, direction, length) < length)

    def first_hit_m(self, origin: Rows, direction: Rows, range_m: Values | float) -> Values:
        """Where each ray [n, 3] of unit direction hits something; infinite if nothing is within its range."""
        reach = np.broadcast_to(np.asarray(range_m, dtype=np.float64), (len(origin),))
        hit = np.full(len(origin), math.inf)
        if len(origin) == 0:
            return hit
        if len(self._middle):
            hit = np.minimum(hit, self._boxes_hit_m(origin, direction, reach))
        if self._hills is not None:
            hit = np.minimum(hit, self._hills_hit_m(origin, direction, reach))
        return np.where(hit <= reach, hit, math.inf)

    def _boxes_gap_m(self, at: Rows) -> Values:
        """The distance of each place from each box [n, boxes]; 0 inside."""
        out = np.maximum(np.abs(self._local(at)) - self._half[None], 0.0)
        return np.asarray(np.sqrt((out**2).sum(axis=2)))

    def _boxes_least_m(self, start: Rows, way: Rows, *, within_m: float) -> Values:
        """The least distance from the boxes on straight paths, along which it is convex; infinite beyond `within_m`."""
        rows = np.arange(len(start))
        reach = np.linalg.norm(way, axis=1)
        first, second = np.nonzero(self._boxes_gap_m(start) <= reach[:, None] + within_m)
        least = np.full(len(rows), math.inf)
        if not len(first):
            return least
        low, high = np.zeros(len(first)), np.ones(len(first))

        def gap(share: Values) -> Values:
            off = start[first] + way[first] * share[:, None] - self._middle[second]
            cos, sin = self._cos[second], self._sin[second]
            local = np.stack([cos * off[:, 0] + sin * off[:, 1], cos * off[:, 1] - sin * off[:, 0], off[:, 2]], axis=1)
            return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - self._half[second], 0.0), axis=1))

        for _ in range(_ROUNDS):
            third = (high - low) / 3
            farther = gap(low + third) > gap(high - third)
            low, high = np.where(farther, low + third, low), np.where(farther, high, high - third)
        np.minimum.at(least, first, gap((low + high) / 2))
        return least

    def _hill_within(self, start: Rows, way: Rows, radius_m: float) -> Flags:
        """Which paths lead so near to a hillside: some point at this distance along a normal, or towards an edge, is
        below the ground.
        """
        assert self._hills is not None, "asked only where there are hills"
        normals = [self._hills.normals(place + off) for place in (start, start + way) for off in _ROUND * radius_m]
        towards = np.concatenate(
            [-np.stack(normals, axis=1), np.broadcast_to(_DOWN, (len(start), *_DOWN.shape))], axis=1
        )
        low = (start[:, None] + radius_m * towards).reshape(-1, 3)
        along = np.repeat(way, towards.shape[1], axis=0)
        _, above = self.above_hills(low, along, np.ones(len(low)))
        return np.asarray((above.min(axis=1) <= 0).reshape(len(start), -1).any(axis=1))

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
        """The slab method: inside a box a ray is between all three pairs of planes (Kay and Kajiya, 1986)."""
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
        """The first place at which each ray is not above the ground."""
        assert self._hills is not None, "asked only where there are hills"
        hit = np.full(len(origin), math.inf)
        lowest = np.minimum(origin[:, 2], origin[:, 2] + direction[:, 2] * reach)
        every = np.flatnonzero(lowest <= float(self._hills.heights.max()))
        for begin in range(0, len(every), RAYS):
            rows = every[begin : begin + RAYS]
            along, above = self.above_hills(origin[rows], direction[rows], reach[rows])
            below = above <= 0
            first = below.argmax(axis=1)
            each = np.arange(len(rows))
            before = np.maximum(first - 1, 0)
            high, low = above[each, before], above[each, first]
            share = np.where(first > 0, high / np.maximum(high - low, 1e-12), 0.0)
            distance = along[each, before] + share * (along[each, first] - along[each, before])
            hit[rows] = np.where(below[each, first], distance, math.inf)
        return hit

    def above_hills(self, origin: Rows, direction: Rows, reach: Values) -> tuple[Values, Values]:
        """Where each ray begins, crosses edges of triangles (east, north, or their difference a whole number of cells)
        and ends; and its height above them.
        """
        assert self._hills is not None, "asked only where there are hills"
        cell_m, last = self._hills.cell_m, self._hills.heights.shape[0] - 1
        start, step = origin[:, :2] / cell_m + last / 2, direction[:, :2] / cell_m
        along = [np.zeros((len(origin), 1)), reach[:, None]]
        for at, speed, least in (
            (start[:, 0], step[:, 0], 0),
            (start[:, 1], step[:, 1], 0),
            (start[:, 0] - start[:, 1], step[:, 0] - step[:, 1], -last),
        ):
            end = at + speed * reach
            low = np.clip(np.ceil(np.minimum(at, end)), least, last + 1)
            count = int((np.clip(np.floor(np.maximum(at, end)), least - 1, last) - low).max(initial=-1)) + 1
            lines = low[:, None] + np.arange(count)
            fast = np.where(np.abs(speed) < 1e-12, 1e-12, speed)
            along.append(np.clip((lines - at[:, None]) / fast[:, None], 0.0, reach[:, None]))
        every = np.sort(np.hstack(along), axis=1)
        points = origin[:, None] + direction[:, None] * every[..., None]
        return every, points[..., 2] - self.ground_m(points.reshape(-1, 3)).reshape(every.shape)
