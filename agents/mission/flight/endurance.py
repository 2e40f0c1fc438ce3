"""The endurance of a UAV: how much charge it may spend in addition to the way home and a reserve.

rate      share of the capacity that one second of flight takes, from the readings of the last `_WINDOW_NS`
effort    what flying takes at an airspeed v: 5/6 + 1/6 exp(-v / 4 m/s) + 7/8 (v / greatest)^3 of hovering
needed    rate x (effort then / effort lately, at least 1) x (way home / ground speed + height / sinking speed + wait) x
          `_DETOUR`; ground speed and airspeed on the way home by the wind as it is measured
margin    charge - reserve - needed; at 0 the UAV flies home, whatever it is doing
"""

import math
import statistics
from collections import deque
from typing import Final, NamedTuple

from fanet_mw.units import STILL, Enu, S

_WINDOW_NS: Final = 20 * S
_LEAST_WINDOW_NS: Final = 5 * S
"""While the readings span less time than this, the rate is taken to be 0."""
_DETOUR: Final = 1.2
"""The factor by which the way home may take longer than reckoned."""
_SINK_M_S: Final = 1.0
"""The speed of sinking that is assumed for the landing."""
_ROTORS_M_S: Final = 4.0
"""Rotors take less in motion, from about the speed on of the air that they suck in when hovering."""
_LEAST_M_S: Final = 0.3
"""The speed over ground that is assumed where the wind lets a UAV hardly come home."""


class _Reading(NamedTuple):
    now_ns: int
    charge: float
    effort: float


class Endurance:
    """The battery of one UAV, by its readings."""

    def __init__(self, home: Enu, *, speed_m_s: float, reserve: float, airspeed_m_s: float = math.inf) -> None:
        """`airspeed_m_s`: the greatest speed that this UAV can fly through the air."""
        self._home = home
        self._speed_m_s, self._airspeed_m_s = speed_m_s, airspeed_m_s
        self.reserve = reserve
        """The share of the charge with which the UAV is to land."""
        self.wait_s = 0.0
        """How long others may land before this UAV."""
        self._wind = STILL
        self._readings: deque[_Reading] = deque()

    def on_wind(self, velocity: Enu) -> None:
        self._wind = velocity

    def read(self, charge: float, *, now_ns: int, velocity: Enu = STILL) -> None:
        """A reading of the battery: the share of the capacity that is left. `velocity`: how the UAV flies."""
        effort = self._effort(velocity.minus(self._wind).horizontal())
        self._readings.append(_Reading(now_ns, charge, effort))
        while now_ns - self._readings[0].now_ns > _WINDOW_NS:
            self._readings.popleft()

    def margin(self, here: Enu) -> float:
        """The share of the capacity that may be spent before the UAV must fly home; 1 before the first reading."""
        if not self._readings:
            return 1.0
        charge = self._readings[-1].charge
        return max(0.0, min(1.0, charge - self.reserve - self._rate_per_s() * self._home_s(here)))

    def _rate_per_s(self) -> float:
        first, last = self._readings[0], self._readings[-1]
        if last.now_ns - first.now_ns < _LEAST_WINDOW_NS:
            return 0.0
        return max(0.0, first.charge - last.charge) * S / (last.now_ns - first.now_ns)

    def _home_s(self, here: Enu) -> float:
        """The time to the ground at home; each second of it counts as one that takes as much as those before it."""
        lately = statistics.fmean(reading.effort for reading in self._readings)
        speed_m_s, airspeed_m_s = self._homeward(here)
        way_s = here.horizontal_to(self._home) / speed_m_s * max(1.0, self._effort(airspeed_m_s) / lately)
        over_s = max(0.0, here.up) / _SINK_M_S + self.wait_s
        return _DETOUR * (way_s + over_s * max(1.0, self._effort(self._wind.horizontal()) / lately))

    def _homeward(self, here: Enu) -> tuple[float, float]:
        """The speed over ground and the airspeed on the straight way home."""
        way = self._home.minus(here)
        distance_m, wind = way.horizontal(), self._wind
        if distance_m < 1.0 or wind == STILL:
            return self._speed_m_s, self._speed_m_s
        ahead = (wind.east * way.east + wind.north * way.north) / distance_m
        aside2 = max(0.0, wind.horizontal() ** 2 - ahead * ahead)
        possible = math.sqrt(max(0.0, self._airspeed_m_s**2 - aside2)) + ahead
        speed_m_s = max(_LEAST_M_S, min(self._speed_m_s, possible))
        return speed_m_s, math.hypot(speed_m_s - ahead, math.sqrt(aside2))

    def _effort(self, airspeed_m_s: float) -> float:
        drag = 7 / 8 * (airspeed_m_s / self._airspeed_m_s) ** 3
        return (5 + math.exp(-airspeed_m_s / _ROTORS_M_S)) / 6 + drag
