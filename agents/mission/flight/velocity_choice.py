"""Chooses the velocity to fly until the next position fix: the wanted velocity, changed as little as the constraints
allow.

Constraints are half-planes of velocities. Hard ones keep a UAV clear of obstacles and other UAVs. Soft ones keep it
within radio reach of those UAVs with which it keeps the swarm connected. If no velocity satisfies all of them, soft
constraints are dropped, the least important first. If the hard ones alone contradict each other, the velocity with the
least violation is flown (`half_planes.py`).
"""

import math
from typing import Final, Protocol

from agents.mission.flight.reciprocal_avoidance import avoiding, position_error_m, staying_near
from agents.mission.formation.formation_place import FormationPlace
from agents.mission.navigation.half_planes import HalfPlane, Velocity, nearest
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.navigation import Navigation
from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, S

_LANE_GAIN: Final = 0.4
"""The rate at which a deviation from the wanted place is corrected [1/s]."""
_CLIMB_M_S: Final = 2.5
"""The greatest speed of climbing and sinking."""
_LEAST_M_S: Final = 1.0
"""The least speed at which a UAV flies around a corner."""
_LEVEL_M: Final = 4.0
"""UAVs whose heights differ by more than twice this are on different levels, and not in each other's way once both keep
their heights."""
_CLEARANCE_M: Final = 10.0
"""The distance that is kept from other UAVs, in addition to the error of their positions."""
_HORIZON_S: Final = 6.0
"""A collision is avoided if it would happen within this time."""
_WATCH_M: Final = 150.0
"""UAVs farther away than this are not considered."""
_TETHER: Final = 0.95
"""The greatest distance of two UAVs that must stay connected, as a share of the radio's reach."""
_TETHER_S: Final = 4.0
"""A UAV may use up the rest of that distance in this time at the earliest."""


class Constraint(Protocol):
    """A limit on the velocities that a UAV may fly."""

    def planes(self, now_ns: int) -> list[HalfPlane]:
        """The half-planes of velocities that are allowed now, the most important first."""
        ...


class VelocityChoice:
    """Chooses the velocity of one UAV, under hard and soft constraints."""

    def __init__(
        self,
        navigation: Navigation,
        obstacles: KnownObstacles,
        *,
        most_m_s: float,
        hard: list[Constraint],
        soft: list[Constraint],
    ) -> None:
        self._navigation, self._obstacles = navigation, obstacles
        self._most_m_s = most_m_s
        self._hard, self._soft = hard, soft

    def velocity(self, goal: Enu, feed: Enu, now_ns: int) -> Enu:
        """The velocity to fly to a place `goal`, which moves at the velocity `feed`."""
        here, obstacles = self._navigation.position, self._obstacles
        off = goal.minus(here)
        wanted = feed.east + _LANE_GAIN * off.east, feed.north + _LANE_GAIN * off.north
        corner = obstacles.way_to(here, goal, feed, now_ns=now_ns)
        if corner is not None:
            wanted = self._towards(corner, speed_m_s=math.hypot(*wanted))
        speed = math.hypot(*wanted)
        if speed > self._most_m_s:
            wanted = wanted[0] * self._most_m_s / speed, wanted[1] * self._most_m_s / speed
        planes = [plane for constraint in self._hard for plane in constraint.planes(now_ns)]
        hard = len(planes)
        planes += [plane for constraint in self._soft for plane in constraint.planes(now_ns)]
        east, north = nearest(wanted, planes, limit=self._most_m_s, hard=hard) if planes else wanted
        velocity = Enu(east, north, 0.0)
        climb_m = goal.up + obstacles.climb_m(here, velocity) - self._navigation.height_m(now_ns)
        climb_m = max(climb_m, obstacles.least_up_m(here, velocity) - here.up)
        return velocity._replace(up=max(-_CLIMB_M_S, min(_CLIMB_M_S, 0.5 * climb_m)))

    def _towards(self, corner: Enu, *, speed_m_s: float) -> Velocity:
        """The velocity to a corner on the way around an obstacle; near the corner it is as slow as the goal itself
        requires.
        """
        off = corner.minus(self._navigation.position)
        distance = math.hypot(off.east, off.north)
        speed = min(self._most_m_s, max(speed_m_s, 0.5 * self._most_m_s), max(_LEAST_M_S, distance))
        return off.east / max(distance, 1e-6) * speed, off.north / max(distance, 1e-6) * speed


