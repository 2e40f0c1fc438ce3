"""Counts the incidents of a run: contacts, losses of separation, and entries into no-fly areas."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from sim.world.arrays import Flags, Rows
from sim.world.engines.contacts import approaches


class Separation:
    """The least distance of two UAVs, and how often two came too near; ways within a step are straight."""

    def __init__(self, distance_m: float) -> None:
        """`distance_m`: the distance that any two UAVs should keep; with 0 nothing is watched."""
        self._distance_m = distance_m
        self._least_m: float | None = None
        self._near: frozenset[tuple[int, int]] = frozenset()
        self._losses = 0

    def watch(self, before: Rows, after: Rows) -> None:
        """Watch one step between two positions [nodes, 3] in m. A pair that stays near counts once."""
        if not self._distance_m or len(before) < 2:
            return
        within_m = math.inf if self._least_m is None else max(self._distance_m, self._least_m)
        first, second, distance = approaches(before, after, within_m=within_m)
        if len(distance):
            least = float(distance.min())
            self._least_m = least if self._least_m is None else min(self._least_m, least)
        rows = np.flatnonzero(distance < self._distance_m).tolist()
        near = frozenset((int(first[row]), int(second[row])) for row in rows)
        self._losses += len(near - self._near)
        self._near = near

    def report(self) -> Mapping[str, Any]:
        """The report; `least_m` is None while nothing has moved. It is empty if nothing is watched."""
        if not self._distance_m:
            return {}
        return {"least_m": None if self._least_m is None else round(self._least_m, 2), "losses": self._losses}


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
        """Count the UAVs that enter an area on their straight ways, also those that leave it at once."""
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


class Incidents:
    """The incidents of one run."""

    def __init__(self, scenario: Scenario, starts: Rows) -> None:
        """Raises ConfigError if a UAV would start in a no-fly area."""
        self.collisions = 0
        self.no_fly = NoFlyEntries(scenario.world.no_fly_m, starts)
        self.separation = Separation(scenario.mission.collision_distance_m)
