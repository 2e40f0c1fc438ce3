"""Which velocity each UAV wants: towards its place in the formation, its waypoint or its setpoint, and clear of others.

A place is tracked with its own velocity fed forward; near others, a push away is added and closing speed taken out,
so that UAVs sent to one point settle around it.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol, assert_never

import numpy as np
import numpy.typing as npt

from fanet_mw.bus.messages import VELOCITY_LASTS_NS, Setpoint, SetpointKind
from fanet_mw.extensions import load
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.model import MOBILITY_MODELS
from fanet_mw.units import Enu, S
from sim.world.engine import Flags, Rows, Values

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
"""Who holds comes back to its place at this speed at most."""
_LEAST_CLIMB_M_S: Final = 0.5
_TOUCHDOWN_M_S: Final = 0.5
"""Speed at which a landing meets the ground; ArduPilot's LAND_SPEED, too."""
_FLARE_PER_S: Final = 0.5
"""Sinking speed for each metre of height."""
_ON_GROUND_M: Final = 0.3


class Track(NamedTuple):
    """Where each UAV should be now, and how that place moves."""

    places: Rows
    velocities: Rows


class MobilityModel(Protocol):
    """Where UAVs fly while no setpoint says otherwise.

    Another package may bring one (`fanet_mw.extensions`): a class that takes the places [n, 3] where the UAVs start,
    and the scenario.
    """

    def track(self, t_s: float) -> Track:
        """Where everyone should be at a swarm instant [s], asked in order; the same calls give the same places."""
        ...


