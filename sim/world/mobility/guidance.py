"""Which velocity each UAV wants: towards its place in the formation, its waypoint or its setpoint, and clear of others.

A place is tracked with its own velocity fed forward; near others, a push away is added and closing speed taken out,
so that UAVs sent to one point settle around it.

What a flight controller does by itself, whatever it is asked: it holds when velocities are not renewed, brakes before
the geofence, and lands at once when its battery is nearly empty.
"""

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final, NamedTuple, assert_never

import numpy as np

from fanet_mw.bus.messages import VELOCITY_LASTS_NS, Setpoint, SetpointKind
from fanet_mw.extensions import load
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.mobility import MOBILITY_MODELS
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, Enu, S
from sim.world.engines.contract import Flags, Rows, Values
from sim.world.mobility.contract import MobilityModel, Track
from sim.world.mobility.crossing import Crossing
from sim.world.mobility.formation import Formation
from sim.world.mobility.random_waypoint import RandomWaypoint

_GAIN: Final = 0.8
"""Position loop [1/s]."""
_CLEAR_M: Final = 4.0
"""The distance that UAVs keep; within twice of it they are pushed apart."""
_BRAKE_M_S2: Final = 2.5
"""Half of what an engine can do: the other half is for its lag."""
_PUSH_M_S: Final = 4.0
_ROUNDS: Final = 4
FLOOR_M: Final = 5.0
"""No position is flown to below this height."""
_HOLD_M_S: Final = 5.0
"""The greatest speed at which a UAV that holds its position comes back to it."""
_LEAST_CLIMB_M_S: Final = 0.5
_FORCED_M_S: Final = 2.0
_TOUCHDOWN_M_S: Final = 0.5
"""Speed at which a landing meets the ground; ArduPilot's LAND_SPEED, too."""
_FLARE_PER_S: Final = 0.5
"""Sinking speed for each metre of height."""
_ON_GROUND_M: Final = 0.3
FENCE_M: Final = 50.0
"""The geofence lies so far outside the area; no UAV that flies at a velocity leaves it."""


class FlightMode(StrEnum):
    """What a flight controller is doing."""

    TRACK = "track"
    """It follows the mobility model."""
    GOTO = "goto"
    VELOCITY = "velocity"
    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    FAILSAFE = "failsafe"
    """Velocities were not renewed, and it holds; or its battery is nearly empty, and it lands."""
    FALLEN = "fallen"


class _GoTo(NamedTuple):
    """Fly to a place and stay there."""

    place: Enu
    speed_m_s: float


class _FlyAt(NamedTuple):
    """Fly at a velocity, until an instant [s] at which it is to have been renewed."""

    velocity: Enu
    until_s: float


class _Land(NamedTuple):
    """Sink straight down, and stay on the ground."""

    speed_m_s: float


_Command = _GoTo | _FlyAt | _Land


def makes_sense(setpoint: Setpoint) -> bool:
    """True if a flight controller can be asked for this.

    Anybody on the bus can put a setpoint, and one whose square is no number would end the flight of all UAVs.
    """
    possible = setpoint.position.is_within(FARTHEST_M) and setpoint.velocity.is_within(FASTEST_M_S)
    return possible and abs(setpoint.speed_m_s) <= FASTEST_M_S


