"""Velocity without GPS: inertial sensors, corrected by optical flow.

The error along each axis is Gaussian noise for each reading and a Gauss-Markov drift of 100 s. PX4's optical flow on a
PX4FLOW has an error of about 0.1 m/s over textured ground (Honegger et al., ICRA 2013). Its integral is a position that
drifts: after a time t much longer than 100 s by about drift x sqrt(2 x 100 s x t).
"""

from collections.abc import Iterator, Sequence
from typing import Final

from fanet_mw.bus.messages import Inertial, Message
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu, S
from sim.world.sensors.contract import Drift, Sensor, Truth, generator

DRIFT_S: Final = 100.0


class InertialSensor(Sensor):
    """One inertial unit per UAV."""

    kind = "inertial"

    def __init__(self, scenario: Scenario) -> None:
        config = scenario.sensors
        self.period_ns = round(S / config.inertial_hz)
        self._sigma_m_s = config.inertial_sigma_m_s
        self._random = generator(scenario.seed, "inertial")
        slow = generator(scenario.seed, "inertial_drift")
        self._drift = Drift(slow, (scenario.nodes.count, 3), sigma=config.inertial_drift_m_s, tau_s=DRIFT_S)

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        if not rows:
            return
        picked = list(rows)
        told = truth.velocity[picked] + self._drift.at(truth.now_ns)[picked]
        told += self._random.normal(0.0, self._sigma_m_s, told.shape)
        for row, velocity in zip(picked, told.tolist(), strict=True):
            yield row, Inertial(truth.now_ns, Enu(*velocity))
