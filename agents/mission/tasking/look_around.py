"""Where a responder looks that has come to a survivor's estimated place and sees nobody there.

It flies to the most probable place of the phone at which no camera has looked yet, the nearer ones first and those that
are nearer to another UAV last, and from there to the next one. The powers that it receives on the way change what is
probable.
"""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.looked_at import LookedAt
from agents.mission.finding.phone_localization import PhoneFilter
from fanet_mw.units import Enu, S

_LIKELY: Final = 9.0
"""Places less probable than the most probable one by more than this are not looked at (twice a log-likelihood)."""
_PER_M: Final = 1 / 100.0
"""By how much a place must be more probable to be chosen although it is a metre farther away."""
_OTHERS: Final = 2.0
"""By how much a place must be more probable to be chosen although another UAV is nearer to it."""
_EVERY_NS: Final = 1 * S
"""The interval at which the next place is chosen anew."""
_THERE_M: Final = 10.0


class LookAround:
    """The next place at which one UAV looks for a survivor."""

    def __init__(self, looked_at: LookedAt) -> None:
        self._looked_at = looked_at
        self._survivor: int | None = None
        self._next: tuple[float, float] | None = None
        self._chosen_ns = 0

    def next_place(
        self, survivor: int, phone: PhoneFilter, here: Enu, now_ns: int, *, others: Sequence[Enu] = ()
    ) -> tuple[float, float] | None:
        """East and north of the place to look at next, given where `others` look likewise; None if there is none."""
        if not self._looked_at.has_camera:
            return None
        if survivor != self._survivor:
            self._survivor, self._next = survivor, None
        there = self._next is not None and math.hypot(self._next[0] - here.east, self._next[1] - here.north) < _THERE_M
        if self._next is None or there or now_ns - self._chosen_ns >= _EVERY_NS:
            self._next, self._chosen_ns = self._choose(phone, here, others), now_ns
        return self._next

    def _choose(self, phone: PhoneFilter, here: Enu, others: Sequence[Enu]) -> tuple[float, float] | None:
        best: tuple[float, float, float] | None = None
        for east, north, deficit in phone.likely_cells(_LIKELY):
            if self._looked_at.sides(east, north):
                continue
            away_m = math.hypot(east - here.east, north - here.north)
            cost = deficit / 2 + _PER_M * away_m
            if any(math.hypot(east - other.east, north - other.north) <= away_m for other in others):
                cost += _OTHERS
            if best is None or (cost, east, north) < best:
                best = cost, east, north
        return None if best is None else best[1:]
