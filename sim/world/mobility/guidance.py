"""The simulated flight controllers: the velocity that each UAV should fly now, by its mobility model or its setpoint.

A UAV follows a moving place by a proportional controller, to which the velocity of the place is added (feed-forward).
Whatever it is asked to do, it holds its position when velocity setpoints are no longer renewed, brakes before the
geofence or returns from it (`geofence.py`), and lands at once when its battery is nearly empty. It returns when it is
asked to, and if the scenario says so also when its computer falls silent (`return_mode.py`).
"""

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final, NamedTuple, assert_never

import numpy as np

from fanet_mw.bus.messages import VELOCITY_LASTS_NS, Setpoint, SetpointKind
from fanet_mw.errors import LocalProtocolError
from fanet_mw.extensions import make
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.mobility import MOBILITY_MODELS
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, Enu, S
from sim.world.arrays import Flags, Rows, Values
from sim.world.mobility.contract import MobilityModel, Track
from sim.world.mobility.geofence import BRAKE_M_S2, HOLD_M_S, Geofence
from sim.world.mobility.models import Crossing, Formation, RandomWaypoint
from sim.world.mobility.return_mode import Homeward, ReturnMode

CLEAR_M: Final = 4.0
"""The distance that UAVs keep from each other; UAVs within twice this distance are pushed apart."""
_PUSH_M_S: Final = 4.0
"""The greatest speed by which one neighbor pushes a UAV away."""
_ROUNDS: Final = 4
"""How often the speed towards the worst neighbor is reduced, because reducing one may increase another."""


