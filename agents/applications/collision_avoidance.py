"""The application that avoids collisions: it floods collision warnings, obeys those of others, and climbs or descends.

While the UAV avoids another one, the application objects to courses of other applications. The UAVs of a planned search
avoid each other by their velocities instead (`agents/mission/flight/`).
"""

from collections.abc import Mapping
from typing import Any, Final

from agents.applications.conflict_monitor import ConflictMonitor
from fanet_mw import mavlink, wire
from fanet_mw.application import Application, AppPort, Course, Received
from fanet_mw.bus.messages import Gps
from fanet_mw.motion import Motion
from fanet_mw.node.reader import motion_in
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Warned
from fanet_mw.units import NodeId


class CollisionAvoidance(Application):
    """Warns other UAVs of collisions with this one, and avoids them."""

    name: Final = "warning"
    listens = (mavlink.COLLISION_ID,)
    avoids = True

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._monitor = ConflictMonitor(scenario, node)
        self._origin = mavlink.Geodetic(*scenario.world.origin_deg, 0.0)
        self._encoder = mavlink.Encoder(node)
        self._bad_positions = 0
        """The number of hellos without a credible position, or with one that is too old."""

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        heard = motion_in(frame, own=self.port.node, now_ns=now_ns, place=self._origin)
        if heard is None or not self._monitor.on_hello(*heard, now_ns=now_ns):
            self._bad_positions += 1

    def on_message(self, message: Received, now_ns: int) -> None:
        warning = mavlink.collision_of(message.frame)
        self._monitor.on_warning(message.origin, warning, self._motion(now_ns), born_ns=message.born_ns, now_ns=now_ns)
        self.port.tap(message.frame)
        self._hand_over(now_ns)

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self._monitor.on_fix(self._motion(now_ns))
        self._hand_over(now_ns)

    def permits(self, course: Course, now_ns: int) -> bool:
        self._monitor.on_course(course)
        return not self._monitor.avoids

    def report(self) -> Mapping[str, Any]:
        return {"bad_positions": self._bad_positions}

    def _motion(self, now_ns: int) -> Motion:
        return Motion(self.port.position, self.port.velocity, now_ns)

    def _hand_over(self, now_ns: int) -> None:
        monitor, port = self._monitor, self.port
        _record(monitor, port)
        warnings, monitor.warnings = monitor.warnings, []
        for other, approach in warnings:
            inner = self._encoder.collision(
                other,
                closest_s=approach.closest_s,
                altitude_m=abs(approach.apart.up),
                horizontal_m=approach.apart.horizontal(),
            )
            handle = port.send(inner, priority=wire.PRIORITY_SAFETY)
            port.record(Warned(now_ns, port.node, other, handle))
        if monitor.course is not None:
            port.fly(monitor.course)
            monitor.course = None


def _record(monitor: ConflictMonitor, port: AppPort) -> None:
    for record in monitor.records:
        port.record(record)
    monitor.records.clear()
