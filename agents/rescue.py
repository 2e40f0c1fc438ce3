"""Search and rescue as an application: it hands scans, fixes and reports to the mission, and sends and flies for it."""

from typing import Final

from agents.mission.everyone import Mission
from fanet_mw.application import Application, Received, SensorReading
from fanet_mw.bus.messages import Gps, WifiScan
from fanet_mw.errors import MalformedFrameError
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId
from fanet_mw.wire import PRIORITY_REPORT, SURVIVOR
from fanet_mw.wire.inner import Survivor


class Rescue(Application):
    """One UAV's part in the rescue."""

    name: Final = "report"
    listens = (SURVIVOR.msgid,)

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._mission = Mission(node, scenario.mission, altitude_m=scenario.nodes.altitude_m)

    def on_message(self, message: Received, now_ns: int) -> None:
        report = Survivor.decode_frame(message.frame)
        if report.reporter != message.origin:
            raise MalformedFrameError(f"report of {report.reporter} by {message.origin}")
        self._mission.reported(report, position=self.port.position, now_ns=now_ns)
        self.port.tap(message.frame)
        self._settle()

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self._mission.moved(fix.position, now_ns=now_ns)
        self._settle()

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, WifiScan):
            self._mission.scan(reading.heard, position=self.port.position, now_ns=now_ns)
            self._settle()

    def _settle(self) -> None:
        """Bring what the mission put out to where it goes."""
        mission, port = self._mission, self.port
        for record in mission.records:
            port.record(record)
        mission.records.clear()
        reports, mission.reports = mission.reports, []
        for report in reports:
            port.send(report.encode_frame(port.node), priority=PRIORITY_REPORT)
        if mission.course is not None:
            port.fly(mission.course)
            mission.course = None
