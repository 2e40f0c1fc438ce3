"""The mobility model of random waypoints (Johnson and Maltz, 1996), without pauses."""

import numpy as np

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from sim.world.arrays import Rows
from sim.world.mobility.contract import Track


class RandomWaypoint:
    """Each UAV flies at constant speed from one uniformly drawn waypoint to the next; the leader stays where it is."""

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._speed = scenario.mobility.speed_m_s
        self._half = scenario.world.area_m / 2
        self._random = [stream(scenario.seed, "waypoint", node) for node in scenario.uav_ids]
        self._from = starts.copy()
        self._to = starts.copy()
        self._left_at = np.zeros(len(starts))
        self._length = np.zeros(len(starts))
        for i in range(1, len(starts)):
            self._turn(i, 0.0)

    def _turn(self, i: int, t_s: float) -> None:
        random = self._random[i]
        self._from[i] = self._to[i]
        self._to[i, :2] = random.uniform(-self._half, self._half), random.uniform(-self._half, self._half)
        self._left_at[i] = t_s
        self._length[i] = np.linalg.norm(self._to[i] - self._from[i])

    def track(self, t_s: float) -> Track:
        if self._speed == 0:
            return Track(self._from, np.zeros_like(self._from))
        for i in range(1, len(self._from)):
            arrival_s = self._left_at[i] + self._length[i] / self._speed
            while t_s > arrival_s:
                self._turn(i, arrival_s)
                arrival_s += self._length[i] / self._speed
        share = self._speed * (t_s - self._left_at) / np.maximum(self._length, 1e-9)
        share[0] = 0.0
        way = self._to - self._from
        velocities = way * (self._speed / np.maximum(self._length, 1e-9))[:, None]
        velocities[0] = 0.0
        return Track(self._from + way * share[:, None], velocities)
