"""Where a responder looks that has come to a survivor's estimated place and sees nobody there.

It flies to the most probable place of the phone at which no camera has looked yet, the nearer ones first and those that
are nearer to another UAV last, and from there to the next one. The powers that it receives on the way change what is
probable. Where it is held back, say because the swarm would lose it, it looks elsewhere first.
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
_STANDS_M: Final = 6.0
_STANDS_NS: Final = 3 * S
"""A UAV that has come no farther than `_STANDS_M` in this time is held back: it turns round in less."""
_SAME_POINT_M: Final = 25.0
_AVOIDED_NS: Final = 15 * S
"""How long a UAV that was held back looks in other directions."""
_AVOIDED_COS: Final = 0.5
"""The cosine of the greatest angle between the direction in which it was held back and those that it avoids."""


class Headway:
    """Whether one UAV gets on to the point to which it wants to fly."""

    def __init__(self) -> None:
        self._point: tuple[float, float] | None = None
        self._stood_at: Enu | None = None
        self._since_ns = 0

    def is_held_back(self, point: tuple[float, float], here: Enu, now_ns: int) -> bool:
        """True if this UAV has hardly moved for a while, all the time on its way to this point."""
        stands = self._stood_at is not None and self._stood_at.horizontal_to(here) <= _STANDS_M
        if not stands or self._point is None or math.dist(self._point, point) > _SAME_POINT_M:
            self._point, self._stood_at, self._since_ns = point, here, now_ns
        return now_ns - self._since_ns >= _STANDS_NS


class LookAround:
    """The next place at which one UAV looks for a survivor."""

    def __init__(self, looked_at: LookedAt) -> None:
        self._looked_at = looked_at
        self._survivor: int | None = None
        self._next: tuple[float, float] | None = None
        self._chosen_ns = 0
        self._headway = Headway()
        self._avoided = 0.0, 0.0
        """The direction in which this UAV was held back last, as a unit vector to east and north."""
        self._avoided_until_ns = 0

    def next_place(
        self, survivor: int, phone: PhoneFilter, here: Enu, now_ns: int, *, others: Sequence[Enu] = ()
    ) -> tuple[float, float] | None:
        """East and north of the place to look at next, given where `others` look likewise; None if there is none."""
        if not self._looked_at.has_camera:
            return None
        if survivor != self._survivor:
            self._survivor, self._next, self._avoided_until_ns = survivor, None, 0
        there = self._next is not None and math.hypot(self._next[0] - here.east, self._next[1] - here.north) < _THERE_M
        if self._next is None or there or now_ns - self._chosen_ns >= _EVERY_NS:
            if self._next is not None and not there and self._headway.is_held_back(self._next, here, now_ns):
                self._avoid(self._next, here, now_ns)
            beside = self._choose(phone, here, others, avoiding=True) if now_ns < self._avoided_until_ns else None
            self._next, self._chosen_ns = beside or self._choose(phone, here, others), now_ns
        return self._next

    def _avoid(self, place: tuple[float, float], here: Enu, now_ns: int) -> None:
        east_m, north_m = place[0] - here.east, place[1] - here.north
        away_m = math.hypot(east_m, north_m)
        self._avoided, self._avoided_until_ns = (east_m / away_m, north_m / away_m), now_ns + _AVOIDED_NS

    def _is_avoided(self, east_m: float, north_m: float) -> bool:
        """True for a place, as seen from this UAV, in the direction in which it was held back."""
        east, north = self._avoided
        return east * east_m + north * north_m > _AVOIDED_COS * math.hypot(east_m, north_m)

    def _choose(
        self, phone: PhoneFilter, here: Enu, others: Sequence[Enu], *, avoiding: bool = False
    ) -> tuple[float, float] | None:
        best: tuple[float, float, float] | None = None
        for east, north, deficit in phone.likely_cells(_LIKELY):
            if self._looked_at.sides(east, north):
                continue
            if avoiding and self._is_avoided(east - here.east, north - here.north):
                continue
            away_m = math.hypot(east - here.east, north - here.north)
            cost = deficit / 2 + _PER_M * away_m
            if any(math.hypot(east - other.east, north - other.north) <= away_m for other in others):
                cost += _OTHERS
            if best is None or (cost, east, north) < best:
                best = cost, east, north
        return None if best is None else best[1:]
