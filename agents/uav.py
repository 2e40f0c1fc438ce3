"""The UAV as an actor: connects the node of one id and the applications on board with the topics of the bus.

Inputs: receptions, transmit statuses, sensor readings. Outputs: transmit requests, setpoints, MAVLink taps.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from agents.applications.collision_avoidance import CollisionAvoidance
from agents.applications.telemetry_streams import Telemetry, TelemetryStreams
from agents.applications.traffic import Load
from agents.ground.operator_relay import OperatorRelay
from agents.ground.post import Post
from agents.ground_control.application import GroundControl
from agents.hello_schedule import HelloSchedule, HelloTime
from agents.mission.applications import PlannedSearch, Rescue
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.formation_flight.application import FormationFlight
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.onboard import Onboard
from agents.positioning import DeadReckoning, SteadyFix
from fanet_mw.actor import Actor
from fanet_mw.application import Application, Course
from fanet_mw.bus.messages import (
    Gps,
    Inertial,
    MavlinkTap,
    Message,
    Reception,
    SensorReading,
    Setpoint,
    SetpointKind,
    TxStatus,
)
from fanet_mw.bus.topics import Topics
from fanet_mw.extensions import make
from fanet_mw.geodesy import Geodetic
from fanet_mw.motion import Motion
from fanet_mw.node.node import Node
from fanet_mw.node.reader import Reader
from fanet_mw.orders import Order
from fanet_mw.routing import make_protocol
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, earliest, seconds_to_ns
from fanet_mw.wire import HEADER_BYTES

_REPEATS: Final = 3
"""How often a setpoint is repeated within the time after which a silent computer counts as dead."""


class Setpoints:
    """Makes setpoints and repeats the last one, so that the flight controller knows the computer alive; but a velocity
    only once.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._repeat_ns = seconds_to_ns(scenario.mobility.return_after_s) // _REPEATS
        """The age at which the last setpoint is repeated; 0: never."""
        self._last: Setpoint | None = None

    def of(self, course: Course, now_ns: int) -> Setpoint:
        setpoint = Setpoint(now_ns, course.position, course.speed_m_s)
        if course.velocity is not None:
            setpoint = setpoint._replace(kind=SetpointKind.VELOCITY, velocity=course.velocity)
        elif course.land:
            setpoint = setpoint._replace(kind=SetpointKind.LAND)
        elif course.take_off:
            setpoint = setpoint._replace(kind=SetpointKind.TAKEOFF)
        elif course.go_home:
            setpoint = setpoint._replace(kind=SetpointKind.RETURN)
        self._last = setpoint
        return setpoint

    def repeated(self, now_ns: int) -> Setpoint | None:
        """The last setpoint once more, if it is time for that."""
        last = self._last
        if not self._repeat_ns or last is None or last.kind is SetpointKind.VELOCITY:
            return None
        if now_ns - last.t_ns < self._repeat_ns:
            return None
        self._last = last._replace(t_ns=now_ns)
        return self._last


class NodeState(NamedTuple):
    """The state of the network, as a node knows it."""

    neighbors: tuple[NodeId, ...]
    bound_ns: int | None
    clusters: Mapping[NodeId, tuple[NodeId, ...]]
    """The nodes of each cluster by its head, the head first, as far as the node knows."""
    owing: bool
    """True while receipts, or packets of this node, have not been let out."""


