"""The phones that a UAV's own receiver hears: each power goes into the filter of that phone, and out as a report.

A receiver that hears no phone says nothing. A review takes a while without a scan for a scan without phones.
"""

from collections.abc import Sequence
from typing import Final

from agents.mission.finding.coverage_map import CoverageMap
from agents.mission.finding.finds import Finds
from agents.mission.navigation.navigation import Navigation
from agents.mission.outbox import Outbox, ReportFormat
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Detected
from fanet_mw.units import US, NodeId, S, seconds_to_ns
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Covered

MISSED_SCANS: Final = 1.5
"""So many intervals of the scan without a word from the receiver mean that it hears no phone."""


class PhoneReception:
    """What the receiver of one UAV hears of phones, and where it has listened."""

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        finds: Finds,
        navigation: Navigation,
        outbox: Outbox,
        coverage: CoverageMap | None,
    ) -> None:
        """`coverage`: the map of what has been searched, for UAVs that share one."""
        self._node = node
        self._finds, self._navigation, self._outbox = finds, navigation, outbox
        self._format = ReportFormat(scenario, node)
        self._silent_after_ns = MISSED_SCANS * scenario.mission.scan_interval_s * S
        self._report_every_ns = seconds_to_ns(scenario.mission.report_interval_s)
        self._coverage = coverage
        self._scan_ns = 0
        self._reported_ns: dict[int, int] = {}

    def review(self, now_ns: int) -> None:
        """Take a receiver that has said nothing for a while as one that hears no phone, and note where it is."""
        if self._coverage is not None:
            self._coverage.fly_over(self._navigation.position)
        if now_ns - self._scan_ns > self._silent_after_ns:
            self.scan((), now_ns=now_ns)

    def scan(self, heard: Sequence[tuple[int, float]], *, now_ns: int) -> None:
        """The receiver hears these phones with these powers [dBm], and no others."""
        self._scan_ns = now_ns
        here = self._navigation.position
        in_reach = {survivor for survivor, _ in heard}
        for survivor in self._finds.unconfirmed():
            if survivor not in in_reach:
                self._finds.known[survivor].filter.on_silence(here)
        for survivor, rssi_dbm in heard:
            report = Survivor(now_ns // US, survivor, self._node, here, rssi_dbm)
            find = self._finds.known.get(survivor)
            if find is None or self._node not in find.reporters:
                self._outbox.records.append(Detected(now_ns, self._node, survivor, round(rssi_dbm, 2)))
            find = self._finds.take_report(report, now_ns=now_ns)
            last_ns = self._reported_ns.get(survivor)
            if find.confirmed is None and (last_ns is None or now_ns - last_ns >= self._report_every_ns):
                self._reported_ns[survivor] = now_ns
                self._outbox.packets.append(self._format.packet(report))

    def on_covered(self, covered: Covered) -> None:
        """A neighbor tells what has been searched."""
        if self._coverage is not None:
            self._coverage.merge(covered)

    def hello_frames(self, now_ns: int) -> bytes:
        """Inner frames for the next hello: what has been searched, when that is due."""
        covered = None if self._coverage is None else self._coverage.news(now_ns)
        return b"" if covered is None else covered.encode_frame(self._node)
