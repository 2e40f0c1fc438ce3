"""How things of a swarm are drawn, in recordings and in the view alike: colors by state, and the attitude of a UAV."""

import math
from typing import Final

from sim.figures import colors
from sim.observation.swarm_state import UavNow

STATUS_COLORS: Final = {
    "not heard": colors.GRAY, "detected": colors.ORANGE, "approached": colors.BLUE, "reached": colors.PINK,
    "inside": colors.SHADE, "among": colors.SHADE,
    "confirmed": colors.GREEN, "mistaken": colors.RED, "reopened": colors.RED,
}  # fmt: skip
"""The color of a survivor by the state of the search for him or her."""
MODE_COLORS: Final = {
    "": colors.BLUE, "search": colors.BLUE, "respond": colors.RED, "deploy": colors.ORANGE, "takeoff": colors.ORANGE,
    "wait": colors.ORANGE, "errand": colors.ORANGE, "lost_link": colors.PINK, "lost_position": colors.PINK,
}  # fmt: skip
"""The color of a UAV by the mode of its mission; in all other modes it flies home, or has landed."""
HOMEWARD_COLOR: Final = colors.GRAY
FALLEN_COLOR: Final = colors.DARK


def mode_color(uav: UavNow) -> str:
    """The color of a UAV in a swarm without clusters."""
    return FALLEN_COLOR if uav.flight == "fallen" else MODE_COLORS.get(uav.mission, HOMEWARD_COLOR)


def link_color(share: float) -> str:
    """The color of a link by the share of copies that arrived, as three classes that a gray print tells apart too."""
    return colors.BLUE if share >= 0.9 else colors.ORANGE if share >= 0.5 else colors.RED


def attitude(uav: UavNow) -> tuple[float, float, float, float]:
    """As a quaternion w, x, y, z in ENU: it tilts towards its acceleration and faces its direction of flight."""
    yaw = math.pi / 2 - uav.yaw_rad  # from east towards north
    east, north, _ = uav.acceleration
    forward = max(-6.0, min(6.0, east * math.cos(yaw) + north * math.sin(yaw)))
    left = max(-6.0, min(6.0, north * math.cos(yaw) - east * math.sin(yaw)))
    pitch, roll = math.atan2(forward, 9.81), -math.atan2(left, 9.81)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return (
        cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
    )  # fmt: skip
