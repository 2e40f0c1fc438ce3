"""The position and velocity of a UAV, by its own receivers."""

from typing import Final

from agents.mission.navigation.known_obstacles import KnownObstacles
from fanet_mw.motion import Motion
from fanet_mw.units import STILL, Enu, S

_FIX_GAIN: Final = 0.15
"""The weight of a position fix against dead reckoning by its velocity."""
_RANGED_NS: Final = 1 * S
"""How long a height from the rangefinder is used."""


class OwnMotion:
    """The motion of one UAV: fixes smoothed by dead reckoning, and the height by rangefinder and map."""

    def __init__(self, position: Enu, obstacles: KnownObstacles) -> None:
        self.position = position
        self._obstacles = obstacles
        self.rise_m = self._rise_m if obstacles.has_hills else None
        """By how much the ground at a place (east, north) is higher than below this UAV; None over level ground."""
        self.velocity = STILL
        self.fixed_ns: int | None = None
        """The instant of the latest fix; None before the first one."""
        self._above_ground: tuple[float, int] | None = None

    def fix(self, position: Enu, velocity: Enu, *, now_ns: int) -> None:
        if self.fixed_ns is None:
            self.position = position
        else:
            seconds, k = (now_ns - self.fixed_ns) / S, _FIX_GAIN
            here = Motion(self.position, velocity, 0).position_at(round(seconds * S))
            off = position.minus(here)
            self.position = Enu(here.east + k * off.east, here.north + k * off.north, here.up + k * off.up)
        self.fixed_ns, self.velocity = now_ns, velocity

    def altimeter(self, above_ground_m: float | None, *, now_ns: int) -> None:
        """The height over whatever is below; None if nothing is within the rangefinder's range."""
        if above_ground_m is not None:
            self._above_ground = above_ground_m, now_ns

    def over_ground(self, now_ns: int) -> Enu:
        """The position, with the height above ground in place of the height above 0."""
        return self.position._replace(up=self.height_m(now_ns))

    def height_m(self, now_ns: int) -> float:
        """The height above ground: by the rangefinder if it is recent and no roof is below, otherwise by the map."""
        ranged = self._above_ground is not None and now_ns - self._above_ground[1] <= _RANGED_NS
        if ranged and self._above_ground is not None and self._obstacles.roof_m(self.position) is None:
            return self._above_ground[0]
        return self.position.up - self._obstacles.ground_m(self.position)

    def _rise_m(self, east_m: float, north_m: float) -> float:
        return self._obstacles.ground_m(Enu(east_m, north_m, 0.0)) - self._obstacles.ground_m(self.position)