class ClearOfObstacles:
    """Constraints by walls, by no-fly areas, and by what the radar shows."""

    def __init__(self, navigation: Navigation, obstacles: KnownObstacles) -> None:
        self._navigation, self._obstacles = navigation, obstacles

    def planes(self, now_ns: int) -> list[HalfPlane]:
        return self._obstacles.planes(self._navigation.position, now_ns)


class ClearOfOthers:
    """Collision avoidance by ORCA, with neighbors at their received positions and with flying bodies that the radar
    shows. The clearance grows with the age of the position.
    """

    def __init__(self, navigation: Navigation, neighbors: NeighborMotions, obstacles: KnownObstacles) -> None:
        self._navigation, self._neighbors, self._obstacles = navigation, neighbors, obstacles

    def planes(self, now_ns: int) -> list[HalfPlane]:
        here, flown = self._navigation.position, self._navigation.velocity
        planes: list[tuple[float, HalfPlane]] = []
        seen = [Motion(*mover) for mover in self._obstacles.movers(now_ns)]
        for motion in (*self._neighbors.all(now_ns=now_ns), *seen):
            offset = motion.position_at(now_ns).minus(here)
            distance = math.hypot(offset.east, offset.north)
            climb = flown.up - motion.velocity.up
            apart_soon = abs(offset.up - climb * 3.0)
            if distance > _WATCH_M or (abs(offset.up) > 2 * _LEVEL_M and apart_soon > _LEVEL_M):
                continue
            plane = avoiding(
                offset,
                (flown.east, flown.north),
                (motion.velocity.east, motion.velocity.north),
                clearance_m=_CLEARANCE_M + position_error_m((now_ns - motion.at_ns) / S),
                horizon_s=_HORIZON_S,
                share=0.5,
            )
            planes.append((distance, plane))
        return [plane for _, plane in sorted(planes)]


class InReach:
    """Keeps a UAV of a team, or a relay, within radio reach of the places to which it is tied (`Shape.tethers`), and a
    follower within reach of the nearest UAV of its team.
    """

    def __init__(
        self, navigation: Navigation, neighbors: NeighborMotions, formation: FormationPlace, *, reach_m: float
    ) -> None:
        self._navigation, self._neighbors = navigation, neighbors
        self._formation = formation
        self._tether_m = _TETHER * reach_m

    def planes(self, now_ns: int) -> list[HalfPlane]:
        plan, pattern, place = self._formation.plan, self._formation.pattern, self._formation.place
        if plan is None or pattern is None or place is None or not self._formation.is_taken_up(now_ns):
            return []
        planes = []
        for other in pattern.shape.tethers(place) or self._nearest(pattern.line(place), now_ns):
            motion = self._neighbors.motion(plan.nodes[other], now_ns=now_ns)
            if motion is None:
                continue
            plane = staying_near(
                motion.position_at(now_ns).minus(self._navigation.position),
                (motion.velocity.east, motion.velocity.north),
                tether_m=self._tether_m,
                within_s=_TETHER_S,
            )
            if plane is not None:
                planes.append(plane)
        return planes

    def _nearest(self, places: range, now_ns: int) -> tuple[int, ...]:
        """Of these places, the one whose holder is nearest to this UAV; empty if no holder was received recently."""
        plan = self._formation.plan
        assert plan is not None, "who has a place has a plan"
        near = [
            (motion.position_at(now_ns).minus(self._navigation.position).norm(), other)
            for other in places
            if (motion := self._neighbors.motion(plan.nodes[other], now_ns=now_ns)) is not None
        ]
        return (min(near)[1],) if near else ()
