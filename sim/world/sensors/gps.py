"""GPS: the true position and velocity with errors, of which the greater part is slow and common to the whole swarm; in
some areas there are no fixes.

    position   truth - velocity x delay + common (Gauss-Markov) + own (Gauss-Markov) + noise of each fix
    velocity   truth + noise of each fix

Most of the budget of errors is common to receivers that are near each other: orbits and clocks of the satellites,
ionosphere and troposphere; reflections and noise are each receiver's own (NAVSTAR GPS User Equipment Introduction,
1996, table 3-1, C/A code at 95 %: 15.2 m of 15.7 m are common). The defaults add up to 2.1 m along each horizontal
axis, the 2.5 m CEP of a u-blox NEO-M8 (data sheet, as its 0.05 m/s). Correlation times: 1800 s in common, the middle of
the 900 to 2700 s of the troposphere, and 300 s for a receiver's own errors, within the 10 to 900 s of multipath (bounds
used in ION's NAVIGATION, after Joerger and Pervan, 2020); for the ionosphere no published time was found. The vertical
error is twice as great (GPS SPS Performance Standard, 5th ed., 2020: 13 m and 8 m at 95 %). The delay is the 0.11 s
that PX4 assumes (EKF2_GPS_DELAY). Not modeled: reflections that depend on walls, and satellites that set.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from fanet_mw.bus.messages import Gps, Message
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu, S, seconds_to_ns
from sim.world.arrays import Flags, Rows
from sim.world.incidents import Mishaps
from sim.world.sensors.contract import Drift, Sensor, Truth, generator


class Outages:
    """The areas and times without fixes."""

    def __init__(self, scenario: Scenario) -> None:
        self._outages = [
            (np.array([east, north]), radius, seconds_to_ns(begin_s), seconds_to_ns(end_s))
            for east, north, radius, begin_s, end_s in scenario.sensors.gps_outages
        ]

    def out(self, at: Rows, now_ns: int) -> Flags:
        """Which of these places have no fix."""
        out = np.zeros(len(at), bool)
        for place, radius_m, begin_ns, end_ns in self._outages:
            if begin_ns <= now_ns < end_ns:
                out |= np.linalg.norm(at[:, :2] - place, axis=1) <= radius_m
        return out


class PostReceiver:
    """The receiver of the post on the ground, whose place is surveyed: it gives the time (`clock.sync = "gps"`)."""

    def __init__(self, scenario: Scenario, place: Enu) -> None:
        self._period_ns = round(S / scenario.world.gps_hz)
        self._outages = Outages(scenario)
        self._place = place

    def readings(self, now_ns: int, *, before_ns: int) -> Iterator[Gps]:
        """The fix of an instant in (before, now], if there is one."""
        due = now_ns // self._period_ns > before_ns // self._period_ns
        if due and not self._outages.out(np.array([self._place]), now_ns)[0]:
            yield Gps(now_ns, self._place, Enu(0.0, 0.0, 0.0))


class GpsReceiver(Sensor):
    """One receiver per UAV; all give their fixes at the same instants, as with GPS time."""

    kind = "gps"
    spread = False

    def __init__(self, scenario: Scenario, mishaps: Mishaps | None = None) -> None:
        self.period_ns = round(S / scenario.world.gps_hz)
        self._noise = generator(scenario.seed, "gps")
        config, count = scenario.sensors, scenario.nodes.count
        self._sigma_m = np.array([1.0, 1.0, config.gps_vertical]) * scenario.world.gps_sigma_m
        self._velocity_m_s, self.delay_s = config.gps_velocity_m_s, config.gps_delay_s
        self._common = Drift(
            generator(scenario.seed, "gps_common"), (1, 3), sigma=config.gps_common_m, tau_s=config.gps_common_time_s
        )
        self._own = Drift(
            generator(scenario.seed, "gps_bias"), (count, 3), sigma=config.gps_bias_m, tau_s=config.gps_bias_time_s
        )
        self._slow = np.array([1.0, 1.0, config.gps_vertical])
        self._last: tuple[int, Rows, Rows, Flags] | None = None
        self._mishaps = mishaps
        self._outages = Outages(scenario)

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        position, velocity, out = self.fixes(truth)
        for row in rows:
            if not out[row]:
                yield row, Gps(truth.now_ns, Enu(*position[row].tolist()), Enu(*velocity[row].tolist()))

    def fixes(self, truth: Truth) -> tuple[Rows, Rows, Flags]:
        """Positions and velocities of all receivers, and which of them have no fix; the same ones when asked again."""
        if self._last is None or self._last[0] != truth.now_ns:
            noise, shape, now_ns = self._noise, truth.at.shape, truth.now_ns
            slow = (self._common.at(now_ns) + self._own.at(now_ns)) * self._slow
            position = truth.at - truth.velocity * self.delay_s + slow + noise.normal(0.0, 1.0, shape) * self._sigma_m
            velocity = truth.velocity + noise.normal(0.0, self._velocity_m_s, shape)
            out = self._outages.out(truth.at, now_ns)
            if self._mishaps is not None:
                position += self._mishaps.offset_m
                out |= self._mishaps.silent
            self._last = now_ns, position, velocity, out
        return self._last[1:]
