"""Collision avoidance as an application: hellos, warnings and fixes to the lookout, its warnings to everyone.

It objects to the courses of other applications while it avoids somebody.
"""

import math
from collections.abc import Mapping
from typing import Any, Final

from agents.lookout import Lookout
from fanet_mw import mavlink, wire
from fanet_mw.application import Application, AppPort, Course, Received
from fanet_mw.bus.messages import Gps
from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.clustered.roles.position_updates import Motion
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Warned
from fanet_mw.units import MS, NodeId


class CollisionAvoidance(Application):
    """One UAV that warns others, and avoids them."""

    name: Final = "warning"
    listens = (mavlink.COLLISION_ID,)

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        self._lookout = Lookout(scenario, node)
        self._encoder = mavlink.Encoder(node)
        self._bad_positions = 0
        """Hellos whose position is none, or not of now."""

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        """A neighbor's hello says where it flies."""
        try:
            origin = NodeId(wire.decode_header(frame).origin)
            told = mavlink.kinematics_of(frame)
        except MalformedFrameError:
            self._bad_positions += 1
            return
        if not self._lookout.heard(origin, Motion(told.position, told.velocity, told.t_ms * MS), now_ns=now_ns):
            self._bad_positions += 1

    def on_message(self, message: Received, now_ns: int) -> None:
        """A warning of another UAV, for us perhaps."""
        warning = mavlink.collision_of(message.frame)
        self._lookout.warned(message.origin, warning, self._motion(now_ns), born_ns=message.born_ns, now_ns=now_ns)
        self.port.tap(message.frame)
        self._settle(now_ns)

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self._lookout.moved(self._motion(now_ns))
        self._settle(now_ns)

    def permits(self, course: Course, now_ns: int) -> bool:
        return self._lookout.steered(course)

    def report(self) -> Mapping[str, Any]:
        return {"bad_positions": self._bad_positions}

    def _motion(self, now_ns: int) -> Motion:
        return Motion(self.port.position, self.port.velocity, now_ns)

    def _settle(self, now_ns: int) -> None:
        """Bring what the lookout put out to where it goes: records, warnings, and how to fly."""
        lookout, port = self._lookout, self.port
        _record(lookout, port)
        warnings, lookout.warnings = lookout.warnings, []
        for other, approach in warnings:
            inner = self._encoder.collision(
                other,
                closest_s=approach.closest_s,
                altitude_m=abs(approach.apart.up),
                horizontal_m=math.hypot(approach.apart.east, approach.apart.north),
            )
            handle = port.send(inner, priority=wire.PRIORITY_SAFETY)
            port.record(Warned(now_ns, port.node, other, handle))
        if lookout.course is not None:
            port.fly(lookout.course)
            lookout.course = None


def _record(lookout: Lookout, port: AppPort) -> None:
    for record in lookout.records:
        port.record(record)
    lookout.records.clear()
