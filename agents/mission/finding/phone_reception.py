"""Handles the phones that a UAV's own receiver detects: each power goes into the phone's filter, and out as a report.

A receiver that detects no phone says nothing. If no scan has come for a while, a scan without phones is assumed. A
neighbor that does not report a phone does not receive it where it flies, which tells as much. So do the places where
this UAV and its neighbors were before anybody received the phone: it is ahead of a line that has passed, not behind.
"""

from collections.abc import Sequence
from typing import Final

from agents.mission.finding.known_survivors import KnownSurvivors
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox, ReportFormat
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Detected
from fanet_mw.units import US, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.survivors import Survivor

MISSED_SCANS: Final = 1.5
"""After this number of scan intervals without a scan, the receiver is taken to detect no phone."""
_OTHERS_NS: Final = 3 * S
"""How often it is noted where neighbors receive nothing."""
_UNREPORTED_NS: Final = 7 * S
"""A neighbor that receives a phone has reported it within this time."""
_NEAR_M: Final = 450.0
"""Phones that are farther away than this concern others."""
_ENOUGH: Final = 12
"""A phone that was received so often is placed by its powers."""
_REMEMBERED_NS: Final = 60 * S
"""How long it is remembered where somebody has listened: a phone may have been switched on since."""
_LISTENED_M: Final = 50.0
"""The side of the cells in each of which one place is remembered; nearer places share their shadowing."""


class PhoneReception:
    """The receptions of phones by one UAV, and where it has listened."""

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        survivors: KnownSurvivors,
        own_motion: OwnMotion,
        outbox: Outbox,
        neighbors: NeighborMotions,
    ) -> None:
        self._neighbors = neighbors
        self._others_ns = 0
        self._node = node
        self._survivors, self._own_motion, self._outbox = survivors, own_motion, outbox
        self._format = ReportFormat(scenario, node)
        self._silent_after_ns = MISSED_SCANS * scenario.mission.scan_interval_s * S
        self._report_every_ns = seconds_to_ns(scenario.mission.report_interval_s)
        self._scan_ns = 0
        self._reported_ns: dict[int, int] = {}
        self._listened: dict[tuple[int, int], tuple[int, Enu]] = {}
        """The newest place in each cell where this UAV or a neighbor has listened, and when."""
        self._recalled: set[int] = set()
        """The survivors whose filters know where somebody listened before they were received."""

    def review(self, now_ns: int) -> None:
        """If there was no scan for a while, assume one without phones at the present place."""
        if now_ns - self._scan_ns > self._silent_after_ns:
            self.scan((), now_ns=now_ns)
        if now_ns - self._others_ns >= _OTHERS_NS:
            self._others_ns = now_ns
            self._note_silent_neighbors(now_ns)
            self._note_listeners(now_ns)
        for survivor in self._survivors.sought():
            if survivor not in self._recalled:
                self._recall(survivor)

    def _note_listeners(self, now_ns: int) -> None:
        """Remember where this UAV and its neighbors are."""
        neighbors = (motion.position for motion in self._neighbors.all(now_ns=now_ns))
        for at in (self._own_motion.position, *neighbors):
            self._listened[round(at.east / _LISTENED_M), round(at.north / _LISTENED_M)] = now_ns, at
        old = [cell for cell, (then_ns, _) in self._listened.items() if now_ns - then_ns > _REMEMBERED_NS]
        for cell in old:
            del self._listened[cell]

    def _recall(self, survivor: int) -> None:
        """Take in that a phone was not received at the places where somebody has listened before."""
        known = self._survivors.by_id[survivor]
        if not known.filter.received_powers:
            return
        self._recalled.add(survivor)
        for then_ns, at in self._listened.values():
            if known.first_ns - then_ns >= _OTHERS_NS:
                known.filter.on_silence(at)

    def _note_silent_neighbors(self, now_ns: int) -> None:
        """Take in that neighbors do not receive phones that are hardly placed yet."""
        vague = [
            known
            for survivor in self._survivors.sought()
            if (known := self._survivors.by_id[survivor]).filter.received_powers < _ENOUGH
            and known.filter.near(self._own_motion.position, within_m=_NEAR_M)
            and now_ns - known.first_ns > _OTHERS_NS
        ]
        for node, motion in self._neighbors.by_node(now_ns=now_ns) if vague else ():
            for known in vague:
                report = known.latest.get(node)
                if report is None or now_ns - report.t_us * US > _UNREPORTED_NS:
                    known.filter.on_silence(motion.position)

    def scan(self, heard: Sequence[tuple[int, float]], *, now_ns: int) -> None:
        """The receiver detects these phones with these powers [dBm], and no others."""
        self._scan_ns = now_ns
        here = self._own_motion.position
        in_reach = {survivor for survivor, _ in heard}
        for survivor in self._survivors.unconfirmed():
            if survivor not in in_reach:
                self._survivors.by_id[survivor].filter.on_silence(here)
        for survivor, rssi_dbm in heard:
            report = Survivor(now_ns // US, survivor, self._node, here, rssi_dbm)
            known = self._survivors.by_id.get(survivor)
            if known is None or self._node not in known.reporters:
                self._outbox.records.append(Detected(now_ns, self._node, survivor, round(rssi_dbm, 2)))
            known = self._survivors.take_report(report, now_ns=now_ns)
            last_ns = self._reported_ns.get(survivor)
            if known.confirmed is None and (last_ns is None or now_ns - last_ns >= self._report_every_ns):
                self._reported_ns[survivor] = now_ns
                self._outbox.packets.append(self._format.packet(report))
