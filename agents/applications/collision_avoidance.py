"""The application that avoids collisions: it floods collision warnings, obeys those of others, and climbs or descends.

Of two UAVs the one with the lower id goes one level up, the other one down, so that a warning need not state a
direction. The UAVs of a planned search avoid each other by their velocities instead (`agents/mission/flight/`). Not
modeled: turns that the other UAV has planned, and conflicts that the change of height causes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from fanet_mw import mavlink, wire
from fanet_mw.application import HOME, Application, AppPort, Course, Received
from fanet_mw.bus.messages import Gps
from fanet_mw.mavlink import Collision
from fanet_mw.motion import Motion
from fanet_mw.node.neighbors import neighbor_lifetime_ns
from fanet_mw.node.reader import motion_in
from fanet_mw.scenario import Scenario
from fanet_mw.trace import ConflictForeseen, ConflictOver, Record, Warned
from fanet_mw.units import MS, Enu, NodeId, S, seconds_to_ns

_CLEAR: Final = 1.5
"""A conflict is over when the two will pass each other sideways at this many times the distance to be kept."""
_PAST_NS: Final = 3 * S
"""If the other UAV is only known by its warning, the conflict is over this long after the closest approach."""
_LONG_NS: Final = 20 * S
"""Two UAVs that have been in conflict for longer than this fly side by side, or stand at the geofence."""
_STANDS_NS: Final = 6 * S
"""A UAV that has stood still so long while it avoids others, pressed against the geofence, flies back; and so much
later for each UAV with a lower id that it avoids."""
_STILL_M_S: Final = 1.5
_BACK_NS: Final = 12 * S
_LEAVES_M_S: Final = 5.0
"""The least speed with which one of them then leaves the other."""
_CLIMB_M_S: Final = 4.0
"""A comfortable climb rate for a small multirotor."""
_LEVELS: Final = 2
"""The greatest number of levels up or down, for which `nodes.altitude_m` must leave room."""
_SURE: Final = 3.0
"""All levels lie higher than `nodes.altitude_m` implies, by so many standard deviations of a measured height."""
_AHEAD_S: Final = 10.0
"""Setpoints lie this far ahead. The farther they are, the less does the error of a fix turn the course."""
_SOON_S: Final = 2.0
"""The time within which a near height or goal is to be reached."""
_LEAST_M_S: Final = 0.5
_EVER_S: Final = 1e6


class ClosestApproach(NamedTuple):
    """The instant at which two bodies are closest to each other, and the vector between them at that instant."""

    closest_s: float
    """The time until then, from now; 0 when they are nearest now."""
    apart: Enu
    """The vector from one body to the other at that time [m]."""

    @property
    def distance_m(self) -> float:
        return self.apart.norm()


def closest(position: Enu, velocity: Enu, *, within_s: float) -> ClosestApproach:
    """The closest approach in [0, `within_s`] of a body whose position and velocity relative to the other are given."""
    speed2 = velocity.east**2 + velocity.north**2 + velocity.up**2
    closing = -(position.east * velocity.east + position.north * velocity.north + position.up * velocity.up)
    at_s = min(max(0.0, closing / speed2), within_s) if speed2 > 0 else 0.0
    return ClosestApproach(at_s, position.plus(velocity, at_s))


class Alert(NamedTuple):
    """A warning for another UAV."""

    other: NodeId
    approach: ClosestApproach


@dataclass
class _Threat:
    """Another UAV that this UAV avoids."""

    since_ns: int
    until_ns: int
    """The instant at which the conflict will be over, if no hello of the other UAV is received any more."""
    warned_ns: int | None = None
    """The instant at which either of the two last warned the other."""


@dataclass
class _Avoidance:
    """The height and velocity at which the UAV flew when it began to avoid others."""

    up_m: float
    velocity: Enu


class ConflictMonitor:
    """Detects the conflicts of one UAV with others, and resolves them."""

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        mission = scenario.mission
        self._node = node
        self._horizon_s = mission.collision_horizon_s
        self._distance_m = mission.collision_distance_m
        self._room_m = _LEVELS * mission.collision_distance_m
        self._floor_m = scenario.nodes.altitude_m - max(0.0, self._room_m - _SURE * _vertical_sigma_m(scenario))
        """The measured height below which it does not descend, however often it begins anew before it is back at its
        height; the true one is then hardly ever two levels below that of the mission."""
        self._clear_m = _CLEAR * mission.collision_distance_m
        self._repeat_ns = seconds_to_ns(mission.collision_repeat_s)
        self._lifetime_ns = neighbor_lifetime_ns(scenario.routing.hello_interval_s)
        self.records: list[Record] = []
        self.warnings: list[Alert] = []
        self.course: Course | None = None
        """A new course to fly, until the caller takes it."""
        self._others: dict[NodeId, Motion] = {}
        self._threats: dict[NodeId, _Threat] = {}
        self._avoidance: _Avoidance | None = None
        self._still_since_ns: int | None = None
        """The instant from which this UAV has stood still while it avoids others."""
        self._back_until_ns = 0
        self._back = Enu(0.0, 0.0, 0.0)
        """Its horizontal velocity meanwhile."""
        self._wanted: Course | None = None
        """The mission's course; None if the UAV flies in formation."""

    # --- input ----------------------------------------------------------------------------------------------------

    def on_hello(self, node: NodeId, motion: Motion, *, now_ns: int) -> bool:
        """A hello states how another UAV flies; returns False if that is too old to be used."""
        if motion.at_ns < now_ns - self._lifetime_ns:
            return False
        self._others[node] = motion
        return True

    def on_warning(self, origin: NodeId, warning: Collision, own: Motion, *, born_ns: int, now_ns: int) -> None:
        """Another UAV has warned; this UAV avoids it if the warning names this UAV."""
        left_ns = born_ns + round(min(warning.closest_s, _EVER_S) * S) - now_ns
        if warning.other != self._node or origin == self._node or left_ns > seconds_to_ns(self._horizon_s):
            return
        if warning.horizontal_m > self._clear_m:
            return
        threat = self._threats.get(origin)
        if threat is None:
            if left_ns <= 0:
                return  # the closest approach was over before the warning arrived
            threat = self._avoid(origin, own, now_ns + left_ns)
            distance_m = math.hypot(warning.altitude_m, warning.horizontal_m)
            self._record_conflict(origin, left_ns, distance_m, told=True, now_ns=now_ns)
        threat.warned_ns = max(born_ns, threat.warned_ns or 0)
        threat.until_ns = max(threat.until_ns, now_ns + left_ns)
        self._fly(own)

    def on_fix(self, own: Motion) -> None:
        """A position fix of this UAV: examine all other UAVs."""
        now_ns = own.at_ns
        self._others = {n: m for n, m in self._others.items() if now_ns - m.at_ns <= self._lifetime_ns}
        for node in sorted(self._others):
            self._examine(node, own)
        for node in sorted(self._threats):
            if self._is_over(node, own):
                del self._threats[node]
                self.records.append(ConflictOver(now_ns, self._node, node))
        self._fly(own)

    def on_course(self, course: Course) -> None:
        self._wanted = None if course.speed_m_s == HOME and course.velocity is None else course

    @property
    def avoids(self) -> bool:
        return self._avoidance is not None

    # --- conflicts ------------------------------------------------------------------------------------------------

    def _examine(self, node: NodeId, own: Motion) -> None:
        """Examine another UAV: if it is in conflict with this one, avoid it, and warn it if a warning is due."""
        now_ns = own.at_ns
        threat = self._threats.get(node)
        approach = min((self._approach(node, course) for course in self._courses(own)), key=lambda a: a.distance_m)
        if threat is not None:  # the change of height may have resolved the conflict already
            if 0 < approach.closest_s < self._horizon_s and approach.distance_m < self._clear_m:
                threat.until_ns = now_ns + round(approach.closest_s * S)
                self._warn(node, threat, approach, now_ns)
        elif approach.closest_s > 0 and approach.distance_m < self._distance_m:
            left_ns = round(approach.closest_s * S)
            threat = self._avoid(node, own, now_ns + left_ns)
            self._record_conflict(node, left_ns, approach.distance_m, told=False, now_ns=now_ns)
            self._warn(node, threat, approach, now_ns)

    def _approach(self, node: NodeId, own: Motion) -> ClosestApproach:
        other = self._others[node]
        apart = other.offset_from(own.position, own.at_ns)
        return closest(apart, other.velocity.minus(own.velocity), within_s=self._horizon_s)

    def _courses(self, own: Motion) -> list[Motion]:
        """The courses to examine: the present one; while avoiding, level flight at the present and former height."""
        if self._avoidance is None:
            return [own]
        level = own._replace(velocity=_level(own.velocity))
        here = own.position
        return [level, level._replace(position=Enu(here.east, here.north, self._avoidance.up_m))]

    def _record_conflict(self, node: NodeId, left_ns: int, distance_m: float, *, told: bool, now_ns: int) -> None:
        record = ConflictForeseen(now_ns, self._node, node, round(left_ns / MS), round(distance_m, 2), told)
        self.records.append(record)

    def _warn(self, node: NodeId, threat: _Threat, approach: ClosestApproach, now_ns: int) -> None:
        """Warn the other UAV, unless one of the two has just warned: both warnings would say the same."""
        if threat.warned_ns is None or now_ns - threat.warned_ns >= self._repeat_ns:
            threat.warned_ns = now_ns
            self.warnings.append(Alert(node, approach))

    def _is_over(self, node: NodeId, own: Motion) -> bool:
        other = self._others.get(node)
        if other is None:
            return own.at_ns > self._threats[node].until_ns + _PAST_NS
        sideways = _level(other.offset_from(own.position, own.at_ns))
        approach = closest(sideways, _level(other.velocity.minus(own.velocity)), within_s=_EVER_S)
        return approach.distance_m > self._clear_m

    # --- avoiding -------------------------------------------------------------------------------------------------

    def _avoid(self, node: NodeId, own: Motion, until_ns: int) -> _Threat:
        if self._avoidance is None:
            self._avoidance = _Avoidance(own.position.up, _level(own.velocity))
        threat = self._threats[node] = _Threat(own.at_ns, until_ns)
        return threat

    def _fly(self, own: Motion) -> None:
        """Choose the next setpoint: onwards at a height that keeps the distance, or back to the course."""
        before = self._avoidance
        if before is None:
            return
        if not self._threats:
            self._avoidance = self._still_since_ns = None
            self.course = self._wanted or Course(own.position, HOME)
            return
        levels = sum(1 if node > self._node else -1 for node in self._threats)
        middle_m = max(before.up_m, self._floor_m + self._room_m)
        level_m = middle_m + max(-_LEVELS, min(_LEVELS, levels)) * self._distance_m
        climb_m_s = max(-_CLIMB_M_S, min(_CLIMB_M_S, (level_m - own.position.up) / _SOON_S))
        sideways = self._leaving(own, before.velocity) or self._sideways(own.position) or before.velocity
        sideways = self._flying_back(own, before.velocity) or sideways
        velocity = sideways._replace(up=climb_m_s)
        ahead = Motion(own.position, velocity, 0).position_at(round(_AHEAD_S * S))
        self.course = Course(ahead, max(_LEAST_M_S, velocity.norm()))

    def _leaving(self, own: Motion, velocity: Enu) -> Enu | None:
        """Towards the middle, if long in conflict with one of lower id, which keeps its velocity; otherwise None."""
        if not any(
            node < self._node and own.at_ns - threat.since_ns > _LONG_NS for node, threat in self._threats.items()
        ):
            return None
        return _to_the_middle(own.position, velocity)

    def _flying_back(self, own: Motion, velocity: Enu) -> Enu | None:
        """Once it stands still without a mission: a direction to the middle; otherwise whoever keeps its velocity would
        stand at the geofence for ever. It is chosen once, because those who all fly to the middle meet there.
        """
        now_ns = own.at_ns
        if now_ns < self._back_until_ns:
            return self._back
        if self._wanted is not None or own.velocity.horizontal() > _STILL_M_S:
            self._still_since_ns = None
            return None
        if self._still_since_ns is None:
            self._still_since_ns = now_ns
        rank = 1 + sum(node < self._node for node in self._threats)
        if now_ns - self._still_since_ns <= rank * _STANDS_NS:
            return None
        self._still_since_ns, self._back_until_ns = None, now_ns + _BACK_NS
        self._back = _to_the_middle(own.position, velocity)
        return self._back

    def _sideways(self, here: Enu) -> Enu | None:
        """The horizontal velocity towards the mission's goal; None if there is no goal."""
        if self._wanted is None:
            return None
        way = _level(self._wanted.position.minus(here))
        speed_m_s = min(self._wanted.speed_m_s, way.norm() / _SOON_S)
        scale = speed_m_s / max(way.norm(), 1e-9)
        return Enu(way.east * scale, way.north * scale, 0.0)


def _vertical_sigma_m(scenario: Scenario) -> float:
    sensors = scenario.sensors
    return sensors.gps_vertical * math.hypot(sensors.gps_common_m, sensors.gps_bias_m, scenario.world.gps_sigma_m)


def _level(vector: Enu) -> Enu:
    return Enu(vector.east, vector.north, 0.0)


def _to_the_middle(here: Enu, velocity: Enu) -> Enu:
    way = _level(here)
    scale = -max(_LEAVES_M_S, velocity.norm()) / max(way.norm(), 1e-9)
    return Enu(way.east * scale, way.north * scale, 0.0)


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
