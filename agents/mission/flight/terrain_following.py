"""Terrain following: the vertical speed that keeps a searching UAV at its height above the ground.

It climbs before the ground rises, by its map, and never sinks below what clears the known obstacles ahead.
"""

from typing import Final

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.units import Enu

_CLIMB_M_S: Final = 2.5
"""The greatest speed of climbing and sinking."""
_HEIGHT_GAIN: Final = 0.5
"""The rate at which a deviation from the wanted height is corrected [1/s]."""


class TerrainFollowing:
    """Chooses the vertical speed of one UAV."""

    def __init__(self, own_motion: OwnMotion, obstacles: KnownObstacles) -> None:
        self._own_motion, self._obstacles = own_motion, obstacles

    def climb_m_s(self, height_m: float, flown: Enu, now_ns: int) -> float:
        """The vertical speed [m/s] to be `height_m` above the ground, for a UAV that flies at the velocity `flown`."""
        here = self._own_motion.position
        climb_m = height_m + self._obstacles.rise_m(here, flown) - self._own_motion.height_m(now_ns)
        climb_m = max(climb_m, self._obstacles.least_up_m(here, flown) - here.up)
        return max(-_CLIMB_M_S, min(_CLIMB_M_S, _HEIGHT_GAIN * climb_m))