class Formation:
    """The whole layout moves as one: from the middle of the area once round it, then again.

    The way is a rectangle on which the formation's edges touch the area's, so that every part of it is overflown when
    the layout is at least half as large as the area.
    """

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._starts = starts
        self._speed = scenario.mobility.speed_m_s
        room = np.maximum(0.0, scenario.world.area_m / 2 - np.abs(starts[:, :2]).max(axis=0))
        east, north = float(room[0]), float(room[1])
        ring = [(east, 0.0), (east, north), (-east, north), (-east, -north), (east, -north), (east, 0.0)]
        self._way = np.array([(0.0, 0.0), *ring])
        self._legs = np.linalg.norm(np.diff(self._way, axis=0), axis=1)
        self._ring_m = float(self._legs[1:].sum())

    def track(self, t_s: float) -> Track:
        offset, velocity = self._offset(self._speed * t_s)
        places = self._starts.copy()
        places[:, :2] += offset
        velocities = np.zeros_like(places)
        velocities[:, :2] = velocity
        return Track(places, velocities)

    def _offset(self, travelled_m: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        if travelled_m > self._legs[0] and self._ring_m > 0:
            travelled_m = self._legs[0] + (travelled_m - self._legs[0]) % self._ring_m
        for leg, length in enumerate(self._legs):
            if travelled_m <= length and length > 0:
                direction = (self._way[leg + 1] - self._way[leg]) / length
                return self._way[leg] + travelled_m * direction, self._speed * direction
            travelled_m -= length
        return self._way[-1], np.zeros(2)


class RandomWaypoint:
    """Constant speed to uniform waypoints, without pause; the leader stays where it is."""

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._speed = scenario.mobility.speed_m_s
        self._half = scenario.world.area_m / 2
        self._random = [stream(scenario.seed, "waypoint", node) for node in scenario.node_ids]
        self._from = starts.copy()
        self._to = starts.copy()
        self._left_at = np.zeros(len(starts))
        self._length = np.zeros(len(starts))
        for i in range(1, len(starts)):
            self._turn(i, 0.0)

    def _turn(self, i: int, t_s: float) -> None:
        random = self._random[i]
        self._from[i] = self._to[i]
        self._to[i, :2] = random.uniform(-self._half, self._half), random.uniform(-self._half, self._half)
        self._left_at[i] = t_s
        self._length[i] = np.linalg.norm(self._to[i] - self._from[i])

    def track(self, t_s: float) -> Track:
        if self._speed == 0:
            return Track(self._from, np.zeros_like(self._from))
        for i in range(1, len(self._from)):
            arrival_s = self._left_at[i] + self._length[i] / self._speed
            while t_s > arrival_s:
                self._turn(i, arrival_s)
                arrival_s += self._length[i] / self._speed
        share = self._speed * (t_s - self._left_at) / np.maximum(self._length, 1e-9)
        share[0] = 0.0
        way = self._to - self._from
        velocities = way * (self._speed / np.maximum(self._length, 1e-9))[:, None]
        velocities[0] = 0.0
        return Track(self._from + way * share[:, None], velocities)


class Crossing:
    """Everyone flies straight through the middle to the point opposite its start, and back, again and again."""

    def __init__(self, starts: Rows, scenario: Scenario) -> None:
        self._starts = starts
        self._speed = scenario.mobility.speed_m_s
        self._length = 2 * np.linalg.norm(starts[:, :2], axis=1)
        self._direction = np.zeros_like(starts)
        self._direction[:, :2] = -starts[:, :2] / np.maximum(self._length / 2, 1e-9)[:, None]

    def track(self, t_s: float) -> Track:
        length = np.maximum(self._length, 1e-9)
        legs, along = np.divmod(self._speed * t_s, length)
        back = legs % 2 == 1
        offset = np.where(back, length - along, along)
        speed = np.where(self._length > 0, np.where(back, -self._speed, self._speed), 0.0)
        return Track(self._starts + self._direction * offset[:, None], self._direction * speed[:, None])


class Guidance:
    """The track of the mobility model, overridden per node by setpoints."""

    def __init__(self, starts: Rows, scenario: Scenario, *, ground_m: Callable[[Rows], Values] | None = None) -> None:
        """`ground_m`: heights of the ground at places [n, 3]; None: a plain at 0."""
        self._ground_m = ground_m or (lambda places: np.zeros(len(places)))
        model = scenario.mobility.model
        self._onboard = model == "onboard"
        """Whether UAVs are flown by their own computers: the world then keeps nobody clear of others."""
        self._see_m = 0.0 if self._onboard else scenario.mobility.see_m
        half = scenario.world.area_m / 2
        reach = np.maximum(half, np.abs(starts[:, :2]).max(axis=0)) if self._onboard else (half, half)
        self._half_east, self._half_north = float(reach[0]), float(reach[1])
        self._starts = starts.copy()
        """Where each UAV holds while neither a mobility model nor a setpoint moves it."""
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

    @property
    def still(self) -> bool:
        """Nothing moves and nothing was asked to."""
        asked = self._setpoints or self._velocities or self._landings
        return self._model is None and not self._onboard and not asked

    def obey(self, node: int, setpoint: Setpoint, *, at: Values, t_s: float) -> None:
        """Take a setpoint of a UAV that is `at` [3] at an instant."""
        here = Enu(*at.tolist())
        row = node - 1
        kind, place, speed_m_s = setpoint.kind, setpoint.position, setpoint.speed_m_s
        if kind is not SetpointKind.LAND and self._landings.pop(row, None) is not None:
            self._grounded.add(row)  # it may stand on the ground, until it is seen clear of it
        self._velocities.pop(row, None)
        if kind is SetpointKind.POSITION:
            self.steer(node, place, speed_m_s=speed_m_s)
            if speed_m_s <= 0 and self._onboard:
                self._hold(row, here)
        elif kind is SetpointKind.VELOCITY:
            self._setpoints.pop(row, None)
            self._velocities[row] = setpoint.velocity, t_s + VELOCITY_LASTS_NS / S
        elif kind is SetpointKind.HOLD:
            self._hold(row, here)
        elif kind is SetpointKind.TAKEOFF:
            self._grounded.add(row)  # until it is clear of the ground
            self.steer(node, Enu(here.east, here.north, place.up), speed_m_s=max(_LEAST_CLIMB_M_S, speed_m_s))
        elif kind is SetpointKind.LAND:
            self._setpoints.pop(row, None)
            self._landings[row] = max(_TOUCHDOWN_M_S, speed_m_s)
        else:
            assert_never(kind)

    def may_touch_down(self, node: int) -> bool:
        """Whether this UAV touches the ground on purpose."""
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
        """Where everyone should be, setpoints not considered."""
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
        if self._landings or self._grounded:
            self._near_the_ground(wish, at)
        return _keep_clear(wish, at, self._see_m) if len(at) > 1 and self._see_m else wish

    def _expire(self, t_s: float, at: Rows) -> None:
        """Who flies at a velocity that was not renewed in time stops."""
        for row in [row for row, (_, until_s) in self._velocities.items() if t_s >= until_s]:
            del self._velocities[row]
            self._hold(row, Enu(*at[row].tolist()))

    def _near_the_ground(self, wish: Rows, at: Rows) -> None:
        """Sink straight down, the slower the nearer the ground; forget who has taken off."""
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
