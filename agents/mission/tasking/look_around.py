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
_REMEMBERED_NS: Final = 120 * S
"""A place at which the camera has looked counts as empty for so long: whoever walks may be there later."""


class LookAround:
    """The places at which one UAV has looked, for whomever or in passing, and the next one for a survivor."""

    def __init__(self, look_m: float) -> None:
        """`look_m`: how far the camera surely shows people to all sides; infinite for a UAV without a camera."""
        self._look_m = look_m
        self._survivor: int | None = None
        self._looked: dict[tuple[int, int], tuple[int, int]] = {}
        """Of each cell, when the camera showed it last, and from which sides lately: a bit for each quadrant."""
        self._next: tuple[float, float] | None = None
        self._chosen_ns = self._passed_ns = 0

    def next_place(
        self, survivor: int, phone: PhoneFilter, here: Enu, now_ns: int, *, others: Sequence[Enu] = ()
    ) -> tuple[float, float] | None:
        """East and north of the place to look at next, given where `others` look likewise; None if there is none."""
        if math.isinf(self._look_m):
            return None
        if survivor != self._survivor:
            self._survivor, self._next = survivor, None
        self._look(here, now_ns)
        there = self._next is not None and math.hypot(self._next[0] - here.east, self._next[1] - here.north) < _THERE_M
        if self._next is None or there or now_ns - self._chosen_ns >= _EVERY_NS:
            for other in others:
                self._look(other, now_ns)
            self._next, self._chosen_ns = self._choose(phone, here, others, now_ns), now_ns
        return self._next

    def sides_looked_from(self, east_m: float, north_m: float, now_ns: int) -> int:
        """From how many of four sides the camera has shown a place lately: a wall hides a person from some of them."""
        looked_ns, sides = self._looked.get(_cell(east_m, north_m), (now_ns - _REMEMBERED_NS, 0))
        return sides.bit_count() if now_ns - looked_ns < _REMEMBERED_NS else 0

    def pass_over(self, here: Enu, now_ns: int) -> None:
        """Look down in passing, once a second."""
        if now_ns >= self._passed_ns + _EVERY_NS and not math.isinf(self._look_m):
            self._passed_ns = now_ns
            self._look(here, now_ns)

    def _look(self, here: Enu, now_ns: int) -> None:
        """Note the cells whose middles a camera shows from a place."""
        column, row, reach = *_cell(here.east, here.north), math.floor(self._look_m / _CELL_M)
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                east, north = (column + i) * _CELL_M - here.east, (row + j) * _CELL_M - here.north
                if math.hypot(east, north) <= self._look_m:
                    cell = column + i, row + j
                    looked_ns, sides = self._looked.get(cell, (now_ns, 0))
                    side = 1 << (2 * (east > 0) + (north > 0))
                    self._looked[cell] = now_ns, side | (sides if now_ns - looked_ns < _REMEMBERED_NS else 0)

    def _choose(self, phone: PhoneFilter, here: Enu, others: Sequence[Enu], now_ns: int) -> tuple[float, float] | None:
        best: tuple[float, float, float] | None = None
        for east, north, deficit in phone.likely_cells(_LIKELY):
            if self.sides_looked_from(east, north, now_ns):
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
