"""Counts how often UAVs enter no-fly areas. The world does not keep them out; that is the task of
the UAVs themselves.
"""

from collections.abc import Sequence

import numpy as np

from fanet_mw.errors import ConfigError
from sim.world.arrays import Flags, Rows


class NoFlyEntries:
    """Counts entries into areas that are upright cylinders without a top."""

    def __init__(self, areas: Sequence[tuple[float, float, float]], starts: Rows) -> None:
        """`areas`: (east, north, radius) [m]; raises ConfigError if a UAV would start in one."""
        self._areas = np.array(areas, dtype=np.float64).reshape(-1, 3)
        self._within = np.zeros((len(starts), len(self._areas)), bool)
        self.entries = 0
        """The number of times that a UAV came into an area."""
        rows, columns = np.nonzero(self._reached(starts, starts))
        if len(rows):
            raise ConfigError(f"world.no_fly_m.{columns[0]}: node {rows[0] + 1} starts within it")

    def watch(self, before: Rows, after: Rows) -> None:
        """Count the UAVs that enter an area on their straight ways from `before` to `after`, also those that leave it
        at once.
        """
        if not len(self._areas):
            return
        self.entries += int((self._reached(before, after) & ~self._within).sum())
        self._within = self._reached(after, after)

    def _reached(self, before: Rows, after: Rows) -> Flags:
        """Whether the nearest place to the middle of each area on each way is within the area [nodes, areas]."""
        way = (after - before)[:, None, :2]
        off = before[:, None, :2] - self._areas[None, :, :2]
        share = np.clip(-(off * way).sum(axis=2) / np.maximum((way**2).sum(axis=2), 1e-12), 0.0, 1.0)
        return np.asarray(np.linalg.norm(off + way * share[..., None], axis=2) <= self._areas[:, 2])
