"""The true distances between UAVs, by which collision warnings are judged.

Bodies are taken to fly straight between two steps of the engine, so the least distance within a step is known, too.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.world.arrays import Rows
from sim.world.engines.contacts import approaches


class Separation:
    """The least distance between any two UAVs, and how often two came nearer than they should."""

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
