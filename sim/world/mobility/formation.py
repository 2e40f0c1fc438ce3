"""The mobility model `formation`: the world moves the whole layout as one, and it keeps its shape.

Formations that UAVs fly by themselves are in `agents/mission/`: `formation_flight/` and `search_formation/`.
"""

import numpy as np
import numpy.typing as npt

from fanet_mw.scenario import Scenario
from sim.world.arrays import Rows
from sim.world.mobility.contract import Track


class Formation:
    """The layout moves from the base to the middle of the area, then around it along the edges. All of the area is
    overflown if the layout is at least half as large.
    """

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._starts = starts
        self._speed = scenario.mobility.speed_m_s
        base = np.array(scenario.world.base_m)
        room = np.maximum(0.0, scenario.world.area_m / 2 - np.abs(starts[:, :2] - base).max(axis=0))
        east, north = float(room[0]), float(room[1])
        ring = [(east, 0.0), (east, north), (-east, north), (-east, -north), (east, -north), (east, 0.0)]
        to_middle = [(0.0, 0.0)] if base.any() else []
        self._way = np.array([tuple(base), *to_middle, *ring]) - base
        """The corners of the way, as offsets from the start."""
        self._legs = np.linalg.norm(np.diff(self._way, axis=0), axis=1)
        self._approach_m = float(self._legs[: len(to_middle) + 1].sum())
        self._ring_m = float(self._legs[len(to_middle) + 1 :].sum())

    def track(self, t_s: float) -> Track:
        offset, velocity = self._offset(self._speed * t_s)
        places = self._starts.copy()
        places[:, :2] += offset
        velocities = np.zeros_like(places)
        velocities[:, :2] = velocity
        return Track(places, velocities)

    def _offset(self, travelled_m: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        if travelled_m > self._approach_m and self._ring_m > 0:
            travelled_m = self._approach_m + (travelled_m - self._approach_m) % self._ring_m
        for leg, length in enumerate(self._legs):
            if travelled_m <= length and length > 0:
                direction = (self._way[leg + 1] - self._way[leg]) / length
                return self._way[leg] + travelled_m * direction, self._speed * direction
            travelled_m -= length
        return self._way[-1], np.zeros(2)
