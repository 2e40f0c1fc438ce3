"""The ways of UAVs to their places, some with a detour so that cameras show what lies among the swarm.

A sweep that begins around the swarm leaves behind the places between where UAVs stood. Who is there is heard, but where
walls or trees weaken a phone the estimate is wrong, and nobody comes by again for minutes. Most UAVs have time left on
their way: the spot from which a camera shows most of what is left goes to whoever needs least for it. Each UAV computes
the detours of all, and ties keep it in reach of the others (`agents/mission/flight/connectivity_maintenance.py`).
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

from agents.mission.search_formation.pattern import Pattern
from fanet_mw.units import Enu

_CELL_M: Final = 40.0
"""The side of the cells for which it is known whether a camera will show them."""
_SWEPT_S: Final = 10.0
"""The time step at which it is looked where the sweep leads."""
_LONGEST_M: Final = 220.0
"""No detour makes a way longer by more than this."""
_MOST_CELLS: Final = 20_000
"""Over a larger area, and before a sweep that takes longer than `_MOST_SWEPT_S`, all fly straight: what others state
must not cost this node much time."""
_MOST_SWEPT_S: Final = 3_000.0
_Cell = tuple[int, int]


def detours(pattern: Pattern, starts: Mapping[int, Enu], *, view_m: float, most_m: float) -> dict[int, Enu]:
    """The place over which each UAV flies on the way to its own place, by that place; whoever flies straight is left
    out. `starts`: where the UAV of each place is; `view_m`: how far a camera shows the ground to each side; `most_m`:
    the longest way that there is time for.
    """
    at_start = {place: _at(_cell(start)) for place, start in starts.items()}  # the same to all, though they err
    goals = {place: pattern.at(place, 0.0) for place in at_start}
    starts = {place: at for place, at in at_start.items() if at.horizontal_to(goals[place]) <= most_m}
    columns, rows = _spanned([at.east for at in starts.values()]), _spanned([at.north for at in starts.values()])
    if len(columns) * len(rows) > _MOST_CELLS or pattern.shape.sweep_s > _MOST_SWEPT_S:
        return {}
    unseen = {(column, row) for column in columns for row in rows}
    for place, start in starts.items():
        unseen.difference_update(_shown(start, goals[place], view_m))
    if unseen:
        unseen.difference_update(_swept(pattern, view_m))
    straight_m = {place: start.horizontal_to(goals[place]) for place, start in starts.items()}
    shows = {cell: sum(other in unseen for other in _near(cell, view_m)) for cell in unseen}
    found: dict[int, Enu] = {}
    while shows:
        cell = max(shows, key=lambda cell: (shows[cell], cell))
        del shows[cell]
        over = _at(cell)
        longer = [
            (longer_m, place)
            for place, way_m in straight_m.items()
            if (longer_m := starts[place].horizontal_to(over) + over.horizontal_to(goals[place]) - way_m)
            <= min(_LONGEST_M, most_m - way_m)
        ]
        if longer:
            _, place = min(longer)
            del straight_m[place]
            found[place] = over._replace(up=goals[place].up)
            for a, b in pairwise((starts[place], over, goals[place])):
                _show(unseen.intersection(_shown(a, b, view_m)), unseen, shows, view_m)
    return found


def _show(shown: Iterable[_Cell], unseen: set[_Cell], shows: dict[_Cell, int], view_m: float) -> None:
    """Take cells out of those that are `unseen`, and of the number of such cells that a camera `shows` above others."""
    for cell in shown:
        unseen.discard(cell)
        shows.pop(cell, None)
        for other in _near(cell, view_m):
            if other in shows:
                shows[other] -= 1


def _cell(at: Enu) -> _Cell:
    return round(at.east / _CELL_M), round(at.north / _CELL_M)


def _at(cell: _Cell) -> Enu:
    return Enu(cell[0] * _CELL_M, cell[1] * _CELL_M, 0.0)


def _spanned(values: Sequence[float]) -> range:
    """The columns or rows of cells between the least and the greatest of these positions."""
    return range(math.ceil(min(values) / _CELL_M), math.floor(max(values) / _CELL_M) + 1) if values else range(0)


def _shown(a: Enu, b: Enu, view_m: float) -> Iterator[_Cell]:
    """The cells that a camera shows whose UAV flies straight from one position to another."""
    steps = max(1, math.ceil(a.horizontal_to(b) / _CELL_M))
    for step in range(steps + 1):
        share = step / steps
        yield from _below(a.east + share * (b.east - a.east), a.north + share * (b.north - a.north), view_m)


def _near(cell: _Cell, view_m: float) -> Iterator[_Cell]:
    return _below(cell[0] * _CELL_M, cell[1] * _CELL_M, view_m)


def _below(east: float, north: float, view_m: float) -> Iterator[_Cell]:
    for column in range(math.ceil((east - view_m) / _CELL_M), math.floor((east + view_m) / _CELL_M) + 1):
        for row in range(math.ceil((north - view_m) / _CELL_M), math.floor((north + view_m) / _CELL_M) + 1):
            yield column, row


def _swept(pattern: Pattern, view_m: float) -> Iterator[_Cell]:
    """The cells that lie ahead of the formation; what is between two lanes is shown on the way back."""
    wide_m = max(view_m, min(pattern.shape.lane_m / 2, 2 * view_m))
    teams = range(pattern.dimensions.fixed - pattern.dimensions.relays)
    for step in range(math.ceil(pattern.shape.sweep_s / _SWEPT_S) + 1):
        for place in teams:
            at = pattern.at(place, step * _SWEPT_S)
            yield from _below(at.east, at.north, wide_m)
