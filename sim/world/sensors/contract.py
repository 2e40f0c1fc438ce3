"""The contract of a sensor: the true state at one instant goes in, the readings of those UAVs that are due come out.

A sensor adds its own errors to the truth, from random streams of its own, so that adding or removing a sensor does not
change the readings of others. A UAV that gets a reading learns nothing else of the truth.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from fanet_mw.bus.messages import Message
from fanet_mw.rng import stream_seed
from fanet_mw.units import S
from sim.world.arrays import Rows, Values

_LONGEST_NS: Final = 1 << 62
"""No run is as long; longer periods do not fit 64 bits."""


class Truth(NamedTuple):
    """The true state of all bodies at one instant; row i is node i + 1."""

    now_ns: int
    at: Rows
    velocity: Rows


class Sensor(ABC):
    """One kind of sensor, on all UAVs."""

    kind: str
    """The last part of its topics."""
    period_ns: int
    spread = True
    """True if the UAVs' instants are spread over the period, so that not all readings come at once."""

    @abstractmethod
    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        """The readings of the UAVs `rows`, each with its row; a UAV whose sensor has detected nothing gives none."""

    def close(self) -> None:  # noqa: B027  (only what renders holds anything)
        """Release what the sensor holds; most sensors hold nothing."""

    def due(self, count: int, *, now_ns: int, before_ns: int) -> list[int]:
        """The rows that have an instant in (before, now]."""
        period_ns = min(self.period_ns, _LONGEST_NS)
        if not self.spread:
            return list(range(count)) if now_ns // period_ns > before_ns // period_ns else []
        phases_ns = _phases_ns(count, period_ns)
        due = (now_ns - phases_ns) // period_ns > (before_ns - phases_ns) // period_ns
        return np.flatnonzero(due).tolist()


@cache
def _phases_ns(count: int, period_ns: int) -> npt.NDArray[np.int64]:
    """The first instant of each UAV, spread over the period."""
    return np.array([row * period_ns // count for row in range(count)], np.int64)


def generator(seed: int, *names: str) -> np.random.Generator:
    """The random number generator for one named use."""
    return np.random.Generator(np.random.PCG64(stream_seed(seed, *names)))


class Drift:
    """Slow errors: a Gauss-Markov process for each UAV and axis, x' = -x / tau + noise, of a given deviation."""

    def __init__(self, random: np.random.Generator, shape: tuple[int, ...], *, sigma: float, tau_s: float) -> None:
        self._random = random
        self._sigma, self._tau_s = sigma, tau_s
        self._value = random.normal(0.0, sigma, shape)
        self._t_ns = 0

    def at(self, now_ns: int) -> Values:
        """The errors of all UAVs at an instant, which must not be before the last one."""
        elapsed_s = (now_ns - self._t_ns) / S
        if elapsed_s > 0:
            kept = math.exp(-elapsed_s / self._tau_s)
            fresh = self._random.normal(0.0, self._sigma * math.sqrt(1 - kept * kept), self._value.shape)
            self._value = kept * self._value + fresh
            self._t_ns = now_ns
        return self._value


def angles(direction: Values) -> tuple[float, float]:
    """Bearing from north, clockwise, and elevation [rad] of a vector [3]."""
    east, north, up = direction.tolist()
    return math.atan2(east, north) % (2 * math.pi), math.atan2(up, math.hypot(east, north))


def shaken(random: np.random.Generator, direction: Values, sigma_rad: float) -> Values:
    """A unit vector [3] with an error of `sigma_rad` along each of the two axes across it."""
    moved: Values = direction + random.normal(0.0, sigma_rad, 3)
    return moved / np.linalg.norm(moved)
