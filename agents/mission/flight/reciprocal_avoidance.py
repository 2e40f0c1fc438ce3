"""Constraints on a UAV's velocity: it must stay clear of other UAVs, and within reach of those that it is tied to.

Collision avoidance is ORCA (van den Berg, Guy, Lin, Manocha: Reciprocal n-Body Collision Avoidance, 2011): each of two
UAVs makes half of the change that leads out of the velocity obstacle. A UAV knows another by a received position and
velocity. The older they are, the larger is the required clearance, because the other may have turned since.
"""

import math
from typing import Final

from agents.mission.navigation.half_planes import HalfPlane, Velocity
from fanet_mw.units import Enu

_TURN_M_S2: Final = 1.0
"""The mean acceleration with which another UAV is assumed to have flown since it was last received."""
_MOST_ERROR_M: Final = 12.0
"""The greatest error of an extrapolated position that is allowed for."""


def position_error_m(age_s: float) -> float:
    """The greatest distance of another UAV from its extrapolated position, `age_s` after its last message."""
    return min(_MOST_ERROR_M, 0.5 * _TURN_M_S2 * age_s * age_s)


def avoiding(
    offset: Enu, velocity: Velocity, other_velocity: Velocity, *, clearance_m: float, horizon_s: float, share: float
) -> HalfPlane:
    """The half-plane of velocities that avoid another body within the horizon.

    `offset` leads from this UAV to the body. `share` is this UAV's share of the change: 0.5 if both avoid, otherwise 1.
    """
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


def staying_near(offset: Enu, other_velocity: Velocity, *, tether_m: float, within_s: float) -> HalfPlane | None:
    """The half-plane of velocities that keep this UAV within `tether_m` of another for `within_s`; None if the other is
    so near that no limit is needed.

    Both UAVs may fly apart, so each of them may use half of the distance that is left. If none is left, this UAV alone
    makes up for what is missing.
    """
    distance = math.hypot(offset.east, offset.north)
    if distance < 0.3 * tether_m:
        return None
    nx, ny = offset.east / distance, offset.north / distance
    slack_m = tether_m - distance
    parting = (slack_m / within_s) * (0.5 if slack_m > 0 else 1.0)
    return HalfPlane(nx, ny, other_velocity[0] * nx + other_velocity[1] * ny - parting)
