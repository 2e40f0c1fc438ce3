"""Where flight controllers believe their UAVs to be: the errors of a filter of inertial sensors, GPS and barometer.

    velocity error' = b                                        b: bias of the accelerometers, and of the tilt
    position error' = velocity error
    with each fix   position error += 0.15 (error of the fix - position error);   velocity error likewise, by 0.3
    height          follows the barometer with a time constant of 2 s
    optical flow    velocity error += 0.3 (error of the flow - velocity error), when `sensors.inertial_hz` says so

That is a complementary filter with fixed gains, as those of PX4's EKF2 at 5 Hz settle to. b is a Gauss-Markov process
of 0.05 m/s2, a tilt of 0.3 degrees, over 100 s. Only errors are computed, because whatever a filter predicts from true
accelerations is true. A UAV that has had neither a fix nor optical flow for 5 s (EKF2_NOAID_TOUT) does not know its
place: as in PX4 (FlightTaskDescend) its flight controller then sinks with what it takes for a level attitude, wrong
by b, and the air takes it along. Not modeled: magnetic disturbances, and fixes that a filter rejects.
"""

from typing import Final

import numpy as np

from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.world import NO_AID_S
from fanet_mw.units import S
from sim.world.arrays import Flags, Rows
from sim.world.sensors.altimeter import DRIFT_S as BAROMETER_S
from sim.world.sensors.contract import Drift, Truth, generator
from sim.world.sensors.gps import GpsReceiver
from sim.world.sensors.inertial import DRIFT_S as FLOW_S

_PLACE_GAIN: Final = 0.15
_VELOCITY_GAIN: Final = 0.3
_HEIGHT_S: Final = 2.0
_BIAS_M_S2: Final = 0.05
_BIAS_S: Final = 100.0


class PositionEstimate:
    """The errors of the estimates of all UAVs."""

    def __init__(self, scenario: Scenario, gps: GpsReceiver) -> None:
        shape, sensors = (scenario.nodes.count, 3), scenario.sensors

        def drift(name: str, sigma: float, tau_s: float) -> Drift:
            return Drift(generator(scenario.seed, name), shape, sigma=sigma, tau_s=tau_s)

        self._gps = gps
        self._bias = drift("control_bias", _BIAS_M_S2, _BIAS_S)
        self.tilt_m_s2 = np.zeros(shape)
        """How fast each UAV accelerates whose flight controller believes that its attitude is level."""
        self._barometer = drift("control_barometer", sensors.barometer_drift_m, BAROMETER_S)
        self._flow = drift("control_flow", sensors.inertial_drift_m_s, FLOW_S) if sensors.inertial_hz else None
        self.off_m = np.zeros(shape)
        """The estimated positions less the true ones."""
        self.off_m_s = np.zeros(shape)
        """The same for velocities."""
        self._t_ns: int | None = None
        self._aided_ns = np.zeros(scenario.nodes.count, np.int64)

    def lost(self, now_ns: int) -> Flags:
        """The UAVs that do not know their place."""
        return np.asarray(now_ns - self._aided_ns > NO_AID_S * S)

    def advance(self, truth: Truth) -> None:
        """Let time pass until the instant of `truth`; after a time in which nobody flew the filter begins anew."""
        now_ns = truth.now_ns
        if self._t_ns is None or now_ns - self._t_ns > S:
            self._begin(truth)
            return
        seconds, before_ns = (now_ns - self._t_ns) / S, self._t_ns
        self._t_ns = now_ns
        self.tilt_m_s2 = self._bias.at(now_ns)
        self.off_m_s += self.tilt_m_s2 * seconds
        self.off_m += self.off_m_s * seconds
        if self._flow is not None:
            self.off_m_s += _VELOCITY_GAIN * (self._flow.at(now_ns) - self.off_m_s)
            self._aided_ns[:] = now_ns
        if self._gps.due(1, now_ns=now_ns, before_ns=before_ns):
            self._correct(truth)
        self.off_m[:, 2] += seconds / _HEIGHT_S * (self._barometer.at(now_ns)[:, 2] - self.off_m[:, 2])
        self.off_m_s[:, 2] = 0.0

    def _begin(self, truth: Truth) -> None:
        position, _, out = self._fix(truth)
        self.off_m = np.where(out[:, None], self.off_m, position)
        self.off_m[:, 2] = self._barometer.at(truth.now_ns)[:, 2]
        self.off_m_s = np.zeros_like(self.off_m)
        self._bias.at(truth.now_ns)
        self._aided_ns[:] = truth.now_ns
        self._t_ns = truth.now_ns

    def _correct(self, truth: Truth) -> None:
        position, velocity, out = self._fix(truth)
        here = ~out
        self.off_m[here, :2] += _PLACE_GAIN * (position - self.off_m)[here, :2]
        self.off_m_s[here] += _VELOCITY_GAIN * (velocity - self.off_m_s)[here]
        self._aided_ns[here] = truth.now_ns

    def _fix(self, truth: Truth) -> tuple[Rows, Rows, Flags]:
        """The errors of position and velocity of all fixes, when their delay has been made up for, and who has none."""
        position, velocity, out = self._gps.fixes(truth)
        return position + velocity * self._gps.delay_s - truth.at, velocity - truth.velocity, out
