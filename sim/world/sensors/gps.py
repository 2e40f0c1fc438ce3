"""GPS: the true position and velocity, with noise that is new for each fix and a slow bias; in some areas there are no
fixes.

Noise and bias are Gaussian along each axis, with the standard deviations `world.gps_sigma_m` and `sensors.gps_bias_m`;
the bias is a Gauss-Markov process. The velocity, which a receiver derives from Doppler shifts, is exact. Not modeled:
the geometry of satellites, and reflections by walls.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from fanet_mw.bus.messages import Gps, Message
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu, S, seconds_to_ns
from sim.world.engines.contract import Flags
from sim.world.sensors.contract import Drift, Sensor, Truth, generator


class GpsReceiver(Sensor):
    """One receiver per UAV; all give their fixes at the same instants, as with GPS time."""

    kind = "gps"
    spread = False

    def __init__(self, scenario: Scenario) -> None:
        self.period_ns = round(S / scenario.world.gps_hz)
        self._sigma_m = scenario.world.gps_sigma_m
        self._noise = generator(scenario.seed, "gps")
        sensors, shape = scenario.sensors, (scenario.nodes.count, 3)
        slow = generator(scenario.seed, "gps_bias")
        self._bias = (
            Drift(slow, shape, sigma=sensors.gps_bias_m, tau_s=sensors.gps_bias_time_s) if sensors.gps_bias_m else None
        )
        self._outages = [
            (np.array([east, north]), radius, seconds_to_ns(begin_s), seconds_to_ns(end_s))
            for east, north, radius, begin_s, end_s in sensors.gps_outages
        ]

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        noisy = truth.at + self._noise.normal(0.0, self._sigma_m, truth.at.shape)
        if self._bias is not None:
            noisy += self._bias.at(truth.now_ns)
        out = self._out(truth) if self._outages else None
        for row in rows:
            if out is None or not out[row]:
                yield row, Gps(truth.now_ns, Enu(*noisy[row].tolist()), Enu(*truth.velocity[row].tolist()))

    def _out(self, truth: Truth) -> Flags:
        """The UAVs that get no fix now."""
        out = np.zeros(len(truth.at), bool)
        for place, radius_m, begin_ns, end_ns in self._outages:
            if begin_ns <= truth.now_ns < end_ns:
                out |= np.linalg.norm(truth.at[:, :2] - place, axis=1) <= radius_m
        return out
