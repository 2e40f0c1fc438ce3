"""The world as an actor: setpoints in, poses and sensor readings out, once per tick.

t = 0            poses and fixes, so that links stand before anyone transmits
every tick       guidance -> engine -> obstructions, when anything can obstruct -> poses -> sensors that are due
"""

from array import array
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Gps, Message, Poses, Setpoint, WifiScan
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.rng import stream_seed
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided
from fanet_mw.units import Enu, S, seconds_to_ns
from sim.world.engine import Engine
from sim.world.flight import Flight
from sim.world.guidance import Guidance
from sim.world.kinematic import Kinematic
from sim.world.layout import positions
from sim.world.obstacles import Obstacles, obstacles
from sim.world.separation import Separation
from sim.world.survivors import PhoneSensor

if TYPE_CHECKING:
    from sim.world.sight import Sight

_STILL_NS: Final = S
"""How often a world in which nothing moves says so."""
_CONTROL_S: Final = 0.05
"""Guidance runs at least this often within a tick."""


def make_engine(scenario: Scenario, solid: Obstacles | None = None) -> Engine:
    """The engine that the scenario names, with what stands in its world."""
    if scenario.world.engine == "kinematic":
        return Kinematic()
    from sim.world.physics import Physics

    return Physics(physics_hz=scenario.world.physics_hz, obstacles=solid)


def _sight(scenario: Scenario, engine: Engine, solid: Obstacles) -> "Sight":
    """Imported when wanted: it brings the emulator's geometry, and numba with it."""
    from sim.world.sight import Sight

    return Sight(scenario, engine, top_m=solid.top_m)


