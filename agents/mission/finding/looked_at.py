"""Where the cameras of the swarm have looked lately: whoever was not seen there is probably somewhere else.

Each UAV notes what its own camera shows and, by their hellos, what those of its neighbors show. A place counts as shown
after some seconds of images, which together hardly miss anybody who lies in the open, and for two minutes: whoever
walks may be there later. From how many sides it was shown tells whether a wall may hide somebody (`in_building.py`).
"""

import math
from typing import Final

from agents.mission.finding.camera_view import INSIDE
from fanet_mw.units import Enu, S

_CELL_M: Final = 20.0
"""The side of the cells in which it is noted where cameras have looked."""
_REMEMBERED_NS: Final = 120 * S
_CLEARED_NS: Final = 30 * S
_MANY: Final = 2_000
"""With so many cells or more, those that are old are removed at this interval."""
_MOST: Final = 50_000
"""The greatest number of cells that are remembered: 20 km2."""
_NEVER: Final = (-_REMEMBERED_NS, 0, 0)
_LOOKS: Final = 3
"""A place is shown after this number of looks, which are noted once a second."""


class LookedAt:
    """The places that cameras have shown, by cell."""

    def __init__(self, view_m: tuple[float, float] = (math.inf, math.inf), *, height_m: float = 1.0) -> None:
        """`view_m`: how far east and north a camera at `height_m` above ground shows it; infinite: none."""
        self._view_m = INSIDE * view_m[0], INSIDE * view_m[1]
        self._height_m = max(1.0, height_m)
        self._cells: dict[tuple[int, int], tuple[int, int, int]] = {}
        """Of each cell, when a camera showed it last, how often lately, and from which of four sides, as bits."""
        self._now_ns = self._cleared_ns = 0

    @property
    def has_camera(self) -> bool:
        return math.isfinite(self._view_m[0])

    @property
    def second(self) -> int:
        """Grows as cameras show more."""
        return self._now_ns // S

    def note(self, at: Enu, now_ns: int) -> None:
        """A camera is at this position, its height above ground, and shows what is below."""
        self._now_ns = max(self._now_ns, now_ns)
        if not self.has_camera or not self._has_room():
            return
        cells, before_ns = self._cells, now_ns - _REMEMBERED_NS
        scale = min(1.0, at.up / self._height_m)
        east_m, north_m = self._view_m[0] * scale, self._view_m[1] * scale
        columns = range(math.ceil((at.east - east_m) / _CELL_M), math.floor((at.east + east_m) / _CELL_M) + 1)
        rows = range(math.ceil((at.north - north_m) / _CELL_M), math.floor((at.north + north_m) / _CELL_M) + 1)
        for i in columns:
            for j in rows:
                looked_ns, looks, sides = cells.get((i, j), _NEVER)
                if looked_ns <= before_ns:
                    looks, sides = 0, 0
                side = 2 * (i * _CELL_M > at.east) + (j * _CELL_M > at.north)
                cells[i, j] = now_ns, looks + 1, sides | 1 << side

    def _has_room(self) -> bool:
        """Forget now and then what is old; False if too much is left all the same, as after forged hellos."""
        if len(self._cells) >= _MANY and self._now_ns - self._cleared_ns >= _CLEARED_NS:
            self._cleared_ns = self._now_ns
            old_ns = self._now_ns - _REMEMBERED_NS
            self._cells = {cell: look for cell, look in self._cells.items() if look[0] > old_ns}
        return len(self._cells) < _MOST

    def has_shown(self, east_m: float, north_m: float) -> bool:
        """True if a person in the open there would have been seen lately."""
        return self._lately(_cell(east_m, north_m))[0] >= _LOOKS

    def sides(self, east_m: float, north_m: float) -> int:
        """From how many of four sides cameras have shown a place lately."""
        return self._lately(_cell(east_m, north_m))[1].bit_count()

    def _lately(self, cell: tuple[int, int]) -> tuple[int, int]:
        """How often a cell was shown lately, and from which sides."""
        looked_ns, looks, sides = self._cells.get(cell, _NEVER)
        return (looks, sides) if self._now_ns - looked_ns < _REMEMBERED_NS else (0, 0)


def _cell(east_m: float, north_m: float) -> tuple[int, int]:
    return round(east_m / _CELL_M), round(north_m / _CELL_M)
