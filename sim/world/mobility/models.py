"""The mobility models: `random_waypoint` (Johnson and Maltz, 1996), without pauses; `formation`, in which the world
moves the whole layout as one, and it keeps its shape; `crossing`, for tests of collision avoidance.

Formations that UAVs fly by themselves are in `agents/mission/`: `formation_flight/` and `search_formation/`.
"""

import numpy as np
import numpy.typing as npt

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