class Guidance:
    """The track of the mobility model, overridden per node by setpoints.

    The flight of each UAV is its command, its mode, and whether it may still stand on the ground.
    """

    def __init__(self, starts: Rows, scenario: Scenario, *, ground_m: Callable[[Rows], Values] | None = None) -> None:
        """`ground_m`: heights of the ground at places [n, 3]; None: a plain at 0."""
        self._ground_m = ground_m or (lambda places: np.zeros(len(places)))
        model = scenario.mobility.model
        self._onboard = model == "onboard"
        """True when UAVs are flown by their own computers; the world then keeps none of them clear of others."""
        self._see_m = 0.0 if self._onboard else scenario.mobility.see_m
        half = scenario.world.area_m / 2
        reach = np.maximum(half, np.abs(starts[:, :2]).max(axis=0)) if self._onboard else (half, half)
        self._half_east, self._half_north = float(reach[0]), float(reach[1])
        self._starts = starts.copy()
        """The place at which each UAV holds while neither a mobility model nor a setpoint moves it."""
        self._model: MobilityModel | None = (
            Formation(starts, scenario) if model == "formation"
            else RandomWaypoint(starts, scenario) if model == "random_waypoint"
            else Crossing(starts, scenario) if model == "crossing"
            else None if model in MOBILITY_MODELS
            else load("mobility.model", model)(starts.copy(), scenario)
        )  # fmt: skip
        self._commands: dict[int, _Command] = {}
        """What each row was told last, the latest at the end; a row that is not here follows the mobility model."""
        self._modes: dict[int, FlightMode] = {}
        """What each row does; a row that was never told anything is not here."""
        self._grounded = set(range(len(starts))) if scenario.nodes.on_ground else set[int]()
        """Rows that have not taken off yet, or that are taking off."""
        self.changes: list[tuple[int, FlightMode]] = []
        """Nodes that changed their mode, with the new one, for the host to take."""

    @property
    def still(self) -> bool:
        """True when nothing moves and no setpoint is in force."""
        return self._model is None and not self._onboard and not self._commands

    def obey(self, node: int, setpoint: Setpoint, *, at: Values, t_s: float) -> None:
        """Take a setpoint of a UAV that is `at` [3] at an instant."""
        here = Enu(*at.tolist())
        row = node - 1
        if not self._obeys(row):
            return
        kind, place, speed_m_s = setpoint.kind, setpoint.position, setpoint.speed_m_s
        if kind is not SetpointKind.LAND and isinstance(self._commands.get(row), _Land):
            self._grounded.add(row)  # it may stand on the ground, until it is seen clear of it
        if kind is SetpointKind.POSITION:
            self.steer(node, place, speed_m_s=speed_m_s)
            if speed_m_s <= 0 and self._onboard:
                self._hold(row, here)
            self._enter(
                row, FlightMode.GOTO if speed_m_s > 0 else FlightMode.HOLD if self._onboard else FlightMode.TRACK
            )
        elif kind is SetpointKind.VELOCITY:
            self._command(row, _FlyAt(setpoint.velocity, t_s + VELOCITY_LASTS_NS / S))
            self._enter(row, FlightMode.VELOCITY)
        elif kind is SetpointKind.HOLD:
            self._hold(row, here)
            self._enter(row, FlightMode.HOLD)
        elif kind is SetpointKind.TAKEOFF:
            self._grounded.add(row)  # until it is clear of the ground
            self.steer(node, Enu(here.east, here.north, place.up), speed_m_s=max(_LEAST_CLIMB_M_S, speed_m_s))
            self._enter(row, FlightMode.TAKEOFF)
        elif kind is SetpointKind.LAND:
            self._command(row, _Land(max(_TOUCHDOWN_M_S, speed_m_s)))
            self._enter(row, FlightMode.LAND)
        else:
            assert_never(kind)

    def land_at_once(self, node: int) -> None:
        """The battery of this UAV is nearly empty: it lands where it is, and obeys no further setpoint."""
        row = node - 1
        if self._obeys(row):
            self._command(row, _Land(_FORCED_M_S))
            self._enter(row, FlightMode.FAILSAFE)

    def fell(self, node: int) -> None:
        """Take a UAV for a wreck, which obeys no setpoint."""
        row = node - 1
        self._command(row, None)
        self._enter(row, FlightMode.FALLEN)

    def _obeys(self, row: int) -> bool:
        """False for a wreck, and for a UAV that lands because its battery is nearly empty."""
        mode = self._modes.get(row)
        landing = isinstance(self._commands.get(row), _Land)
        return mode is not FlightMode.FALLEN and not (mode is FlightMode.FAILSAFE and landing)

    def _command(self, row: int, command: _Command | None) -> None:
        """Let a row do this and nothing that it was told before; None: follow the mobility model."""
        self._commands.pop(row, None)
        if command is not None:
            self._commands[row] = command

    def _enter(self, row: int, mode: FlightMode) -> None:
        if self._modes.get(row) is not mode:
            self._modes[row] = mode
            self.changes.append((row + 1, mode))

    def may_touch_down(self, node: int) -> bool:
        """True if this UAV touches the ground on purpose."""
        return node - 1 in self._grounded or isinstance(self._commands.get(node - 1), _Land)

    def grounded(self, at: Rows) -> Flags:
        """Which UAVs stand on the ground with their motors off: they have landed, or wait for their takeoff."""
        off = np.zeros(len(at), bool)
        landing = [row for row, command in self._commands.items() if isinstance(command, _Land)]
        off[[*landing, *self._waiting()]] = True
        return np.asarray(off & (at[:, 2] - self._ground_m(at) <= _ON_GROUND_M))

    def _waiting(self) -> list[int]:
        """The rows that stand on the ground, and have not been told to take off."""
        return [row for row in self._grounded if row not in self._commands]

    def _hold(self, row: int, here: Enu) -> None:
        self._command(row, _GoTo(here, _HOLD_M_S))

    def steer(self, node: int, place: Enu, *, speed_m_s: float) -> None:
        """Send a UAV somewhere, within the area; a speed of 0 or less sends it back to its track."""
        if speed_m_s <= 0:
            self._command(node - 1, None)
            return
        inside = Enu(
            max(-self._half_east, min(self._half_east, place.east)),
            max(-self._half_north, min(self._half_north, place.north)),
            max(FLOOR_M, min(1000.0, place.up)),
        )
        self._command(node - 1, _GoTo(inside, speed_m_s))

    def track(self, t_s: float) -> Track:
        """The places at which all UAVs should be, setpoints not considered."""
        return self._model.track(t_s) if self._model else Track(self._starts, np.zeros_like(self._starts))

    def wanted(self, t_s: float, at: Rows, velocity: Rows) -> Rows:
        """The velocity that each UAV should fly now [m/s]."""
        places, feed = self.track(t_s)
        places, feed = places.copy(), feed.copy()
        limit = np.linalg.norm(feed, axis=1) + 5.0
        self._expire(t_s, at)
        for row, command in self._commands.items():
            if isinstance(command, _GoTo):
                places[row], limit[row] = command
                feed[row] = 0.0
        wish = feed + _GAIN * (places - at)
        speed = np.linalg.norm(wish, axis=1)
        wish *= np.minimum(1.0, limit / np.maximum(speed, 1e-9))[:, None]
        landings: dict[int, float] = {}
        for row, command in self._commands.items():
            if isinstance(command, _FlyAt):
                wish[row] = command.velocity
                self._fence(wish[row], at[row])
            elif isinstance(command, _Land):
                landings[row] = command.speed_m_s
        if landings or self._grounded:
            self._near_the_ground(wish, at, landings)
        return _keep_clear(wish, at, self._see_m) if len(at) > 1 and self._see_m else wish

    def _expire(self, t_s: float, at: Rows) -> None:
        """Let each UAV hold its position whose velocity setpoint was not renewed in time."""
        commands = self._commands.items()
        for row in [row for row, told in commands if isinstance(told, _FlyAt) and t_s >= told.until_s]:
            self._hold(row, Enu(*at[row].tolist()))
            self._enter(row, FlightMode.FAILSAFE)

    def _fence(self, wish: Values, at: Values) -> None:
        """Take out of a velocity [3] what would carry a UAV over the geofence; from outside of it, bring it back."""
        for axis, half in ((0, self._half_east), (1, self._half_north)):
            outwards = math.copysign(1.0, at[axis])
            left_m = half + FENCE_M - abs(float(at[axis]))
            most = math.sqrt(2 * _BRAKE_M_S2 * left_m) if left_m > 0 else -_HOLD_M_S
            if wish[axis] * outwards > most:
                wish[axis] = most * outwards

    def _near_the_ground(self, wish: Rows, at: Rows, landings: Mapping[int, float]) -> None:
        """Sink straight down, the slower the nearer the ground; forget the UAVs that have taken off."""
        height = at[:, 2] - self._ground_m(at)
        for row, speed_m_s in landings.items():
            sink = min(speed_m_s, max(_TOUCHDOWN_M_S, _FLARE_PER_S * float(height[row])))
            wish[row] = [0.0, 0.0, -sink if height[row] > _ON_GROUND_M else 0.0]
        for row in [row for row in self._grounded if height[row] > _CLEAR_M]:
            self._grounded.discard(row)
        wish[self._waiting()] = 0.0


