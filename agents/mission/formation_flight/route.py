"""The route of a swarm in formation flight: waypoints that its leader passes one after the other."""

import math
from collections.abc import Sequence
from typing import Final

from fanet_mw.units import STILL, Enu

_PASSED_M: Final = 30.0
"""When the leader is this near to a waypoint, it flies on to the next one."""
_BRAKING_S: Final = 4.0
"""The leader approaches the last waypoint so slowly that the rest of the way would take at least this time."""


class Route:
    """The waypoints passed; every UAV that receives the leader counts them, as any head may become leader."""

    def __init__(self, points: Sequence[tuple[float, float]], *, speed_m_s: float) -> None:
        self._points = points
        self._speed_m_s = speed_m_s
        self._passed = 0
        """The index of the waypoint to which the leader flies; it stays at the last one."""

    def led_at(self, leader: Enu) -> None:
        """The leader is at this position: count the waypoint as passed if it is near."""
        if self._passed < len(self._points) and self._away_m(leader) <= _PASSED_M:
            self._passed = min(self._passed + 1, len(self._points) - 1)

    def velocity(self, here: Enu) -> Enu:
        """The velocity at which the leader must fly; zero at the end, and without a route."""
        if not self._points:
            return STILL
        east, north = self._points[self._passed]
        away_m, speed = self._away_m(here), self._speed_m_s
        if self._passed == len(self._points) - 1:
            speed = min(speed, away_m / _BRAKING_S)
        share = speed / max(away_m, 1e-6)
        return Enu(share * (east - here.east), share * (north - here.north), 0.0)

    def _away_m(self, place: Enu) -> float:
        east, north = self._points[self._passed]
        return math.hypot(east - place.east, north - place.north)
