"""Where a responder looks that has come to a survivor's estimated place and sees nobody there.

It flies to the most probable place of the phone at which no camera has looked yet, the nearer ones first and those that
are nearer to another UAV last, and from there to the next one. The powers that it receives on the way change what is
probable.
"""

import math
from collections.abc import Sequence
from typing import Final

from agents.mission.finding.phone_localization import PhoneFilter
from fanet_mw.units import Enu, S

_CELL_M: Final = 20.0
"""The side of the cells in which it is noted where the camera has looked."""
_LIKELY: Final = 9.0
"""Places less probable than the most probable one by more than this are not looked at (twice a log-likelihood)."""
_PER_M: Final = 1 / 40.0
"""By how much a place must be more probable to be chosen although it is a metre farther away."""
_OTHERS: Final = 2.0
"""By how much a place must be more probable to be chosen although another UAV is nearer to it."""
_EVERY_NS: Final = 1 * S
"""The interval at which the next place is chosen anew."""
_THERE_M: Final = 10.0


class LookAround:
    """The places at which one UAV has looked for one survivor at a time."""

    def __init__(self, look_m: float) -> None:
        """`look_m`: how far the camera surely shows people to all sides; infinite for a UAV without a camera."""
        self._look_m = look_m
        self._survivor: int | None = None
        self._looked: set[tuple[int, int]] = set()
        self._next: tuple[float, float] | None = None
        self._chosen_ns = 0

    def next_place(
        self, survivor: int, phone: PhoneFilter, here: Enu, now_ns: int, *, others: Sequence[Enu] = ()
    ) -> tuple[float, float] | None:
        """East and north of the place to look at next, given where `others` look likewise; None if there is none."""
        if math.isinf(self._look_m):
            return None
        if survivor != self._survivor:
            self._survivor, self._next = survivor, None
            self._looked.clear()
        self._look(here)
        there = self._next is not None and math.hypot(self._next[0] - here.east, self._next[1] - here.north) < _THERE_M
        if self._next is None or there or now_ns - self._chosen_ns >= _EVERY_NS:
            for other in others:
                self._look(other)
            self._next, self._chosen_ns = self._choose(phone, here, others), now_ns
        return self._next

    def has_looked_at(self, east_m: float, north_m: float) -> bool:
        """True if the camera has shown a place since this UAV began to look for the present survivor."""
        return _cell(east_m, north_m) in self._looked

    def _look(self, here: Enu) -> None:
        """Note the cells whose middles a camera shows from a place."""
        column, row, reach = *_cell(here.east, here.north), math.floor(self._look_m / _CELL_M)
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                east, north = (column + i) * _CELL_M - here.east, (row + j) * _CELL_M - here.north
                if math.hypot(east, north) <= self._look_m:
                    self._looked.add((column + i, row + j))

    def _choose(self, phone: PhoneFilter, here: Enu, others: Sequence[Enu]) -> tuple[float, float] | None:
        best: tuple[float, float, float] | None = None
        for east, north, deficit in phone.likely_cells(_LIKELY):
            if _cell(east, north) in self._looked:
                continue
            away_m = math.hypot(east - here.east, north - here.north)
            cost = deficit / 2 + _PER_M * away_m
            if any(math.hypot(east - other.east, north - other.north) < away_m for other in others):
                cost += _OTHERS
            if best is None or (cost, east, north) < best:
                best = cost, east, north
        return None if best is None else best[1:]


def _cell(east_m: float, north_m: float) -> tuple[int, int]:
    return round(east_m / _CELL_M), round(north_m / _CELL_M)