class Uav(Actor):
    """The actor that consists of the node and the applications of one UAV."""

    def __init__(
        self,
        scenario: Scenario,
        node: NodeId,
        swarm: str,
        *,
        position: Enu,
        applications: Sequence[Application] = (),
        onboard_map: OnboardMap = NO_MAP,
        hello_time: HelloTime | None = None,
        reader: Reader | None = None,
    ) -> None:
        """`applications`: the user's. `hello_time`: adds time beacons. `reader`: shared by all nodes of a run."""
        topics = Topics(swarm)
        self._post = Post(scenario, node) if node == scenario.post else None
        ordered = () if self._post is None else (topics.orders,)
        heard = (topics.radio_rx(node), topics.sensors(node), topics.operator(node), *ordered)
        super().__init__(f"agent-{node}", heard)
        self.slack_ns = min(scenario.radio.handover_ns, scenario.radio.lead_ns // 2)  # the rest is for the bus
        self.patient = (topics.sensors(node),)
        self._tx_topic = topics.radio_tx(node)
        self._setpoint_topic = topics.setpoint(node)
        self._tap_topic = topics.mavlink(node)
        self._prompt_ns = scenario.radio.handover_ns + scenario.radio.lead_ns
        """The greatest delay of a reception whose relay can still be announced one lead ahead."""
        self._node = Node(node, scenario, make_protocol, position=position, reader=reader)
        self._streams = TelemetryStreams(
            node,
            position=position,
            telemetry_hz=scenario.nodes.telemetry_hz,
            origin=Geodetic(*scenario.world.origin_deg, 0.0),
        )
        self._reckoning = DeadReckoning()
        self._delay_ns = seconds_to_ns(scenario.sensors.gps_delay_s)
        self._fixes = SteadyFix(sigma_m=scenario.world.gps_sigma_m, range_m=scenario.radio.range_m)
        self._ground_control: GroundControl | None = None
        asked_for: Sequence[Application]
        if self._post is None:
            limits = SearchLimits(scenario)
            self._ground_control = GroundControl(
                scenario, node, self._streams, position=position, on_mission_key=limits.change
            )
            asked_for = [
                *_asked_for(scenario, node, self._streams, position, onboard_map, limits, self._node),
                self._ground_control,
            ]
        else:
            asked_for = [*_loads(scenario, node), self._post, OperatorRelay(scenario)]
        self._built_in = tuple(application.name for application in asked_for)
        """The applications whose counters are among those of the UAV itself in its report."""
        carried = (*_foreign(scenario, node), *applications)
        self._own = tuple(application.name for application in carried)
        self._onboard = Onboard(
            self._node,
            lambda: (self._streams.position, self._streams.velocity),
            [*asked_for, *carried],
            fly=self._steer,
            tap=self._tap,
        )
        self._setpoints = Setpoints(scenario)
        self._hellos = HelloSchedule(scenario, self._node, hello_time)
        self._hello_room = scenario.radio.max_frame_bytes - HEADER_BYTES
        self._own_wake_ns: int | None = None
        """The instant at which an application or a hello is due; it may change whenever an application is called."""
        self._malformed = 0
        self._heard_late = 0
        """The number of receptions that arrived too late."""

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._hellos.start(now_ns)
        self._node.records = self.records
        self._onboard.start(now_ns)
        self._node.start(now_ns)
        self._settle(now_ns)
        self._own_wake_ns = self._next_own_ns()

    def receive(self, topic: str, message: Message, now_ns: int) -> bool:
        if type(message) is Reception:
            node = self._node
            if now_ns - message.end_ns > self._prompt_ns:
                self._heard_late += 1
            if node.hear(message, now_ns):
                return True  # a copy that changes nothing, as most receptions are
            if node.hellos:
                if self._ground_control is not None:
                    self._ground_control.on_link(message.rssi_dbm, node.dropped.total(), now_ns)
                self._on_hellos(now_ns)
            return not self._settle(now_ns) and node.timeless
        if isinstance(message, TxStatus):
            self._node.on_status(message, now_ns=now_ns)
        elif isinstance(message, Gps):
            fix = message._replace(position=Motion(message.position, message.velocity, 0).position_at(self._delay_ns))
            self._reckoning.fix(fix)
            self._fix(fix, now_ns)
        elif isinstance(message, SensorReading):
            reckoned = self._reckoning.velocity(message) if isinstance(message, Inertial) else None
            if reckoned is not None:
                self._fix(reckoned, now_ns)
            self._onboard.sensor(message, now_ns)
        elif isinstance(message, Order) and self._post is not None:
            self._post.asked.append(message)
            self._onboard.wake(now_ns)
        elif isinstance(message, MavlinkTap):
            self._onboard.operator(message.data, now_ns)
        else:
            self._malformed += 1
        self._settle(now_ns)
        return False

    def _fix(self, fix: Gps, now_ns: int) -> None:
        self._streams.fix(fix)
        self._node.moved(self._fixes.position(fix), fix.velocity)
        self._onboard.fix(fix, now_ns)
        again = self._setpoints.repeated(now_ns)
        if again is not None:
            self.outbox.append((self._setpoint_topic, again))

    def wake(self, now_ns: int) -> None:
        self._node.wake(now_ns)
        if self._own_wake_ns is not None and self._own_wake_ns <= now_ns:
            self._onboard.wake(now_ns)
            self._say_hello(now_ns)
        self._settle(now_ns)

    def nudge(self, now_ns: int) -> None:
        self._onboard.wake(now_ns)
        self._settle(now_ns)

    def stop(self, now_ns: int) -> None:
        """Hand over what a part has transmitted in the call in which it raised: it is counted as sent."""
        self._hand_requests()

    def next_wake_ns(self) -> int | None:
        own_ns, node_ns = self._own_wake_ns, self._node.next_wake_ns()
        return own_ns if node_ns is None or (own_ns is not None and own_ns < node_ns) else node_ns

    def due(self, now_ns: int) -> list[str]:
        node_ns = self._node.next_wake_ns()
        protocol = self._node.scenario.routing.said
        return [*self._onboard.due(now_ns), *([protocol] if node_ns is not None and node_ns <= now_ns else [])]

    def state(self, now_ns: int) -> NodeState:
        owing = self._onboard.owes_receipts or self._node.holds_own
        return NodeState(self._hellos.neighbors(now_ns), self._node.bound_ns(), self._node.clusters(), owing)

    def know_clock_error(self, error_ns: int) -> None:
        """The greatest error of any clock in the swarm, as far as this node knows; 0 if all clocks are exact."""
        self._node.know_clock_error(error_ns)

    def report(self) -> Mapping[str, Any]:
        own: dict[str, Any] = {
            "kind": "agent",
            "node": self._node.node,
            "generated": 0,
            "bus_malformed": self._malformed,
            "heard_late": self._heard_late,
        }
        for counters in self._onboard.report(self._built_in).values():
            for name, count in counters.items():
                own[name] = own.get(name, 0) + count
        if messages := self._onboard.messages():
            own["messages"] = messages
        if self._own:
            own["applications"] = self._onboard.report(self._own)
        return own | dict(self._node.report())

    # --- hellos ---------------------------------------------------------------------------------------------------

    def _on_hellos(self, now_ns: int) -> None:
        hellos, self._node.hellos = self._node.hellos, []
        for hello in hellos:
            self._hellos.on_hello(hello.origin, now_ns)
            if self._onboard.hears_hellos:
                self._onboard.on_hello(hello.frame, now_ns)

    def _say_hello(self, now_ns: int) -> None:
        due_ns = self._hellos.due_ns()
        if due_ns is not None and due_ns <= now_ns:
            beacon = self._streams.beacon_frames(now_ns)
            self._hellos.say(beacon + self._onboard.hello_frames(self._hello_room - len(beacon), now_ns), now_ns)

    # --- after every input ----------------------------------------------------------------------------------------

    def _settle(self, now_ns: int) -> bool:
        node, onboard = self._node, self._onboard
        if node.deliveries:
            deliveries, node.deliveries = node.deliveries, []
            for packet in deliveries:
                onboard.deliver(packet, now_ns)
        called = onboard.called
        if called or node.watch.news:
            called = True
            onboard.settle(now_ns)
            onboard.called = False
            self._own_wake_ns = self._next_own_ns()
        if node.requests:
            self._hand_requests()
        return called

    def _hand_requests(self) -> None:
        outbox, topic, requests = self.outbox, self._tx_topic, self._node.requests
        for request in requests:  # mostly there is one
            outbox.append((topic, request))
        requests.clear()

    def _next_own_ns(self) -> int | None:
        return earliest(self._onboard.next_wake_ns(), self._hellos.due_ns())

    def _steer(self, course: Course, now_ns: int) -> None:
        self.outbox.append((self._setpoint_topic, self._setpoints.of(course, now_ns)))

    def _tap(self, frames: bytes, now_ns: int) -> None:
        self.outbox.append((self._tap_topic, MavlinkTap(now_ns, frames)))


def _asked_for(
    scenario: Scenario,
    node: NodeId,
    streams: TelemetryStreams,
    position: Enu,
    onboard_map: OnboardMap,
    limits: SearchLimits,
    radio: Node,
) -> Sequence[Application]:
    mission = scenario.mission
    applications: list[Application]
    rescue = (
        PlannedSearch(scenario, node, position=position, onboard_map=onboard_map, limits=limits, radio=radio)
        if mission.search != "none"
        else Rescue(scenario, node)
    )
    applications = [Telemetry(streams), *_loads(scenario, node), rescue]
    if mission.formation != "none":
        applications.append(FormationFlight(scenario, node, position=position, onboard_map=onboard_map))
    if mission.collision_horizon_s:
        applications.append(CollisionAvoidance(scenario, node))
    return applications


def _loads(scenario: Scenario, node: NodeId) -> Sequence[Application]:
    return [Load(scenario, node, name) for name in scenario.traffic_classes]


def _foreign(scenario: Scenario, node: NodeId) -> Sequence[Application]:
    """The applications of other packages that a scenario asks for."""
    entries = [entry for entry in scenario.applications if entry.on(node)]
    return [make("applications.use", entry.use, scenario, node, entry.options) for entry in entries]