def _keep_clear(wish: Rows, at: Rows, see_m: float) -> Rows:
    """Slow down towards others so that both can still stop in time, and push away from those that are too near.

    Two that brake at `_BRAKE_M_S2` from v each need v^2 / _BRAKE_M_S2 between them: hence the cap on closing speed.
    """
    apart = at[:, None] - at[None]
    distance = np.sqrt((apart**2).sum(axis=2))
    np.fill_diagonal(distance, math.inf)
    near = distance < see_m
    rows = np.flatnonzero(near.any(axis=1))
    if not len(rows):
        return wish
    gap = np.where(near[np.ix_(rows, rows)], distance[np.ix_(rows, rows)], math.inf)
    away = apart[np.ix_(rows, rows)] / np.maximum(distance[np.ix_(rows, rows)], 1e-6)[..., None]
    cap = np.sqrt(_BRAKE_M_S2 * np.maximum(0.0, gap - _CLEAR_M))
    push = np.maximum(0.0, 1 - gap / (2 * _CLEAR_M))
    own = wish[rows] + _PUSH_M_S * (push[..., None] * away).sum(axis=1)
    every = np.arange(len(rows))
    for _ in range(_ROUNDS):  # the worst neighbor first; a correction for one may close in on another
        excess = -np.einsum("ik,ijk->ij", own, away) - cap
        worst = excess.argmax(axis=1)
        own += np.maximum(0.0, excess[every, worst])[:, None] * away[every, worst]
    wish[rows] = own
    return wish
