"""The application of formation flight by clusters: it collects received positions, and flies the UAV to its place."""

from typing import Final

from agents.mission.courses import course_at
from agents.mission.flight.approach_speed import approach_speed_m_s
from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.formation_flight.flight_place import FlightPlace
from agents.mission.formation_flight.route import Route
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw import mavlink
from fanet_mw.application import Application, AppPort, Received
from fanet_mw.bus.messages import Altimeter, Gps, SensorReading
from fanet_mw.node.reader import motion_in
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire import PRIORITY_REPORT

_TELL_NS: Final = S
"""How often a head floods its position and velocity, for heads that do not receive its hellos."""
_ALONE_M: Final = 12.0
"""A UAV that receives nobody hovers this much higher: others may not know any more where it is, and fly below it."""


class FormationFlight(Application):
    """The formation flight of one UAV."""

    name: Final = "formation"
    listens = (mavlink.GLOBAL_POSITION_ID,)

    def __init__(self, scenario: Scenario, node: NodeId, *, position: Enu, onboard_map: OnboardMap = NO_MAP) -> None:
        """`onboard_map`: the map that the UAV carries."""
        obstacles = KnownObstacles(onboard_map, scenario.world.no_fly_m)
        self._own_motion = own_motion = OwnMotion(position, obstacles)
        self._motions = motions = NeighborMotions(hello_interval_s=scenario.routing.hello_interval_s)
        self._height_m = scenario.nodes.altitude_m
        self._velocity_choice = VelocityChoice(
            own_motion,
            obstacles,
            most_m_s=approach_speed_m_s(scenario, node),
            hard=[ReciprocalAvoidance(own_motion, motions, obstacles)],
            soft=[],
        )
        route = Route(scenario.mission.route_m, speed_m_s=scenario.mobility.speed_m_s)
        self._place = FlightPlace(
            node, motions, route, radius_m=scenario.mission.formation_m, clusters=lambda: self.port.clusters()
        )
        self._begins_ns = seconds_to_ns(scenario.warmup_s)
        self._origin = mavlink.Geodetic(*scenario.world.origin_deg, 0.0)
        self._encoder = mavlink.Encoder(node, origin=self._origin)
        self._next_ns: int | None = None
        self._bad_positions = 0

    def start(self, port: AppPort, now_ns: int) -> None:
        super().start(port, now_ns)
        self._next_ns = now_ns + round(port.stream("formation").random() * _TELL_NS)

    # --- received messages ----------------------------------------------------------------------------------------

    def on_message(self, message: Received, now_ns: int) -> None:
        self._on_motion(message.frame, now_ns)
        self.port.tap(message.frame)

    def on_hello(self, frame: bytes, now_ns: int) -> None:
        self._on_motion(frame, now_ns)

    def _on_motion(self, frame: bytes, now_ns: int) -> None:
        heard = motion_in(frame, own=self.port.node, now_ns=now_ns, place=self._origin)
        if heard is None:
            self._bad_positions += 1
            return
        node, motion = heard
        known = self._motions.motion(node, now_ns=now_ns)
        if known is None or known.at_ns < motion.at_ns:  # a flood may be older than the last hello
            self._motions.on_hello(node, motion)

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, Altimeter):
            self._own_motion.altimeter(reading.above_ground_m, now_ns=now_ns)

    # --- flight ---------------------------------------------------------------------------------------------------

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        """Fly to the place in the formation, clear of all others; hover until formation flight begins."""
        self._own_motion.fix(fix.position, fix.velocity, now_ns=now_ns)
        if now_ns < self._begins_ns:
            return
        place, moves = self._place.at(self._own_motion.position, now_ns)
        height_m = self._height_m if self._motions.all(now_ns=now_ns) else self._height_m + _ALONE_M
        velocity = self._velocity_choice.velocity(place._replace(up=height_m), moves, now_ns)
        self.port.fly(course_at(self.port.position, velocity))

    def wake(self, now_ns: int) -> None:
        self._next_ns = now_ns + _TELL_NS
        if self._place.is_head:
            here, port = self._own_motion.position, self.port
            frames = self._encoder.global_position(here, port.velocity, yaw=None, now_ns=now_ns)
            port.send(frames, priority=PRIORITY_REPORT)

    def next_wake_ns(self) -> int | None:
        return self._next_ns

    def report(self) -> dict[str, int]:
        return {"bad_positions": self._bad_positions}
