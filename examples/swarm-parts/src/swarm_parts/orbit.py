"""The layout turns around the middle of the area as a wheel does."""

import math

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field

from fanet_mw.scenario import Scenario
from sim.world.mobility.contract import Track

Rows = npt.NDArray[np.float64]


class Options(BaseModel, extra="forbid"):
    """The table `[mobility.options]`."""

    period_s: float = Field(300, gt=0, le=1e6)
    """One turn; slower where the outermost UAV would exceed `mobility.speed_m_s`."""


class Orbit:
    """A mobility model."""

    Options = Options

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._starts = starts
        farthest_m = float(np.hypot(starts[:, 0], starts[:, 1]).max())
        wanted = 2 * math.pi / Options.model_validate(scenario.mobility.options).period_s
        self._rate = min(wanted, scenario.mobility.speed_m_s / max(farthest_m, 1e-9))

    def track(self, t_s: float) -> Track:
        cos, sin = math.cos(self._rate * t_s), math.sin(self._rate * t_s)
        places, velocities = self._starts.copy(), np.zeros_like(self._starts)
        places[:, 0] = cos * self._starts[:, 0] - sin * self._starts[:, 1]
        places[:, 1] = sin * self._starts[:, 0] + cos * self._starts[:, 1]
        velocities[:, 0], velocities[:, 1] = -self._rate * places[:, 1], self._rate * places[:, 0]
        return Track(places, velocities)
