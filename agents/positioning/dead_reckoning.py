"""Dead reckoning while GPS is out: the last position, moved by a velocity that is measured without satellites.

    position(t) = last estimate + velocity x time        (inertial sensors and optical flow drift, so the estimate does)

A short outage matters little: 0.1 m/s of drift is 6 m after a minute.
"""

from typing import Final

from fanet_mw.bus.messages import Gps, Inertial
from fanet_mw.units import MS, Enu, S

_OUT_NS: Final = 500 * MS
"""GPS is taken to be out when the last fix is older than this."""
_SETTLE: Final = 0.15
"""The weight of a fix against dead reckoning, which averages the errors of successive fixes."""


class DeadReckoning:
    """The position of one UAV, with or without GPS."""

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