class World(Actor):
    """Bodies, survivors and sensors of one swarm."""

    def __init__(self, scenario: Scenario, swarm: str, *, flight: Flight | None = None) -> None:
        """`flight`: how the swarm was flying when the world before this one ended; None: it starts."""
        topics = Topics(swarm)
        super().__init__("world", (topics.all_setpoints,))
        self._scenario = scenario
        self._count = scenario.nodes.count
        self._pose_topic = topics.pose
        self._obstruction_topic = topics.obstruction
        self._gps_topics = [topics.sensor(node, "gps") for node in scenario.node_ids]
        self._wifi_topics = [topics.sensor(node, "wifi") for node in scenario.node_ids]
        self._ids = array("H", scenario.node_ids)
        starts = np.array(positions(scenario), dtype=np.float64)
        solid = obstacles(scenario, starts) if scenario.world.has_obstacles else None
        self._engine = make_engine(scenario, solid)
        if flight is None:
            self._engine.reset(starts)
        else:
            self._engine.reset(flight.positions, flight.velocities)
        self._sight = _sight(scenario, self._engine, solid) if solid else None
        self._guidance = Guidance(starts, scenario)
        for node, sent in sorted(flight.setpoints.items()) if flight else ():
            self._guidance.steer(node, sent.position, speed_m_s=sent.speed_m_s)
        self._phones = PhoneSensor(scenario)
        self._noise = np.random.Generator(np.random.PCG64(stream_seed(scenario.seed, "gps")))
        self._fixes = (
            scenario.nodes.telemetry_hz > 0
            or scenario.clock.sync == "gps"
            or scenario.mission.collision_horizon_s > 0
            or _routed_by_places(scenario)
        )
        """Whether anybody uses position fixes."""
        self._gps_ns = round(S / scenario.world.gps_hz)
        self._scan_ns = seconds_to_ns(scenario.mission.scan_interval_s)
        self._tick_ns: int | None = None
        self._last_ns = 0
        self._ticks = 0
        self._skipped = 0
        """Ticks that came too late for anybody to use them."""
        self._collisions = 0
        self._separation = (
            Separation(scenario.mission.collision_distance_m) if scenario.mission.collision_distance_m else None
        )
        self._malformed = 0

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._last_ns = now_ns
        self._publish(now_ns, now_ns - 1)
        self._tick_ns = now_ns + self._period_ns

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        node = node_of(topic)
        if (
            not isinstance(message, Setpoint)
            or not 1 <= node <= self._count
            or not np.isfinite([*message.position, message.speed_m_s]).all()
        ):
            self._malformed += 1
        else:
            if self._guidance.still:  # time stood still until now
                self._last_ns = max(self._last_ns, now_ns - self._scenario.world.tick_ns)
                self._tick_ns = now_ns + self._scenario.world.tick_ns
            self._guidance.steer(node, message.position, speed_m_s=message.speed_m_s)

    def wake(self, now_ns: int) -> None:
        if self._tick_ns is None or now_ns < self._tick_ns:
            return
        due_ns, before_ns = self._tick_ns, self._last_ns
        if not self._guidance.still:
            self._move(due_ns)
        self._last_ns = due_ns
        self._publish(due_ns, before_ns)
        self._ticks += 1
        self._tick_ns = due_ns + self._period_ns
        behind = (now_ns - self._tick_ns) // self._period_ns
        if behind > 0:  # a stalled host: skip instants nobody can use any more, keep the phase
            self._tick_ns += behind * self._period_ns
            self._skipped += behind

    def next_wake_ns(self) -> int | None:
        return self._tick_ns

    def stop(self, now_ns: int) -> None:
        self._engine.close()

    def report(self) -> Mapping[str, Any]:
        return {
            "kind": "world",
            "engine": self._engine.name,
            "ticks": self._ticks,
            "skipped_ticks": self._skipped,
            "collisions": self._collisions,
            "separation": {} if self._separation is None else self._separation.report(),
            "malformed": self._malformed,
        }

    # --- one tick -------------------------------------------------------------------------------------------------

    @property
    def _period_ns(self) -> int:
        tick_ns = self._scenario.world.tick_ns
        return max(tick_ns, _STILL_NS) if self._guidance.still else tick_ns

    def _move(self, now_ns: int) -> None:
        engine = self._engine
        elapsed_s = (now_ns - self._last_ns) / S
        steps = max(1, round(elapsed_s / _CONTROL_S))
        for step in range(steps):
            t_s = self._last_ns / S + step * elapsed_s / steps
            before = engine.positions().copy()
            engine.advance(elapsed_s / steps, self._guidance.wanted(t_s, before, engine.velocities()))
            if self._separation is not None:
                self._separation.watch(before, engine.positions())
        for first, second in engine.contacts():
            self._collisions += 1
            self.records.append(Collided(now_ns, second, first))

    def _publish(self, now_ns: int, before_ns: int) -> None:
        """Poses, and the sensors whose instant lies in (before, now]."""
        at, velocity = self._engine.positions(), self._engine.velocities()
        if self._sight is not None:  # before the poses, which bring it into force
            self.outbox.append((self._obstruction_topic, self._sight.obstructions(at, now_ns)))
        states = array("d", np.hstack([at, velocity]).astype(np.float64).tobytes())
        self.outbox.append((self._pose_topic, Poses(now_ns, self._ids, states)))
        if self._fixes and _due(now_ns, before_ns, self._gps_ns, 0):
            noisy = at + self._noise.normal(0.0, self._scenario.world.gps_sigma_m, at.shape)
            for row in range(self._count):
                fix = Gps(now_ns, Enu(*noisy[row].tolist()), Enu(*velocity[row].tolist()))
                self.outbox.append((self._gps_topics[row], fix))
        if self._scenario.mission.survivors:
            for row in range(self._count):
                if _due(now_ns, before_ns, self._scan_ns, row * self._scan_ns // self._count):
                    heard = self._phones.scan(at[row])
                    if heard:
                        self.outbox.append((self._wifi_topics[row], WifiScan(now_ns, heard)))


def _due(now_ns: int, before_ns: int, period_ns: int, phase_ns: int) -> bool:
    """Whether an instant of a period (shifted by a phase) lies in (before, now]."""
    return (now_ns - phase_ns) // period_ns > (before_ns - phase_ns) // period_ns


def _routed_by_places(scenario: Scenario) -> bool:
    """Whether the protocol needs to know where its node has gone."""
    moves = scenario.mobility.model != "static" or scenario.mission.survivors > 0
    return scenario.routing.protocol == "geographic" or (scenario.routing.protocol == "clustered" and moves)
