"""Counts how often UAVs enter no-fly areas. The world does not keep them out; that is the task of
the UAVs themselves.
"""

from collections.abc import Sequence

import numpy as np

from fanet_mw.errors import ConfigError
from sim.world.engines.contract import Rows


class NoFlyEntries:
    """Counts entries into areas that are upright cylinders without a top."""

    def __init__(self, areas: Sequence[tuple[float, float, float]], starts: Rows) -> None:
        """`areas`: (east, north, radius) [m]; raises ConfigError if a UAV would start in one."""
        self._areas = np.array(areas, dtype=np.float64).reshape(-1, 3)
        self._within = np.zeros((len(starts), len(self._areas)), bool)
        self.entries = 0
        """The number of times that a UAV came into an area."""
        rows, columns = np.nonzero(self._inside(starts))
        if len(rows):
            raise ConfigError(f"world.no_fly_m.{columns[0]}: node {rows[0] + 1} starts within it")

    def watch(self, at: Rows) -> None:
        """Count the UAVs that have entered an area since the previous call; `at` has the positions of all."""
        if not len(self._areas):
            return
        within = self._inside(at)
        self.entries += int((within & ~self._within).sum())
        self._within = within

    def _inside(self, at: Rows) -> np.ndarray:
        apart = np.linalg.norm(at[:, None, :2] - self._areas[None, :, :2], axis=2)
        return np.asarray(apart <= self._areas[:, 2])