def kept_clear(wish: Rows, at: Rows, see_m: float) -> Rows:
    """Cap each UAV's speed towards each neighbor within `see_m`, and push apart those that are too near. Two that brake
    at `BRAKE_M_S2` from v each need v^2 / BRAKE_M_S2, which is the gap between them less `CLEAR_M`.
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
    cap = np.sqrt(BRAKE_M_S2 * np.maximum(0.0, gap - CLEAR_M))
    push = np.maximum(0.0, 1 - gap / (2 * CLEAR_M))
    own = wish[rows] + _PUSH_M_S * (push[..., None] * away).sum(axis=1)
    every = np.arange(len(rows))
    for _ in range(_ROUNDS):  # the worst neighbor first; a correction for one may close in on another
        excess = -np.einsum("ik,ijk->ij", own, away) - cap
        worst = excess.argmax(axis=1)
        own += np.maximum(0.0, excess[every, worst])[:, None] * away[every, worst]
    wish[rows] = own
    return wish


_GAIN: Final = 0.8
"""The gain of the position controller: velocity by distance from the wanted place [1/s]."""
_LEAST_CLIMB_M_S: Final = 0.5
"""The speed of a take-off whose setpoint asks for less."""
_FORCED_M_S: Final = 2.0
"""The sinking speed of a UAV that lands because its battery is nearly empty, or at the end of its return."""
_TOUCHDOWN_M_S: Final = 0.5
"""The sinking speed at which a UAV touches the ground, as in ArduPilot (LAND_SPEED)."""
_FLARE_PER_S: Final = 0.5
"""Near the ground a landing UAV sinks at most at its height times this."""
_ON_GROUND_M: Final = 0.3
"""A UAV below this height stands on the ground."""


class FlightMode(StrEnum):
    """The flight mode of a UAV: what its flight controller is doing."""

    TRACK = "track"
    """The UAV follows the mobility model."""
    GOTO = "goto"
    VELOCITY = "velocity"
    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    RETURN = "return"
    """It flies home and lands: commanded, its computer has fallen silent, or it was beyond the geofence."""
    FAILSAFE = "failsafe"
    """It holds its position as velocity setpoints are no longer renewed, or lands as its battery is nearly empty."""
    FALLEN = "fallen"
    """The UAV has crashed and obeys nothing."""


class _GoTo(NamedTuple):
    """Fly to a place and stay there."""

    place: Enu
    speed_m_s: float


class _FlyAt(NamedTuple):
    """Fly at a velocity until the instant `until_s`, before which it must be renewed."""

    velocity: Enu
    until_s: float


class _Land(NamedTuple):
    """Sink straight down, and stay on the ground."""

    speed_m_s: float
    place: Enu | None = None
    """The place above which it sinks; None for one that does not know its place, and drifts."""


_Command = _GoTo | _FlyAt | _Land | Homeward


def makes_sense(setpoint: Setpoint) -> bool:
    """False for a setpoint that is no number or absurdly great: any process may send one, and its square would overflow
    and stop the flight of all.
    """
    possible = setpoint.position.is_within(FARTHEST_M) and setpoint.velocity.is_within(FASTEST_M_S)
    return possible and abs(setpoint.speed_m_s) <= FASTEST_M_S


class Guidance:
    """The flight controllers of all UAVs, a row of each array for each: its command, its flight mode, and whether it
    may still stand on the ground.
    """

    def __init__(self, starts: Rows, scenario: Scenario, *, surface_m: Callable[[Rows], Values] | None = None) -> None:
        """`surface_m` gives the height of the roof or ground below places [n, 3]; None means flat ground at 0."""
        self._surface_m = surface_m or (lambda places: np.zeros(len(places)))
        model = scenario.mobility.model
        self._onboard = model == "onboard"
        """True if the UAVs are flown by their companion computers, which then avoid collisions themselves."""
        self._see_m = 0.0 if self._onboard else scenario.mobility.see_m
        self._fence = Geofence(scenario, starts)
        self._returns = ReturnMode(starts, scenario, surface_m=self._surface_m)
        self._starts = starts.copy()
        """The place at which each UAV holds while neither a mobility model nor a setpoint moves it."""
        self._model: MobilityModel | None = (
            Formation(starts, scenario) if model == "formation"
            else RandomWaypoint(starts, scenario) if model == "random_waypoint"
            else Crossing(starts, scenario) if model == "crossing"
            else None if model in MOBILITY_MODELS
            else _Foreign(model, make("mobility.model", model, starts.copy(), scenario), starts)
        )  # fmt: skip
        self._commands: dict[int, _Command] = {}
        """The command of each row, the newest command last; a row without a command follows the mobility model."""
        self._modes: dict[int, FlightMode] = {}
        """The flight mode of each row that was ever commanded."""
        self._grounded = set(range(len(starts))) if scenario.nodes.on_ground else set[int]()
        """The rows that may stand on the ground: they have not taken off yet, or are taking off."""
        self.changes: list[tuple[int, FlightMode]] = []
        """The nodes that have changed their flight mode, each with its new mode, until the caller takes them."""

    @property
    def still(self) -> bool:
        """True when nothing moves and no setpoint is in force."""
        return self._model is None and not self._onboard and not self._commands

    @property
    def flown(self) -> bool:
        """True while any UAV flies by the commands of a setpoint, or may be asked to at once."""
        return self._onboard or bool(self._commands)

    def obey(self, node: int, setpoint: Setpoint, *, at: Values, t_s: float) -> None:
        """Carry out a setpoint for a UAV that is at the place `at` [3] at the instant `t_s`."""
        here = Enu(*at.tolist())
        row = node - 1
        if not self._obeys(row):
            return
        self._returns.on_setpoint(row, t_s)
        kind, place, speed_m_s = setpoint.kind, setpoint.position, setpoint.speed_m_s
        if kind is SetpointKind.RETURN and self._stands(row, here):
            return
        if kind is not SetpointKind.LAND and isinstance(self._commands.get(row), _Land):
            self._grounded.add(row)  # a UAV that was landing may stand on the ground until it has climbed
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
            self._grounded.add(row)  # until it has climbed clear of the ground
            self.steer(node, Enu(here.east, here.north, place.up), speed_m_s=max(_LEAST_CLIMB_M_S, speed_m_s))
            self._enter(row, FlightMode.TAKEOFF)
        elif kind is SetpointKind.LAND:
            landing = self._commands.get(row)
            over = landing.place if isinstance(landing, _Land) else None
            self._command(row, _Land(max(_TOUCHDOWN_M_S, speed_m_s), over or here))
            self._enter(row, FlightMode.LAND)
        elif kind is SetpointKind.RETURN:
            self._command(row, self._returns.way(row, here, speed_m_s))
            self._enter(row, FlightMode.RETURN)
        else:
            assert_never(kind)

    def land_at_once(self, node: int) -> None:
        """Land a UAV where it is, with its battery nearly empty or its position lost; it obeys nothing further."""
        row = node - 1
        if self._obeys(row):
            self._command(row, _Land(_FORCED_M_S))
            self._enter(row, FlightMode.FAILSAFE)

    def fell(self, node: int) -> None:
        """A UAV has crashed; it obeys no further setpoint."""
        row = node - 1
        self._command(row, None)
        self._enter(row, FlightMode.FALLEN)

    def _obeys(self, row: int) -> bool:
        """False if it has crashed, lands with its battery nearly empty, or returns from beyond the geofence."""
        mode = self._modes.get(row)
        landing = isinstance(self._commands.get(row), _Land)
        forced = (mode is FlightMode.FAILSAFE and landing) or row in self._returns.from_fence
        return mode is not FlightMode.FALLEN and not forced

    def _command(self, row: int, command: _Command | None) -> None:
        """Replace the command of a row; None lets it follow the mobility model."""
        self._commands.pop(row, None)
        if command is not None:
            self._commands[row] = command

    def _enter(self, row: int, mode: FlightMode) -> None:
        if self._modes.get(row) is not mode:
            self._modes[row] = mode
            self.changes.append((row + 1, mode))

    def may_touch_down(self, node: int) -> bool:
        """True if contact with the ground is intended for this UAV, and hence no crash."""
        return node - 1 in self._grounded or isinstance(self._commands.get(node - 1), _Land)

    def grounded(self, at: Rows) -> Flags:
        """The UAVs that stand on the ground with their motors off: they have landed, or wait to take off."""
        off = np.zeros(len(at), bool)
        rows = [row for row, command in self._commands.items() if isinstance(command, _Land)]
        rows += self._waiting()
        if not rows:
            return off
        off[rows] = True
        return np.asarray(off & (at[:, 2] - self._surface_m(at) <= _ON_GROUND_M))

    def commanded(self, count: int) -> Flags:
        """Which of so many UAVs carry out a command, other than those that follow the mobility model."""
        found = np.zeros(count, bool)
        found[[*self._commands]] = True
        return found

    def _stands(self, row: int, here: Enu) -> bool:
        """True if the UAV of a row, which is at a place, stands on the ground with its motors off."""
        off = isinstance(self._commands.get(row), _Land) or row in self._waiting()
        return off and here.up - float(self._surface_m(np.array([here]))[0]) <= _ON_GROUND_M

    def _waiting(self) -> list[int]:
        """The rows that stand on the ground and have no command to take off."""
        return [row for row in self._grounded if row not in self._commands]

    def _hold(self, row: int, here: Enu) -> None:
        self._command(row, _GoTo(here, HOLD_M_S))

    def steer(self, node: int, place: Enu, *, speed_m_s: float) -> None:
        """Send a UAV to a place, which is clipped to the area; at a speed of 0 or less it goes back to its track."""
        if speed_m_s <= 0:
            self._command(node - 1, None)
            return
        self._command(node - 1, _GoTo(self._fence.clipped(place), speed_m_s))

    def track(self, t_s: float) -> Track:
        """Where the mobility model wants all UAVs to be; setpoints do not count here."""
        return self._model.track(t_s) if self._model else Track(self._starts, np.zeros_like(self._starts))

    def wanted(self, t_s: float, true: Rows, off: Rows | None = None) -> Rows:
        """The velocity that each UAV should fly now [m/s]. `off`: by how much flight controllers mistake their places
        [n, 3]; the track of a mobility model is where UAVs really fly, whatever they believe.
        """
        at = true
        if off is not None and self.flown:
            at = true.copy()
            at += off * self.commanded(len(at))[:, None]
        places, feed = self.track(t_s)
        places, feed = places.copy(), feed.copy()
        limit = np.linalg.norm(feed, axis=1) + 5.0
        self._expire(t_s, at)
        if self._returns.watches:
            self._begin_returns(t_s, at, self.grounded(true))
        for row, command in [*self._commands.items()]:
            if isinstance(command, Homeward):
                goal = command.goal(Enu(*at[row].tolist()))
                self._command(row, _Land(_FORCED_M_S, Enu(*at[row].tolist())) if goal is None else command)
                places[row], limit[row] = goal or at[row], command.speed_m_s
                feed[row] = 0.0
            elif isinstance(command, _GoTo):
                places[row], limit[row] = command
                feed[row] = 0.0
            elif isinstance(command, _Land):
                places[row], limit[row] = command.place or at[row], HOLD_M_S
                feed[row] = 0.0
        wish = feed + _GAIN * (places - at)
        speed = np.linalg.norm(wish, axis=1)
        wish *= np.minimum(1.0, limit / np.maximum(speed, 1e-9))[:, None]
        flown = {row: command.velocity for row, command in self._commands.items() if isinstance(command, _FlyAt)}
        if flown:
            rows = [*flown]
            asked = np.array([*flown.values()])
            wish[rows] = asked if self._returns.at_fence else self._fence.brake(asked, at[rows])
        landings = {row: command.speed_m_s for row, command in self._commands.items() if isinstance(command, _Land)}
        if landings or self._grounded:
            self._near_the_ground(wish, true, landings)
        if len(at) > 1 and self._see_m:
            wish = kept_clear(wish, true, self._see_m)
            if landings or self._grounded:
                wish[self.grounded(true)] = 0.0
        return wish

    def _expire(self, t_s: float, at: Rows) -> None:
        """Let every UAV hold its position whose velocity setpoint was not renewed in time."""
        commands = self._commands.items()
        for row in [row for row, told in commands if isinstance(told, _FlyAt) and t_s >= told.until_s]:
            self._hold(row, Enu(*at[row].tolist()))
            self._enter(row, FlightMode.FAILSAFE)

    def _begin_returns(self, t_s: float, at: Rows, stands: Flags) -> None:
        """Send those UAVs home that fly without having heard from their computers, or are beyond the geofence."""
        self._returns.from_fence -= set(np.flatnonzero(stands).tolist())
        able = [
            row for row in range(len(at))
            if not stands[row] and self._obeys(row) and not isinstance(self._commands.get(row), _Land | Homeward)
        ]  # fmt: skip
        for row, homeward in self._returns.due(able, at, self._fence.beyond(at), t_s):
            self._command(row, homeward)
            self._enter(row, FlightMode.RETURN)

    def _near_the_ground(self, wish: Rows, at: Rows, landings: Mapping[int, float]) -> None:
        """UAVs that land (`landings`: sinking speed by row) sink over their places, slowly near the ground; those that
        wait for take-off stand still; who has climbed clear leaves `_grounded`.
        """
        height = at[:, 2] - self._surface_m(at)
        for row, speed_m_s in landings.items():
            sink = min(speed_m_s, max(_TOUCHDOWN_M_S, _FLARE_PER_S * float(height[row])))
            wish[row] = [*wish[row, :2], -sink] if height[row] > _ON_GROUND_M else [0.0, 0.0, 0.0]
        for row in [row for row in self._grounded if height[row] > CLEAR_M]:
            self._grounded.discard(row)
        wish[self._waiting()] = 0.0


class _Foreign:
    """A mobility model of another package, whose tracks are checked: nobody flies to what is no place."""

    def __init__(self, name: str, model: MobilityModel, starts: Rows) -> None:
        self._name, self._model, self._shape = name, model, starts.shape

    def track(self, t_s: float) -> Track:
        track = self._model.track(t_s)
        try:
            places, velocities = (np.array(rows, dtype=np.float64) for rows in track)
        except (TypeError, ValueError):
            known = False
        else:
            known = all(rows.shape == self._shape and np.isfinite(rows).all() for rows in (places, velocities))
        if not known:
            raise LocalProtocolError(
                f"mobility.model = {self._name!r}: track({t_s:g}) must give the places and the velocities of "
                f"{self._shape[0]} UAVs, three finite numbers each, not {' '.join(repr(track).split()):.120}"
            )
        return Track(places, velocities)
