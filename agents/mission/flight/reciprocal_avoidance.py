"""Collision avoidance in a search: half-planes of velocities that keep a UAV clear of other UAVs.

The method is ORCA (van den Berg, Guy, Lin, Manocha: Reciprocal n-Body Collision Avoidance, 2011): each of two
UAVs makes half of the change that leads out of the velocity obstacle. A UAV knows another by a received position and
velocity. The older they are, the larger is the required clearance, because the other may have turned since.
"""

import math
from typing import Final

from agents.mission.navigation.half_planes import HalfPlane, Velocity
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, S

_LEVEL_M: Final = 4.0
"""UAVs whose heights differ by more than twice this, and who keep them, are not in each other's way."""
CLEARANCE_M: Final = 10.0
"""The distance that is kept from other UAVs, in addition to the error of their positions."""
_HORIZON_S: Final = 6.0
"""A collision is avoided if it would happen within this time."""
_WATCH_M: Final = 150.0
"""UAVs farther away than this are not considered."""
_TURN_M_S2: Final = 1.0
"""The mean acceleration with which another UAV is assumed to have flown since it was last received."""
_MOST_ERROR_M: Final = 12.0
"""The greatest error of an extrapolated position that is allowed for."""


class ReciprocalAvoidance:
    """Constraints by neighbors and by flying bodies that the radar shows; clearance grows with a position's age."""

    def __init__(self, own_motion: OwnMotion, neighbors: NeighborMotions, obstacles: KnownObstacles) -> None:
        self._own_motion, self._neighbors, self._obstacles = own_motion, neighbors, obstacles

    def planes(self, now_ns: int) -> list[HalfPlane]:
        here, flown = self._own_motion.position, self._own_motion.velocity
        planes: list[tuple[float, HalfPlane]] = []
        seen = [Motion(*mover) for mover in self._obstacles.movers(now_ns)]
        for motion in (*self._neighbors.all(now_ns=now_ns), *seen):
            offset = motion.offset_from(here, now_ns)
            distance = math.hypot(offset.east, offset.north)
            climb = flown.up - motion.velocity.up
            apart_soon = abs(offset.up - climb * 3.0)
            if distance > _WATCH_M or (abs(offset.up) > 2 * _LEVEL_M and apart_soon > _LEVEL_M):
                continue
            plane = avoidance_plane(
                offset,
                (flown.east, flown.north),
                (motion.velocity.east, motion.velocity.north),
                clearance_m=CLEARANCE_M + position_error_m((now_ns - motion.at_ns) / S),
                horizon_s=_HORIZON_S,
                share=0.5,
            )
            planes.append((distance, plane))
        return [plane for _, plane in sorted(planes)]


def position_error_m(age_s: float) -> float:
    return min(_MOST_ERROR_M, 0.5 * _TURN_M_S2 * age_s * age_s)


def avoidance_plane(
    offset: Enu, velocity: Velocity, other_velocity: Velocity, *, clearance_m: float, horizon_s: float, share: float
) -> HalfPlane:
    """Velocities that avoid a body at `offset` within the horizon; `share` of the change: 0.5 if both avoid, else 1."""
    px, py = offset.east, offset.north
    vx, vy = velocity[0] - other_velocity[0], velocity[1] - other_velocity[1]
    distance2 = px * px + py * py
    radius2 = clearance_m * clearance_m
    if distance2 <= radius2:  # already too near: part within a second
        distance = math.sqrt(distance2)
        nx, ny = (-px / distance, -py / distance) if distance > 1e-6 else (1.0, 0.0)
        away = clearance_m - distance  # [m] within one second
        change = away - (vx * nx + vy * ny)
        return HalfPlane(nx, ny, velocity[0] * nx + velocity[1] * ny + share * change)
    wx, wy = vx - px / horizon_s, vy - py / horizon_s
    w_length2 = wx * wx + wy * wy
    dot = wx * px + wy * py
    if dot < 0.0 and dot * dot > radius2 * w_length2:  # the nearest border is the cut-off circle
        w_length = math.sqrt(w_length2)
        nx, ny = wx / w_length, wy / w_length
        change = clearance_m / horizon_s - w_length
    else:  # the nearest border is a leg of the cone
        leg = math.sqrt(distance2 - radius2)
        if px * wy - py * wx > 0.0:
            dx, dy = (px * leg - py * clearance_m) / distance2, (px * clearance_m + py * leg) / distance2
        else:
            dx, dy = -(px * leg + py * clearance_m) / distance2, -(-px * clearance_m + py * leg) / distance2
        nx, ny = -dy, dx
        change = -(vx * nx + vy * ny)
    return HalfPlane(nx, ny, velocity[0] * nx + velocity[1] * ny + share * change)
