"""Collects the decisions of one UAV's mission: records for the trace, packets to flood, and a course to fly."""

from dataclasses import dataclass, field
from typing import NamedTuple

from fanet_mw.application import AppPort, Course
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import NodeId
from fanet_mw.wire import HEADER_BYTES, PRIORITY_REPORT, filler
from fanet_mw.wire.survivors import Survivor


class OutgoingPacket(NamedTuple):
    """Inner frames to be flooded to all nodes."""

    frames: bytes
    priority: int = PRIORITY_REPORT


@dataclass
class Outbox:
    """The decisions of one UAV's mission since the last input."""

    records: list[Record] = field(default_factory=list)
    packets: list[OutgoingPacket] = field(default_factory=list)
    course: Course | None = None
    """A new course to fly; None if the old one holds."""

    def empty(self, port: AppPort) -> None:
        for record in self.records:
            port.record(record)
        self.records.clear()
        packets, self.packets = self.packets, []
        for packet in packets:
            port.send(packet.frames, priority=packet.priority)
        course, self.course = self.course, None
        if course is not None:
            port.fly(course)


class ReportFormat:
    """Survivor reports of the length that the scenario says."""

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._node = node
        self._bytes = scenario.mission.report_bytes

    def packet(self, report: Survivor) -> OutgoingPacket:
        """The packet of a report, padded to its length."""
        frames = report.encode_frame(self._node)
        if self._bytes:
            frames += filler(self._bytes - HEADER_BYTES - len(frames), node=self._node)
        return OutgoingPacket(frames)
