"""By how much GPS is wrong in height, as a flight controller finds out where it starts: its height there is known.

The error of GPS in height is metres, and nearly the same for half an hour; flight controllers therefore take home for
the reference, and the barometer for the height over it.
"""

from typing import Final

from fanet_mw.bus.messages import Gps

_WEIGHT: Final = 0.1
_STILL_M_S: Final = 0.4
"""What climbs or sinks faster than that does not stand; the noise of GPS velocities is a tenth of it."""
_FIXES: Final = 10
"""A UAV that is in the air from the start is compared with its start for so many fixes."""


class HeightReference:
    """The error of one receiver."""

    def __init__(self, start_m: float) -> None:
        self._start_m = start_m
        self._off_m = 0.0
        self._count = 0
        self._has_flown = False

    def off_m(self, fix: Gps, *, stands: bool) -> float:
        """The error, after another fix; `stands`: the UAV is not known to have taken off."""
        moves = abs(fix.velocity.up) > _STILL_M_S
        self._has_flown |= moves or (not stands and self._count >= _FIXES)
        if not self._has_flown:
            self._count += 1
            self._off_m += max(_WEIGHT, 1 / self._count) * (fix.position.up - self._start_m - self._off_m)
        return self._off_m
