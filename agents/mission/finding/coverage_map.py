"""The map of the cells of the area that have been searched, as far as one UAV knows.

    by this UAV     cells whose middles came within the range of its own receiver
    by others       their maps, in hellos every `TELL_NS`; a cell that any UAV has searched counts as searched

Maps are merged by bitwise or, which is idempotent, commutative and associative. So they spread from neighbor to
neighbor in any order, and repetitions do no harm.
"""

import math
from collections.abc import Iterator
from typing import Final

from fanet_mw.units import Enu, S
from fanet_mw.wire.searched_cells import COVERED_SIDE, Covered

TELL_NS: Final = 4 * S


class CoverageMap:
    """The map of one UAV."""

    def __init__(self, *, area_m: float, seen_m: float) -> None:
        self._half_m = area_m / 2
        self._cell_m = area_m / COVERED_SIDE
        self.seen_m = max(seen_m, self._cell_m)
        """The distance up to which a receiver searches."""
        self.cells = 0
        self._told_ns: int | None = None

    def fly_over(self, position: Enu) -> None:
        """Mark what a receiver at a place searches."""
        self.cells |= self.around(position, self.seen_m)

    def merge(self, told: Covered) -> None:
        """A neighbor has sent its map."""
        self.cells |= told.cells

    def news(self, now_ns: int) -> Covered | None:
        """The map for the next hello; None if it is not due."""
        if self._told_ns is not None and now_ns - self._told_ns < TELL_NS:
            return None
        self._told_ns = now_ns
        return Covered(self.cells)

    def around(self, position: Enu, within_m: float) -> int:
        """The cells whose middles are within this distance of a place."""
        found = 0
        columns, rows = self._span(position.east, within_m), self._span(position.north, within_m)
        for row in rows:
            north_m = self._middle_m(row) - position.north
            for column in columns:
                if math.hypot(self._middle_m(column) - position.east, north_m) <= within_m:
                    found |= 1 << (COVERED_SIDE * row + column)
        return found

    def _span(self, middle_m: float, within_m: float) -> range:
        first = math.floor((middle_m - within_m + self._half_m) / self._cell_m)
        last = math.floor((middle_m + within_m + self._half_m) / self._cell_m)
        return range(max(0, first), min(COVERED_SIDE - 1, last) + 1)

    def _middle_m(self, index: int) -> float:
        return (index + 0.5) * self._cell_m - self._half_m

    def middles(self, cells: int) -> Iterator[tuple[float, float]]:
        """East and north of the middles of these cells."""
        while cells:
            lowest = cells & -cells
            row, column = divmod(lowest.bit_length() - 1, COVERED_SIDE)
            yield self._middle_m(column), self._middle_m(row)
            cells ^= lowest
