"""The world as an actor: setpoints in, poses and sensor readings out, once per tick.

t = 0            poses and fixes, so that links exist before any node transmits
every tick       guidance -> engine -> obstructions, if there are obstacles -> poses -> sensors that are due
"""

from array import array
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Poses, Setpoint
from fanet_mw.bus.radio_control import Control, Cut, MishapKind, Restore
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.rng import stream_seed
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, Posed
from fanet_mw.units import NodeId, S
from sim.world.arrays import Rows
from sim.world.engines.battery_drain import BatteryDrain
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import VEHICLES
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Obstacles, obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.environment.wind import Wind
from sim.world.flight_recorder import SwarmFlight
from sim.world.incidents import Incidents, Mishaps
from sim.world.mobility.guidance import Guidance, makes_sense
from sim.world.sensors.contract import Truth
from sim.world.sensors.gps import GpsReceiver
from sim.world.sensors.position_estimate import PositionEstimate
from sim.world.sensors.suite import Suite, sensors_of

if TYPE_CHECKING:
    from sim.world.environment.line_of_sight import Sight

_TRACED_NS: Final = S
"""The interval at which positions go into the trace."""
_STILL_NS: Final = S
"""The longest interval at which a world in which nothing moves publishes its poses and fixes."""
_LEGS_M: Final = 1.0
"""A UAV that is higher above the ground or a roof than this, and touches something, has not landed: it is at a wall."""
_WRECK_M: Final = 0.5
"""A UAV that is nearer to the ground or a wall than this is not in flight."""
_EMERGENCY_CHARGE: Final = 0.05
"""The share of its charge at which a flight controller lands where it is (PX4's BAT_EMERGEN_THR)."""
_LEVEL_S: Final = 7.0
"""The time in which the drag of its rotors takes a level Iris along with the air: mass / (4 rotors x drag coefficient x
rotor speed).
"""
_CONTROL_S: Final = 0.05
"""The longest step of the guidance within a tick."""


class Ticks:
    """The instants, one period apart, at which the world moves bodies; a late host does not shift later ticks."""

    def __init__(self) -> None:
        self.next_ns: int | None = None
        """The instant of the next tick; None before the start."""
        self.last_ns = 0
        """The instant up to which bodies have been moved; the caller sets it after each tick."""
        self.count = 0
        """The number of ticks that took place."""
        self.skipped = 0
        """The number of ticks that were left out, because a later one was due when the host woke the world."""

    def begin(self, now_ns: int, *, period_ns: int) -> None:
        self.last_ns = now_ns
        self.next_ns = now_ns + period_ns

    def resume(self, now_ns: int, *, tick_ns: int) -> None:
        """Continue after a time in which nothing moved: the next tick is `tick_ns` ahead, and moves bodies for at most
        two.
        """
        self.last_ns = max(self.last_ns, now_ns - tick_ns)
        self.next_ns = now_ns + tick_ns

    def follow(self, due_ns: int, now_ns: int, *, period_ns: int) -> None:
        """Plan the tick after the one at `due_ns`; of several that are due all but the latest are skipped."""
        self.count += 1
        self.next_ns = due_ns + period_ns
        behind = (now_ns - self.next_ns) // period_ns
        if behind > 0:
            self.next_ns += behind * period_ns
            self.skipped += behind


def make_engine(scenario: Scenario, solid: Obstacles | None = None) -> Engine:
    """The engine that the scenario names, with the obstacles of its world."""
    world = scenario.world
    if world.engine == "kinematic":
        return Kinematic(Solids(solid), radius_m=VEHICLES[world.vehicle].reach_m)
    if world.engine == "rotors":
        random = np.random.Generator(np.random.PCG64(stream_seed(scenario.seed, "wind")))
        wind = Wind(random, scenario.nodes.count, mean_m_s=world.wind_m_s, w20_m_s=world.gusts_m_s)
        return Rotors(VEHICLES[world.vehicle], wind=wind, solids=Solids(solid))
    from sim.world.engines.pybullet import Physics

    return Physics(physics_hz=world.physics_hz, obstacles=solid)


