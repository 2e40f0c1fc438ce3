"""The UAV as an actor: node, autopilot, traffic and mission of one id, wired to topics.

Inputs are receptions, transmit statuses and sensor readings; outputs are transmit requests, setpoints and a MAVLink
tap. Everything that decides is in the parts; this file only says what goes where.
"""

import math
from collections.abc import Mapping
from typing import Any, Final

from agents.autopilot import Autopilot
from agents.lookout import Lookout
from agents.mission import Course, Mission
from agents.steady_fix import SteadyFix
from agents.traffic import Traffic
from fanet_mw import mavlink, wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Gps, MavlinkTap, Message, Reception, Setpoint, TxStatus, WifiScan
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.node import Node
from fanet_mw.node.queue import Packet
from fanet_mw.rng import stream
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.roles.position_updates import Motion
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Warned
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, earliest, seconds_to_ns
from fanet_mw.wire.inner import Survivor

_HELLO_JITTER: Final = 0.1
"""A hello varies by this share of its interval, so that neighbors in step do not stay so (RFC 3626, 3.4)."""


class Uav(Actor):
    """One UAV."""

    def __init__(self, scenario: Scenario, node: NodeId, swarm: str, *, position: Enu) -> None:
        topics = Topics(swarm)
        super().__init__(f"agent-{node}", (topics.radio_rx(node), topics.sensors(node)))
        self._id = node
        self._tx_topic = topics.radio_tx(node)
        self._setpoint_topic = topics.setpoint(node)
        self._tap_topic = topics.mavlink(node)
        self._lead_ns = scenario.radio.lead_ns
        self._prompt_ns = scenario.radio.handover_ns + scenario.radio.lead_ns
        """After the end of a frame: who hears of it later than this is too late for what comes a lead after it."""
        self._destination = BROADCAST if scenario.traffic.destination == "all" else NodeId(scenario.traffic.destination)
        self._filler = wire.filler(scenario.traffic.payload_bytes - wire.HEADER_BYTES, node=node)
        self._node = Node(node, scenario, make_protocol, position=position)
        self._traffic = Traffic(scenario, node)
        self._autopilot = Autopilot(node, position=position, telemetry_hz=scenario.nodes.telemetry_hz)
        self._fixes = SteadyFix(sigma_m=scenario.world.gps_sigma_m, range_m=scenario.radio.range_m)
        self._mission = Mission(node, scenario.mission, altitude_m=scenario.nodes.altitude_m)
        self._lookout = Lookout(scenario, node) if scenario.mission.collision_horizon_s else None
        self._encoder = mavlink.Encoder(node)
        self._hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        self._hello_random = stream(scenario.seed, "hello", node).random
        self._next_hello_ns: int | None = None
        self._own_wake_ns: int | None = None
        """When traffic, hello or telemetry is due; changes at a wake-up, and when a saturated source's packet ends."""
        self._generated = 0
        self._outstanding: set[int] = set()
        """Transmit requests with which packets of a saturated source began their way."""
        self._malformed = 0
        self._heard_late = 0
        """Receptions that were handed over too late."""
        self._bad_positions = 0
        """Hellos whose position is none, or not of now: of no use to the lookout."""

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        if self._hello_ns:
            self._next_hello_ns = now_ns + self._lead_ns + int(self._hello_random() * self._hello_ns)
        self._node.records = self._mission.records = self.records
        if self._lookout is not None:
            self._lookout.records = self.records
        self._traffic.start(now_ns)
        self._autopilot.start(now_ns)
        self._node.start(now_ns)
        self._settle(now_ns)
        self._own_wake_ns = self._next_own_ns()

    def receive(self, topic: str, message: Message, now_ns: int) -> bool:
        if type(message) is Reception:
            node = self._node
            if now_ns - message.end_ns > self._prompt_ns:
                self._heard_late += 1
            if node.hear(message, now_ns):
                return True  # a copy, and nothing came of it, as of most
            if self._lookout is not None:
                self._look(message.frame, now_ns)
            self._settle(now_ns)
            return node.timeless
        if isinstance(message, TxStatus):
            self._node.status(message, now_ns=now_ns)
            if message.seq in self._outstanding:
                self._outstanding.discard(message.seq)
                if self._traffic.ended(refused=not message.attempts, now_ns=now_ns):
                    self._send_traffic(now_ns, now_ns)
                self._own_wake_ns = self._next_own_ns()
        elif isinstance(message, Gps):
            self._autopilot.fix(message)
            self._node.position, self._node.velocity = self._fixes.position(message), message.velocity
            self._mission.moved(message.position, now_ns=now_ns)
            if self._lookout is not None:
                self._lookout.moved(self._motion(now_ns))
        elif isinstance(message, WifiScan):
            self._mission.scan(message.heard, position=self._autopilot.position, now_ns=now_ns)
        else:
            self._malformed += 1
        self._settle(now_ns)
        return False

    def wake(self, now_ns: int) -> None:
        self._node.wake(now_ns)
        due_ns = self._traffic.next_ns()
        while due_ns is not None and due_ns <= now_ns:
            for _ in range(self._traffic.owed):
                self._send_traffic(due_ns, now_ns)
            self._traffic.advance()
            due_ns = self._traffic.next_ns()
        self._say_hello(now_ns)
        telemetry = self._autopilot.telemetry(now_ns)
        if telemetry:
            self._tap(telemetry, now_ns)
        self._settle(now_ns)
        self._own_wake_ns = self._next_own_ns()

    def next_wake_ns(self) -> int | None:
        own_ns, node_ns = self._own_wake_ns, self._node.next_wake_ns()
        return own_ns if node_ns is None or (own_ns is not None and own_ns < node_ns) else node_ns

    def _next_own_ns(self) -> int | None:
        hello_ns = None if self._next_hello_ns is None else self._next_hello_ns - self._lead_ns
        return earliest(self._traffic.next_ns(), hello_ns, self._autopilot.next_due_ns())

    def know_clock_error(self, error_ns: int) -> None:
        """The greatest error of any clock in the swarm, as far as this node has heard; 0: they are exact."""
        self._node.clock_error_ns = error_ns

    def report(self) -> Mapping[str, Any]:
        own = {
            "kind": "agent",
            "node": self._id,
            "generated": self._generated,
            "bus_malformed": self._malformed,
            "heard_late": self._heard_late,
        }
        if self._lookout is not None:
            own["bad_positions"] = self._bad_positions
        return own | dict(self._node.report())

    # --- the application ------------------------------------------------------------------------------------------

    def _send_traffic(self, born_ns: int, now_ns: int) -> None:
        self._generated += 1
        requests = self._node.frames_sent
        self._node.send(
            self._filler,
            destination=self._destination,
            priority=wire.PRIORITY_BULK,
            app="traffic",
            born_ns=born_ns,
            now_ns=now_ns,
        )
        if self._traffic.saturated and self._node.frames_sent > requests:
            self._outstanding.add(requests)

    def _say_hello(self, now_ns: int) -> None:
        if self._next_hello_ns is None or self._next_hello_ns - self._lead_ns > now_ns:
            return
        self._node.say_hello(
            self._autopilot.beacon_frames(now_ns), start_ns=max(self._next_hello_ns, now_ns), now_ns=now_ns
        )
        vary = 1 + _HELLO_JITTER * (2 * self._hello_random() - 1)
        step_ns = int(self._hello_ns * vary * self._node.hello_share(now_ns))
        self._next_hello_ns = max(self._next_hello_ns + step_ns, now_ns)

    def _deliver(self, packet: Packet, now_ns: int) -> None:
        """Survivor reports are for the mission, and for whoever inspects us."""
        try:
            report = Survivor.decode_frame(packet.frame)
            if report.reporter != packet.header.origin:
                raise MalformedFrameError(f"report of {report.reporter} by {packet.header.origin}")
        except MalformedFrameError:
            self._node.dropped[DropReason.MALFORMED] += 1
            return
        self._mission.reported(report, position=self._autopilot.position, now_ns=now_ns)
        self._tap(packet.frame, now_ns)

    def _motion(self, now_ns: int) -> Motion:
        return Motion(self._autopilot.position, self._autopilot.velocity, now_ns)

    def _look(self, frame: bytes, now_ns: int) -> None:
        """A neighbor's hello says where it flies."""
        assert self._lookout is not None, "only who has a lookout looks"
        if wire.peek_kind(frame) != wire.Kind.HELLO:
            return
        try:
            origin = NodeId(wire.decode_header(frame).origin)
            told = mavlink.kinematics_of(frame)
        except MalformedFrameError:
            self._bad_positions += 1
            return
        if not self._lookout.heard(origin, Motion(told.position, told.velocity, told.t_ms * MS), now_ns=now_ns):
            self._bad_positions += 1

    def _heed(self, packet: Packet, now_ns: int) -> None:
        """A warning of another UAV, for us perhaps."""
        try:
            warning = mavlink.collision_of(packet.frame)
        except MalformedFrameError:
            self._node.dropped[DropReason.MALFORMED] += 1
            return
        if self._lookout is not None:
            born_ns = min(packet.header.origin_us * US, now_ns)
            self._lookout.warned(packet.origin, warning, self._motion(now_ns), born_ns=born_ns, now_ns=now_ns)
        self._tap(packet.frame, now_ns)

    def _tap(self, data: bytes, now_ns: int) -> None:
        self.outbox.append((self._tap_topic, MavlinkTap(now_ns, data)))

    # --- after every input ----------------------------------------------------------------------------------------

    def _settle(self, now_ns: int) -> None:
        """Bring what the parts put out to where it goes, until none has anything more."""
        node, mission = self._node, self._mission
        if node.deliveries:
            for packet in node.deliveries:
                priority = packet.header.priority
                if priority == wire.PRIORITY_REPORT:  # bulk was only to be carried
                    self._deliver(packet, now_ns)
                elif priority == wire.PRIORITY_SAFETY:
                    self._heed(packet, now_ns)
            node.deliveries.clear()
        if mission.reports:
            self._report(now_ns)
        if mission.course is not None:
            course, mission.course = mission.course, None
            if self._lookout is None or self._lookout.steered(course):
                self._steer(course, now_ns)
        if self._lookout is not None:
            self._avoid(self._lookout, now_ns)
        if node.requests:
            outbox, topic = self.outbox, self._tx_topic
            for request in node.requests:
                outbox.append((topic, request))
            node.requests.clear()

    def _steer(self, course: Course, now_ns: int) -> None:
        self.outbox.append((self._setpoint_topic, Setpoint(now_ns, course.position, course.speed_m_s)))

    def _avoid(self, lookout: Lookout, now_ns: int) -> None:
        """Warn, and fly, as the lookout wants it."""
        warnings, lookout.warnings = lookout.warnings, []
        for other, approach in warnings:
            inner = self._encoder.collision(
                other,
                closest_s=approach.closest_s,
                altitude_m=abs(approach.apart.up),
                horizontal_m=math.hypot(approach.apart.east, approach.apart.north),
            )
            seq = self._tell_all(inner, priority=wire.PRIORITY_SAFETY, app="warning", now_ns=now_ns)
            self.records.append(Warned(now_ns, self._id, other, seq))
        if lookout.course is not None:
            course, lookout.course = lookout.course, None
            self._steer(course, now_ns)

    def _report(self, now_ns: int) -> None:
        reports, self._mission.reports = self._mission.reports, []
        for report in reports:
            self._tell_all(report.encode_frame(self._id), priority=wire.PRIORITY_REPORT, app="report", now_ns=now_ns)

    def _tell_all(self, inner: bytes, *, priority: int, app: str, now_ns: int) -> int:
        """Hand the node a packet for everyone; returns its sequence number."""
        return self._node.send(inner, destination=BROADCAST, priority=priority, app=app, born_ns=now_ns, now_ns=now_ns)
