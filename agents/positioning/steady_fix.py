"""Averages inaccurate GPS fixes of a UAV along the track that its velocity gives.

    estimate += velocity x time;  estimate += max(gain, 1 / fixes so far) x (fix - estimate)

If the errors of fixes are independent, the error of the estimate is sqrt(gain / (2 - gain)) times that of a fix.
Velocities are measured by Doppler shift, much more accurately than positions; the error of the velocity appears as
error x time between fixes / gain.
"""

import math
from typing import Final

from fanet_mw.bus.messages import Gps
from fanet_mw.units import Enu, S

_WANTED: Final = 0.01
"""The wanted error of the estimate, as a share of the radio range; timetables from positions tolerate that much."""
_NEGLIGIBLE: Final = 0.02
"""Fixes with an error below this share of the radio range are used as they are."""


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
