"""The paper's rule at one UAV (4.1): detect, report, and approach a survivor that enough nodes (3) have reported."""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.least_squares import PowerReading, estimate
from agents.mission.finding.phone_reception import MISSED_SCANS
from agents.mission.flight.approach_speed import approach_speed_m_s
from agents.mission.outbox import Outbox, ReportFormat
from fanet_mw.application import HOME, Course
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Arrived, Detected
from fanet_mw.units import GOLDEN_ANGLE, US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.survivors import Survivor

_RING_M: Final = 20.0
"""UAVs hold on a circle of this radius around the survivor, each at an angle of its own."""
_MOVED_M: Final = 10.0
"""A better estimate changes the setpoint only if it has moved this far."""


class PaperRule:
    """The scans and reports of one UAV, and the survivor that it has chosen to approach."""

    def __init__(self, scenario: Scenario, node: NodeId, outbox: Outbox) -> None:
        self._node = node
        self._config = scenario.mission
        self._altitude_m = scenario.nodes.altitude_m
        self._speed_m_s = approach_speed_m_s(scenario, node)
        self._heard_for_ns = seconds_to_ns(MISSED_SCANS * self._config.scan_interval_s)
        self._format = ReportFormat(scenario, node)
        self._outbox = outbox
        self._detected: set[int] = set()
        self._measured: dict[int, Survivor] = {}
        """The latest received power of each phone that the receiver detects."""
        self._due_ns: dict[int, int] = {}
        """The instant at which each of these phones must be reported next."""
        self._readings: dict[int, dict[int, PowerReading]] = {}
        self._visited: set[int] = set()
        self._target: int | None = None
        self._target_at = Enu(0, 0, 0)
        self._dwell_until_ns: int | None = None

    # --- input ----------------------------------------------------------------------------------------------------

    def scan(self, heard: Sequence[tuple[int, float]], *, position: Enu, now_ns: int) -> None:
        """The receiver detects these phones; each is reported now, and again after each interval."""
        before, self._measured = self._measured, {}
        for survivor, rssi_dbm in heard:
            if survivor not in self._detected:
                self._detected.add(survivor)
                self._outbox.records.append(Detected(now_ns, self._node, survivor, round(rssi_dbm, 2)))
            self._measured[survivor] = Survivor(now_ns // US, survivor, self._node, position, rssi_dbm)
            if survivor not in before:
                self._due_ns[survivor] = max(now_ns, self._due_ns.get(survivor, now_ns))
        self.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        if not self._measured:
            return None  # this is so for most nodes, most of the time
        return min((self._due_ns[survivor] for survivor in self._measured), default=None)

    def wake(self, now_ns: int) -> None:
        """Make the due reports of phones that are still detected."""
        for survivor, measured in list(self._measured.items()):
            if now_ns - measured.t_us * US > self._heard_for_ns:
                del self._measured[survivor]  # a receiver that detects no phone says nothing
            elif now_ns >= self._due_ns[survivor]:
                self._due_ns[survivor] = now_ns + seconds_to_ns(self._config.report_interval_s)
                self._outbox.packets.append(self._format.packet(measured))

    def reported(self, report: Survivor, *, position: Enu, now_ns: int) -> None:
        readings = self._readings.setdefault(report.survivor, {})
        known = readings.get(report.reporter)
        if known is not None and report.rssi_dbm <= known.rssi_dbm:
            return  # the strongest one is the nearest and the least shadowed
        readings[report.reporter] = PowerReading(report.position, report.rssi_dbm)
        if self._target is None:
            self._choose(position, now_ns)
        elif self._target == report.survivor:
            self._refine()

    def moved(self, position: Enu, *, now_ns: int) -> None:
        """A position fix, by which the UAV finds out whether it has arrived and whether it has stayed long enough."""
        if self._target is None:
            return
        if self._dwell_until_ns is None:
            if position.horizontal_to(self._target_at) <= self._config.arrival_m + _RING_M:
                self._dwell_until_ns = now_ns + round(self._config.dwell_s * S)
                self._outbox.records.append(Arrived(now_ns, self._node, self._target))
        elif now_ns >= self._dwell_until_ns:
            self._visited.add(self._target)
            self._target = self._dwell_until_ns = None
            self._choose(position, now_ns)
            if self._target is None:
                self._outbox.course = Course(position, HOME)

    # --- decisions ------------------------------------------------------------------------------------------------

    def _choose(self, position: Enu, now_ns: int) -> None:
        """Choose the nearest survivor that enough different nodes have reported and that this UAV has not visited."""
        candidates = [
            (self._place(survivor), survivor)
            for survivor in sorted(self._readings)
            if survivor not in self._visited and len(self._readings[survivor]) >= self._config.reports_to_approach
        ]
        if not candidates:
            return
        self._target_at, self._target = min(candidates, key=lambda c: (c[0].horizontal_to(position), c[1]))
        reporters = len(self._readings[self._target])
        self._outbox.records.append(
            Approaching(now_ns, self._node, self._target, reporters, *_rounded(self._target_at))
        )
        self._outbox.course = Course(self._hold_point(), self._speed_m_s)

    def _refine(self) -> None:
        assert self._target is not None, "only a target can be refined"
        if self._dwell_until_ns is not None:
            return
        better = self._place(self._target)
        if better.minus(self._target_at).norm() > _MOVED_M:
            self._target_at = better
            self._outbox.course = Course(self._hold_point(), self._speed_m_s)

    def _place(self, survivor: int) -> Enu:
        readings = self._readings[survivor]
        return estimate(
            [readings[reporter] for reporter in sorted(readings)],
            phone_power_dbm=self._config.phone_power_dbm,
            exponent=self._config.phone_exponent,
        )

    def _hold_point(self) -> Enu:
        angle = self._node * GOLDEN_ANGLE
        return Enu(
            self._target_at.east + _RING_M * math.cos(angle),
            self._target_at.north + _RING_M * math.sin(angle),
            self._altitude_m,
        )


def _rounded(at: Enu) -> tuple[float, float]:
    return round(at.east, 2), round(at.north, 2)
