"""A mobility model for tests of collision avoidance: the ways of all UAVs cross in the middle of the area."""

import numpy as np

from fanet_mw.scenario import Scenario
from sim.world.arrays import Rows
from sim.world.mobility.contract import Track


class Crossing:
    """All UAVs fly straight through the middle to the point opposite their start, and back, again and again."""

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._starts = starts
        self._speed = scenario.mobility.speed_m_s
        self._length = 2 * np.linalg.norm(starts[:, :2], axis=1)
        self._direction = np.zeros_like(starts)
        self._direction[:, :2] = -starts[:, :2] / np.maximum(self._length / 2, 1e-9)[:, None]

    def track(self, t_s: float) -> Track:
        length = np.maximum(self._length, 1e-9)
        legs, along = np.divmod(self._speed * t_s, length)
        back = legs % 2 == 1
        offset = np.where(back, length - along, along)
        speed = np.where(self._length > 0, np.where(back, -self._speed, self._speed), 0.0)
        return Track(self._starts + self._direction * offset[:, None], self._direction * speed[:, None])
