"""The endurance of a UAV: how much charge it may spend in addition to the way home and a reserve.

rate      share of the capacity that one second of flight takes, from the readings of the last `_WINDOW_NS`
needed    rate x (way home / speed + height / sinking speed) x `_DETOUR`
margin    charge - reserve - needed; at 0 the UAV flies home, whatever it is doing
"""

from collections import deque
from typing import Final

from fanet_mw.units import Enu, S

_WINDOW_NS: Final = 20 * S
_LEAST_WINDOW_NS: Final = 5 * S
"""While the readings span less time than this, the rate is taken to be 0."""
_DETOUR: Final = 1.2
"""The factor by which the way home may take longer, because of wind and waiting."""
_SINK_M_S: Final = 1.0
"""The speed of sinking that is assumed for the landing."""


class Endurance:
    """The battery of one UAV, by its readings."""

    def __init__(self, home: Enu, *, speed_m_s: float, reserve: float) -> None:
        self._home = home
        self._speed_m_s = speed_m_s
        self.reserve = reserve
        """The share of the charge with which the UAV is to land."""
        self._readings: deque[tuple[int, float]] = deque()

    def read(self, charge: float, *, now_ns: int) -> None:
        """A reading of the battery: the share of the capacity that is left."""
        self._readings.append((now_ns, charge))
        while now_ns - self._readings[0][0] > _WINDOW_NS:
            self._readings.popleft()

    def margin(self, here: Enu) -> float:
        """The share of the capacity that may still be spent before the UAV must fly home; 1 before
        the first reading.
        """
        if not self._readings:
            return 1.0
        charge = self._readings[-1][1]
        return max(0.0, min(1.0, charge - self.reserve - self._rate_per_s() * self._home_s(here)))

    def _rate_per_s(self) -> float:
        (first_ns, first), (last_ns, last) = self._readings[0], self._readings[-1]
        if last_ns - first_ns < _LEAST_WINDOW_NS:
            return 0.0
        return max(0.0, first - last) * S / (last_ns - first_ns)

    def _home_s(self, here: Enu) -> float:
        away_m = here.minus(self._home).horizontal()
        return _DETOUR * (away_m / self._speed_m_s + max(0.0, here.up) / _SINK_M_S)
