"""The position of a UAV when GPS is inaccurate or out: averaged fixes, and dead reckoning.

    estimate += velocity x time;  estimate += max(gain, 1 / fixes so far) x (fix - estimate)

If the errors of fixes are independent, the error of the estimate is sqrt(gain / (2 - gain)) times that of a fix.
Velocities are measured by Doppler shift, much more accurately than positions; the error of the velocity appears as
error x time between fixes / gain.
"""

import math
from typing import Final

from fanet_mw.bus.messages import Gps, Inertial
from fanet_mw.units import MS, Enu, S

_WANTED: Final = 0.01
"""The wanted error of the estimate, as a share of the radio range; timetables from positions tolerate that much."""
_NEGLIGIBLE: Final = 0.02
"""Fixes with an error below this share of the radio range are used as they are."""
_OUT_NS: Final = 500 * MS
"""GPS is taken to be out when the last fix is older than this."""
_SETTLE: Final = 0.15
"""The weight of a fix against dead reckoning, which averages the errors of successive fixes."""


class SteadyFix:
    """The position estimate of one UAV."""

    def __init__(self, *, sigma_m: float, range_m: float) -> None:
        self._gain = gain(sigma_m=sigma_m, range_m=range_m)
        self._at: Enu | None = None
        self._t_ns = 0
        self._count = 1

    def position(self, fix: Gps) -> Enu:
        """The estimate after another fix."""
        if self._at is None or self._gain == 1.0:
            self._at = fix.position
        else:
            here = self._at.plus(fix.velocity, (fix.t_ns - self._t_ns) / S)
            self._count += 1
            self._at = here.plus(fix.position.minus(here), max(self._gain, 1 / self._count))
        self._t_ns = fix.t_ns
        return self._at


def gain(*, sigma_m: float, range_m: float) -> float:
    """The weight of a fix with which the estimate has the wanted error; 1 for fixes that are accurate enough."""
    if sigma_m <= _NEGLIGIBLE * range_m:
        return 1.0
    share = _WANTED * range_m / sigma_m
    return 2 * math.pow(share, 2) / (1 + math.pow(share, 2))


def error_m(*, sigma_m: float, range_m: float) -> float:
    """The standard deviation of the estimate along each axis, if the errors of fixes are independent."""
    k = gain(sigma_m=sigma_m, range_m=range_m)
    return sigma_m * math.sqrt(k / (2 - k))


class DeadReckoning:
    """The position while GPS is out: the last one, moved by a velocity that is measured without satellites."""

    def __init__(self) -> None:
        self._at: Enu | None = None
        self._t_ns = 0
        self._fix_ns: int | None = None

    def fix(self, fix: Gps) -> None:
        if self._at is None:
            self._at = fix.position
        else:
            here = self._moved(fix.velocity, fix.t_ns)
            self._at = here.plus(fix.position.minus(here), _SETTLE)
        self._t_ns = self._fix_ns = fix.t_ns

    def velocity(self, reading: Inertial) -> Gps | None:
        """A velocity measured without GPS; returns a fix that takes the place of GPS's while that is out."""
        if self._at is None or self._fix_ns is None or reading.t_ns - self._fix_ns <= _OUT_NS:
            return None
        self._at, self._t_ns = self._moved(reading.velocity, reading.t_ns), reading.t_ns
        return Gps(reading.t_ns, self._at, reading.velocity)

    def _moved(self, velocity: Enu, now_ns: int) -> Enu:
        assert self._at is not None, "there is a position to move on from"
        return self._at.plus(velocity, (now_ns - self._t_ns) / S)
