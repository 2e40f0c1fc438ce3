"""Terrain following: the vertical speed that keeps a searching UAV at its height above the ground, and how fast it may
fly so that this is enough.

It climbs and sinks with the ground ahead, by its map, and climbs earlier where that rises faster than it can; where it
rises or falls too fast, the UAV flies slower. It never sinks below what clears the known obstacles ahead.
"""

from typing import Final

from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.own_motion import OwnMotion
from fanet_mw.units import Enu

_LEVEL_M_S: Final = 2.5
"""The greatest speed of climbing and sinking over level ground."""
_CLIMB_M_S: Final = 4.0
_SINK_M_S: Final = 3.0
"""The same over hills."""
_HEIGHT_GAIN: Final = 0.5
"""The rate at which a deviation from the wanted height is corrected [1/s]."""
_TOLERANCE_M: Final = 7.0
"""By how much the height may be wrong before the UAV flies slower."""
_LEAST_SHARE: Final = 0.3
"""The least share of its speed that a UAV flies because of the ground."""
_AHEAD_S: Final = range(1, 9)


class TerrainFollowing:
    """Chooses the vertical speed of one UAV, and limits its speed over steep ground."""

    def __init__(self, own_motion: OwnMotion, obstacles: KnownObstacles) -> None:
        self._own_motion, self._obstacles = own_motion, obstacles

    def speed_share(self, height_m: float, wanted: Enu, now_ns: int) -> float:
        """The share of the speed of a velocity at which the UAV can still stay `height_m` above the ground."""
        off_m, share = height_m - self._own_motion.height_m(now_ns), 1.0
        for second, rise_m in zip(_AHEAD_S, self._rises_m(wanted), strict=False):
            climb_m, sink_m = off_m + rise_m - _TOLERANCE_M, -off_m - rise_m - _TOLERANCE_M
            if climb_m > 0:
                share = min(share, second * _CLIMB_M_S / climb_m)
            if sink_m > 0:
                share = min(share, second * _SINK_M_S / sink_m)
        return max(_LEAST_SHARE, share)

    def climb_m_s(self, height_m: float, flown: Enu, now_ns: int) -> float:
        """The vertical speed [m/s] to be `height_m` above the ground, for a UAV that flies at the velocity `flown`."""
        here, own_m = self._own_motion.position, self._own_motion.height_m(now_ns)
        rises_m = self._rises_m(flown)
        climb, most, least = _HEIGHT_GAIN * (height_m - own_m), _LEVEL_M_S, -_LEVEL_M_S
        if rises_m:
            most, least = _CLIMB_M_S, -_SINK_M_S
            climb += rises_m[0]
            late_m = max(
                height_m - own_m + m - _TOLERANCE_M - s * _CLIMB_M_S for s, m in zip(_AHEAD_S, rises_m, strict=True)
            )
            climb = max(climb, _CLIMB_M_S + late_m)
        climb = max(climb, _HEIGHT_GAIN * (self._obstacles.least_up_m(here, flown) - here.up))
        return max(least, min(most, climb))

    def _rises_m(self, velocity: Enu) -> list[float]:
        return self._obstacles.rises_m(self._own_motion.position, velocity, _AHEAD_S)
