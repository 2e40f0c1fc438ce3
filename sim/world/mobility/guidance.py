"""Which velocity each UAV wants: towards its place in the formation, its waypoint or its setpoint, and clear of others.

A place is tracked with its own velocity fed forward; near others, a push away is added and closing speed taken out,
so that UAVs sent to one point settle around it.

What a flight controller does by itself, whatever it is asked: it holds when velocities are not renewed, brakes before
the geofence, and lands at once when its battery is nearly empty.
"""

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Final, assert_never

import numpy as np

from fanet_mw.bus.messages import VELOCITY_LASTS_NS, Setpoint, SetpointKind
from fanet_mw.extensions import load
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.model import MOBILITY_MODELS
from fanet_mw.units import Enu, S
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


class Guidance:
    """The track of the mobility model, overridden per node by setpoints."""

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
        self._setpoints: dict[int, tuple[Enu, float]] = {}
        self._velocities: dict[int, tuple[Enu, float]] = {}
        """Velocity setpoints by row, each with the instant [s] at which it ends."""
        self._landings: dict[int, float] = {}
        """Speeds of those rows that land, or have landed."""
        self._grounded = set(range(len(starts))) if scenario.nodes.on_ground else set[int]()
        """Rows that have not taken off yet, or that are taking off."""
        self._forced: set[int] = set()
        """Rows that obey no setpoint: they land, because their batteries are nearly empty, or are wrecks."""
        self._modes: dict[int, FlightMode] = {}
        self.changes: list[tuple[int, FlightMode]] = []
        """Nodes that changed their mode, with the new one, for the host to take."""

    @property
    def still(self) -> bool:
        """True when nothing moves and no setpoint is in force."""
        asked = self._setpoints or self._velocities or self._landings
        return self._model is None and not self._onboard and not asked

    def obey(self, node: int, setpoint: Setpoint, *, at: Values, t_s: float) -> None:
        """Take a setpoint of a UAV that is `at` [3] at an instant."""
        here = Enu(*at.tolist())
        row = node - 1
        if row in self._forced:
            return
        kind, place, speed_m_s = setpoint.kind, setpoint.position, setpoint.speed_m_s
        if kind is not SetpointKind.LAND and self._landings.pop(row, None) is not None:
            self._grounded.add(row)  # it may stand on the ground, until it is seen clear of it
        self._velocities.pop(row, None)
        if kind is SetpointKind.POSITION:
            self.steer(node, place, speed_m_s=speed_m_s)
            if speed_m_s <= 0 and self._onboard:
                self._hold(row, here)
            self._enter(
                row, FlightMode.GOTO if speed_m_s > 0 else FlightMode.HOLD if self._onboard else FlightMode.TRACK
            )
        elif kind is SetpointKind.VELOCITY:
            self._setpoints.pop(row, None)
            self._velocities[row] = setpoint.velocity, t_s + VELOCITY_LASTS_NS / S
            self._enter(row, FlightMode.VELOCITY)
        elif kind is SetpointKind.HOLD:
            self._hold(row, here)
            self._enter(row, FlightMode.HOLD)
        elif kind is SetpointKind.TAKEOFF:
            self._grounded.add(row)  # until it is clear of the ground
            self.steer(node, Enu(here.east, here.north, place.up), speed_m_s=max(_LEAST_CLIMB_M_S, speed_m_s))
            self._enter(row, FlightMode.TAKEOFF)
        elif kind is SetpointKind.LAND:
            self._setpoints.pop(row, None)
            self._landings[row] = max(_TOUCHDOWN_M_S, speed_m_s)
            self._enter(row, FlightMode.LAND)
        else:
            assert_never(kind)

    def land_at_once(self, node: int) -> None:
        """The battery of this UAV is nearly empty: it lands where it is, and obeys no further setpoint."""
        row = node - 1
        if row not in self._forced:
            self._obey_no_more(row)
            self._landings[row] = _FORCED_M_S
            self._enter(row, FlightMode.FAILSAFE)

    def fell(self, node: int) -> None:
        """Take a UAV for a wreck, which obeys no setpoint."""
        row = node - 1
        self._obey_no_more(row)
        self._landings.pop(row, None)
        self._enter(row, FlightMode.FALLEN)

    def _obey_no_more(self, row: int) -> None:
        self._forced.add(row)
        self._velocities.pop(row, None)
        self._setpoints.pop(row, None)

    def _enter(self, row: int, mode: FlightMode) -> None:
        if self._modes.get(row) is not mode:
            self._modes[row] = mode
            self.changes.append((row + 1, mode))

    def may_touch_down(self, node: int) -> bool:
        """True if this UAV touches the ground on purpose."""
        return node - 1 in self._landings or node - 1 in self._grounded

    def grounded(self, at: Rows) -> Flags:
        """Which UAVs stand on the ground with their motors off: they have landed, or wait for their takeoff."""
        off = np.zeros(len(at), bool)
        waiting = [row for row in self._grounded if row not in self._setpoints and row not in self._velocities]
        off[[*self._landings, *waiting]] = True
        return np.asarray(off & (at[:, 2] - self._ground_m(at) <= _ON_GROUND_M))

    def _hold(self, row: int, here: Enu) -> None:
        self._setpoints[row] = here, _HOLD_M_S

    def steer(self, node: int, place: Enu, *, speed_m_s: float) -> None:
        """Send a UAV somewhere, within the area; a speed of 0 or less sends it back to its track."""
        if speed_m_s <= 0:
            self._setpoints.pop(node - 1, None)
            return
        inside = Enu(
            max(-self._half_east, min(self._half_east, place.east)),
            max(-self._half_north, min(self._half_north, place.north)),
            max(FLOOR_M, min(1000.0, place.up)),
        )
        self._setpoints[node - 1] = inside, speed_m_s

    def track(self, t_s: float) -> Track:
        """The places at which all UAVs should be, setpoints not considered."""
        return self._model.track(t_s) if self._model else Track(self._starts, np.zeros_like(self._starts))

    def wanted(self, t_s: float, at: Rows, velocity: Rows) -> Rows:
        """The velocity that each UAV should fly now [m/s]."""
        places, feed = self.track(t_s)
        places, feed = places.copy(), feed.copy()
        limit = np.linalg.norm(feed, axis=1) + 5.0
        self._expire(t_s, at)
        for row in sorted(self._setpoints):
            places[row], limit[row] = self._setpoints[row][0], self._setpoints[row][1]
            feed[row] = 0.0
        wish = feed + _GAIN * (places - at)
        speed = np.linalg.norm(wish, axis=1)
        wish *= np.minimum(1.0, limit / np.maximum(speed, 1e-9))[:, None]
        for row, (velocity_m_s, _) in self._velocities.items():
            wish[row] = velocity_m_s
            self._fence(wish[row], at[row])
        if self._landings or self._grounded:
            self._near_the_ground(wish, at)
        return _keep_clear(wish, at, self._see_m) if len(at) > 1 and self._see_m else wish

    def _expire(self, t_s: float, at: Rows) -> None:
        """Let each UAV hold its position whose velocity setpoint was not renewed in time."""
        for row in [row for row, (_, until_s) in self._velocities.items() if t_s >= until_s]:
            del self._velocities[row]
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

    def _near_the_ground(self, wish: Rows, at: Rows) -> None:
        """Sink straight down, the slower the nearer the ground; forget the UAVs that have taken off."""
        height = at[:, 2] - self._ground_m(at)
        for row, speed_m_s in self._landings.items():
            sink = min(speed_m_s, max(_TOUCHDOWN_M_S, _FLARE_PER_S * float(height[row])))
            wish[row] = [0.0, 0.0, -sink if height[row] > _ON_GROUND_M else 0.0]
        for row in [row for row in self._grounded if height[row] > _CLEAR_M]:
            self._grounded.discard(row)
        for row in self._grounded:
            if row not in self._setpoints and row not in self._velocities and row not in self._landings:
                wish[row] = 0.0


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