def _sight(scenario: Scenario, solids: Solids) -> "Sight":
    """Imported only when needed, because it brings the emulator's geometry, and numba with it."""
    from sim.world.environment.line_of_sight import Sight

    return Sight(scenario, solids)


def _crash_label(node: int) -> str:
    """The label of the fault by which a crash ends a radio."""
    return f"crash-{node}"


class WorldActor(Actor):
    """The bodies, survivors and sensors of one swarm."""

    def __init__(self, scenario: Scenario, swarm: str, *, flight: SwarmFlight | None = None) -> None:
        """`flight`: the state in which an earlier world has ended; None if this is the first."""
        topics = Topics(swarm)
        super().__init__("world", (topics.all_setpoints, topics.radio_control))
        self._scenario = scenario
        self._topics = topics
        self._ids = array("H", scenario.uav_ids)
        self._all_ids = array("H", scenario.node_ids)
        places = np.array(positions(scenario), dtype=np.float64)
        starts, self._on_ground = np.split(places, [len(self._ids)])
        solid = obstacles(scenario, places) if scenario.world.has_obstacles else None
        solids = Solids(solid)
        self._surface_m, self._gap_m = solids.surface_m, solids.gap_m
        self._engine = make_engine(scenario, solid)
        if flight is None:
            self._engine.reset(starts)
        else:
            self._engine.reset(flight.positions, flight.velocities)
        self._sight = _sight(scenario, solids) if solid else None
        self._guidance = Guidance(starts, scenario, surface_m=solids.surface_m)
        for node, sent in sorted(flight.setpoints.items()) if flight else ():
            self._guidance.obey(node, sent, at=self._engine.positions()[node - 1], t_s=sent.t_ns / S)
        charges = {} if flight is None else flight.charges
        self._drain = BatteryDrain(scenario, charges) if scenario.drains_batteries else None
        survivors = Survivors(scenario, solids.ground_m)
        self._mishaps = Mishaps(scenario)
        gps = GpsReceiver(scenario, self._mishaps)
        self._suite = Suite(
            scenario, sensors_of(scenario, survivors, solids, self._drain, solid, gps, self._engine), topics
        )
        self._estimate = PositionEstimate(scenario, gps) if scenario.world.navigation == "estimated" else None
        self._adrift = np.zeros(len(self._ids), bool)
        """The UAVs that sink without knowing their places and velocities."""
        self._flies = np.ones(len(self._ids), bool)
        self._falling: set[int] = set()
        """The UAVs that fall by a fault, and whose sensors and radio work until they hit something."""
        self._radio_died: set[int] = set()
        """The UAVs whose radio a crash has ended, for good."""
        if flight is not None and scenario.world.crash == "falls":
            self._find_wrecks(solids)
        self._ticks = Ticks()
        self._incidents = Incidents(scenario, starts)
        self._traces = scenario.mobility.model != "static" or scenario.mission.survivors > 0
        """Whether positions go into the trace: not before anybody moves."""
        self._malformed = 0

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self._publish(now_ns, now_ns - 1)
        self._ticks.begin(now_ns, period_ns=self._period_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if topic == self._topics.radio_control:
            if isinstance(message, Control):
                self._mishaps.add(message, now_ns)
            if isinstance(message, Restore):
                for node in sorted(self._radio_died):
                    if message.label in ("", _crash_label(node)):
                        self._cut(node)
            return
        node = node_of(topic)
        if not isinstance(message, Setpoint) or not 1 <= node <= len(self._ids) or not makes_sense(message):
            self._malformed += 1
        else:
            if self._still:
                self._ticks.resume(now_ns, tick_ns=self._scenario.world.tick_ns)
            here = self._engine.positions()[node - 1]
            if self._estimate is not None:
                if not self._guidance.flown:
                    self._estimate.advance(self._truth(now_ns))
                here = here + self._estimate.off_m[node - 1]
            self._guidance.obey(node, message, at=here, t_s=now_ns / S)

    def wake(self, now_ns: int) -> None:
        due_ns, before_ns = self._ticks.next_ns, self._ticks.last_ns
        if due_ns is None or now_ns < due_ns:
            return
        self._suffer(due_ns)
        if not self._still or self._falling:
            self._move(before_ns, due_ns)
        else:
            self._record_modes(due_ns)
        self._ticks.last_ns = due_ns
        self._publish(due_ns, before_ns)
        self._ticks.follow(due_ns, now_ns, period_ns=self._period_ns)

    def next_wake_ns(self) -> int | None:
        return self._ticks.next_ns

    def stop(self, now_ns: int) -> None:
        self._engine.close()
        self._suite.close()

    def report(self) -> Mapping[str, Any]:
        return {
            "kind": "world",
            "engine": self._engine.name,
            "ticks": self._ticks.count,
            "skipped_ticks": self._ticks.skipped,
            "collisions": self._incidents.collisions,
            "crashed": int((~self._flies).sum()),
            "no_fly_entries": self._incidents.no_fly.entries,
            "least_charge": None if self._drain is None else round(float(self._drain.batteries.charge.min()), 4),
            "separation": self._incidents.separation.report(),
            "malformed": self._malformed,
        }

    # --- one tick -------------------------------------------------------------------------------------------------

    @property
    def _still(self) -> bool:
        """True while nothing changes: batteries drain in hover, too."""
        return self._guidance.still and self._drain is None

    @property
    def _period_ns(self) -> int:
        tick_ns = self._scenario.world.tick_ns
        return max(tick_ns, min(_STILL_NS, self._suite.shortest_ns)) if self._still else tick_ns

    def _suffer(self, now_ns: int) -> None:
        for mishap in self._mishaps.due(now_ns):
            if mishap.what is MishapKind.CRASH and self._flies[mishap.node - 1]:
                lies = float(self._gap_m(self._engine.positions()[[mishap.node - 1]])[0]) <= _WRECK_M
                if not lies:
                    self._falling.add(mishap.node)
                self._crash(mishap.node, radio_dies=lies)
            elif mishap.what is MishapKind.BATTERY and self._drain is not None:
                charge = self._drain.batteries.charge
                charge[mishap.node - 1] = min(charge[mishap.node - 1], mishap.value.east)

    def _move(self, last_ns: int, now_ns: int) -> None:
        engine = self._engine
        elapsed_s = (now_ns - last_ns) / S
        steps = max(1, round(elapsed_s / _CONTROL_S))
        for step in range(steps):
            t_s = last_ns / S + step * elapsed_s / steps
            before = engine.positions().copy()
            engine.stand(self._guidance.grounded(before))
            engine.advance(elapsed_s / steps, self._wanted(t_s, before))
            self._incidents.separation.watch(before, engine.positions())
            self._incidents.no_fly.watch(before, engine.positions())
        if self._drain is not None:
            motors = self._flies & ~self._guidance.grounded(engine.positions())
            for row in self._drain.pass_time(elapsed_s, engine, motors):
                self._crash(row + 1, radio_dies=True)
            for row in np.flatnonzero(motors & (self._drain.batteries.charge <= _EMERGENCY_CHARGE)).tolist():
                self._guidance.land_at_once(row + 1)
        if self._estimate is not None and self._guidance.flown:
            self._estimate.advance(self._truth(now_ns))
            lost = self._estimate.lost(now_ns) & self._flies
            if lost.any():
                lost &= self._guidance.commanded(len(self._ids)) & ~self._guidance.grounded(engine.positions())
                for row in np.flatnonzero(lost).tolist():
                    self._guidance.land_at_once(row + 1)
            if lost.any() or self._adrift.any():
                self._adrift = lost
                engine.drift(lost, self._estimate.tilt_m_s2)
        self._record_modes(now_ns)
        for first, second in engine.contacts():
            self._contact(first, second, now_ns)

    def _wanted(self, t_s: float, at: Rows) -> Rows:
        """The velocities that flight controllers ask for, as they really are."""
        estimate, guidance = self._estimate, self._guidance
        if estimate is None or not guidance.flown:
            return guidance.wanted(t_s, at)
        wish = guidance.wanted(t_s, at, estimate.off_m)
        flown = ~guidance.grounded(at) & guidance.commanded(len(at))
        wish = wish - estimate.off_m_s * flown[:, None]
        if self._adrift.any():
            wish[self._adrift, :2] = _LEVEL_S * estimate.tilt_m_s2[self._adrift, :2]
        return wish

    def _truth(self, now_ns: int) -> Truth:
        return Truth(now_ns, self._engine.positions(), self._engine.velocities())

    def _record_modes(self, now_ns: int) -> None:
        changes, self._guidance.changes = self._guidance.changes, []
        self.records += [FlightModeChanged(now_ns, node, mode.value) for node, mode in changes]

    def _find_wrecks(self, solids: Solids) -> None:
        """UAVs that lie on the ground without having been told to land are wrecks in a world that continues another."""
        at = self._engine.positions()
        for row in np.flatnonzero(solids.gap_m(at) <= _WRECK_M).tolist():
            if not self._guidance.may_touch_down(row + 1):
                self._flies[row] = False
                self._engine.fall(row)
                self._guidance.fell(row + 1)

    def _contact(self, first: int, second: int, now_ns: int) -> None:
        """Two bodies touch, where 0 stands for the ground and obstacles: this is a landing, a crash, or a collision."""
        for node in self._falling.intersection((first, second)):
            self._falling.discard(node)
            self._cut(node)
        touching = [node for node in (first, second) if node and self._flies[node - 1]]
        if not touching or (first == 0 and self._touches_down(second)):
            return
        self._incidents.collisions += 1
        self.records.append(Collided(now_ns, second, first))
        if self._scenario.world.crash == "falls":
            for node in touching:
                self._crash(node, radio_dies=self._scenario.world.crash_radio == "dies")

    def _touches_down(self, node: int) -> bool:
        """True for a UAV that is meant to land, and has touched what is below it, not a wall."""
        at = self._engine.positions()[node - 1]
        return self._guidance.may_touch_down(node) and at[2] - float(self._surface_m(at[None])[0]) <= _LEGS_M

    def _crash(self, node: int, *, radio_dies: bool) -> None:
        """Let a UAV fall from now on, because it has touched something or its battery is empty."""
        if not self._flies[node - 1]:
            return
        self._flies[node - 1] = False
        self._engine.fall(node - 1)
        self._guidance.fell(node)
        if radio_dies:
            self._cut(node)

    def _cut(self, node: int) -> None:
        self._radio_died.add(node)
        self.outbox.append((self._topics.radio_control, Cut(_crash_label(node), NodeId(node))))

    def _publish(self, now_ns: int, before_ns: int) -> None:
        """Publish the poses, and the readings of sensors that have an instant in (before, now]."""
        at, velocity = self._engine.positions(), self._engine.velocities()
        every, still = np.vstack([at, self._on_ground]), np.zeros_like(self._on_ground)
        if self._sight is not None:  # before the poses, which bring it into force
            self.outbox.append((self._topics.obstruction, self._sight.obstructions(every, now_ns)))
        states = array("d", np.hstack([every, np.vstack([velocity, still])]).astype(np.float64).tobytes())
        self.outbox.append((self._topics.pose, Poses(now_ns, self._all_ids, states)))
        self._traces = self._traces or self._guidance.flown
        if self._traces and now_ns // _TRACED_NS > before_ns // _TRACED_NS:
            for node, (east, north, up) in zip(self._ids, at.tolist(), strict=True):
                if self._flies[node - 1]:
                    self.records.append(Posed(now_ns, node, round(east, 2), round(north, 2), round(up, 2)))
        sense = self._flies.copy()
        sense[[node - 1 for node in self._falling]] = True
        self.outbox.extend(self._suite.readings(self._truth(now_ns), sense, before_ns=before_ns))
