"""Chooses the velocity until the next position fix: the wanted one, changed as little as the constraints allow.

Hard half-planes keep a UAV clear of obstacles (`navigation/known_obstacles.py`) and of other UAVs
(`reciprocal_avoidance.py`), soft ones keep the swarm connected (`connectivity_maintenance.py`). If no velocity
satisfies all, soft ones are dropped, the least important first; if the hard ones contradict each other, the least
violation is flown (`navigation/half_planes.py`).
"""

import math
from typing import Final, Protocol

from agents.mission.flight.terrain_following import TerrainFollowing
from agents.mission.navigation.half_planes import HalfPlane, Velocity, nearest
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.units import Enu

_LANE_GAIN: Final = 0.4
"""The rate at which a deviation from the wanted place is corrected [1/s]."""
_HASTY_GAIN: Final = 0.6
"""The same while ranks are closed: others wait for this UAV."""
_LEAST_M_S: Final = 1.0
"""The least speed at which a UAV flies around a corner."""


class Constraint(Protocol):
    """A limit on the velocities that a UAV may fly."""

    def planes(self, now_ns: int) -> list[HalfPlane]:
        """The half-planes of velocities that are allowed now, the most important first."""
        ...


class VelocityChoice:
    """Chooses the velocity of one UAV. The first hard constraints are always those by the obstacles that it knows."""

    def __init__(
        self,
        own_motion: OwnMotion,
        obstacles: KnownObstacles,
        *,
        most_m_s: float,
        hard: list[Constraint],
        soft: list[Constraint],
    ) -> None:
        self._own_motion, self._obstacles = own_motion, obstacles
        self._terrain = TerrainFollowing(own_motion, obstacles)
        self._most_m_s = most_m_s
        self._hard, self._soft = hard, soft

    def velocity(self, goal: Enu, feed: Enu, now_ns: int, *, hastily: bool = False) -> Enu:
        """The velocity to fly to a place `goal`, which moves at the velocity `feed`."""
        here, obstacles = self._own_motion.position, self._obstacles
        off, gain = goal.minus(here), _HASTY_GAIN if hastily else _LANE_GAIN
        wanted = feed.east + gain * off.east, feed.north + gain * off.north
        corner = obstacles.way_to(here, goal, feed, now_ns=now_ns)
        if corner is not None:
            wanted = self._towards(corner, speed_m_s=math.hypot(*wanted))
        speed = math.hypot(*wanted)
        if speed > self._most_m_s:
            wanted = wanted[0] * self._most_m_s / speed, wanted[1] * self._most_m_s / speed
        share = self._terrain.speed_share(goal.up, Enu(*wanted, 0.0), now_ns)
        wanted = share * wanted[0], share * wanted[1]
        planes = obstacles.planes(here, now_ns)
        planes += [plane for constraint in self._hard for plane in constraint.planes(now_ns)]
        hard = len(planes)
        planes += [plane for constraint in self._soft for plane in constraint.planes(now_ns)]
        east, north = nearest(wanted, planes, limit=self._most_m_s, hard=hard) if planes else wanted
        flat = Enu(east, north, 0.0)
        return flat._replace(up=self._terrain.climb_m_s(goal.up, flat, now_ns))

    def _towards(self, corner: Enu, *, speed_m_s: float) -> Velocity:
        """The velocity to a corner on the way; near the corner as slow as the goal itself requires."""
        off = corner.minus(self._own_motion.position)
        distance = off.horizontal()
        speed = min(self._most_m_s, max(speed_m_s, 0.5 * self._most_m_s), max(_LEAST_M_S, distance))
        return off.east / max(distance, 1e-6) * speed, off.north / max(distance, 1e-6) * speed
