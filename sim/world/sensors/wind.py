"""The mean wind as a flight controller estimates it: steady flight leans against the drag of the air.

The estimate follows the air around the UAV with a time constant of 10 s, and errs slowly: Gauss-Markov, 30 s. From the
logs of a hovering quadrotor the wind was found to 0.26 to 0.29 m/s, RMS, in laminar wind of up to 5 m/s (Drones 4(2),
23, 2020); the default is more, because UAVs here also manoeuvre (assumed). Vertical wind is not estimated.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from fanet_mw.bus.messages import Message, WindEstimate
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, S
from sim.world.engines.contract import Engine
from sim.world.sensors.contract import Drift, Sensor, Truth, generator

_FOLLOWS_S: Final = 10.0
_ERROR_S: Final = 30.0


class WindSensor(Sensor):
    """The estimators of all UAVs."""

    kind = "wind"

    def __init__(self, scenario: Scenario, engine: Engine) -> None:
        config = scenario.sensors
        self.period_ns = round(S / config.wind_hz)
        self._engine = engine
        shape = (scenario.nodes.count, 2)
        random = generator(scenario.seed, "wind estimate")
        self._error = Drift(random, shape, sigma=config.wind_sigma_m_s, tau_s=_ERROR_S)
        self._mean = np.zeros(shape)
        self._share = 1 - math.exp(-1 / (config.wind_hz * _FOLLOWS_S))

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        air, picked = self._engine.air_m_s(), list(rows)
        if air is not None:
            self._mean[picked] += self._share * (air[picked, :2] - self._mean[picked])
        told = self._mean[picked] + self._error.at(truth.now_ns)[picked]
        for row, (east, north) in zip(picked, told.tolist(), strict=True):
            yield row, WindEstimate(truth.now_ns, Enu(east, north, 0.0))
