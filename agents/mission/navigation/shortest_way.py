"""The shortest way around obstacles: A* over a grid of cells, some of which are occupied (`taken`).

Hart, Nilsson and Raphael, "A Formal Basis for the Heuristic Determination of Minimum Cost Paths", 1968.
"""

import heapq
import math
from collections.abc import Callable
from typing import Final

from agents.mission.navigation.onboard_map import CELL_M, Cell, cell_of, middle_of

_STEPS: Final = tuple(
    (east, north, math.hypot(east, north)) for east in (-1, 0, 1) for north in (-1, 0, 1) if east or north
)
_SAMPLE_M: Final = 0.8 * CELL_M
"""The distance between the points at which a straight way is checked."""
_ESCAPE: Final = 4.0
"""The cost factor of an occupied cell next to the start, so that a UAV that is too near to a wall can still leave."""
_ESCAPE_CELLS: Final = 4

Place = tuple[float, float]
"""The east and north coordinates of a place [m]."""


def is_clear(start: Place, goal: Place, taken: Callable[[Cell], bool]) -> bool:
    """True if no cell on the straight way is occupied."""
    east, north = goal[0] - start[0], goal[1] - start[1]
    steps = max(1, math.ceil(math.hypot(east, north) / _SAMPLE_M))
    before: Cell | None = None
    for step in range(steps + 1):
        share = step / steps
        cell = cell_of(start[0] + share * east, start[1] + share * north)
        if cell != before and taken(cell):
            return False
        before = cell
    return True


def nearest_free(goal: Place, taken: Callable[[Cell], bool], *, within: int) -> Cell | None:
    """The free cell nearest to a place, of the first square around it that has one; None if none has within this number
    of cells.
    """
    column, row = cell_of(*goal)
    for ring in range(within + 1):
        found = [
            (math.hypot(middle_of((c, r))[0] - goal[0], middle_of((c, r))[1] - goal[1]), (c, r))
            for c in range(column - ring, column + ring + 1)
            for r in range(row - ring, row + ring + 1)
            if max(abs(c - column), abs(r - row)) == ring and not taken((c, r))
        ]
        if found:
            return min(found)[1]
    return None


def way_around(start: Place, goal: Cell, taken: Callable[[Cell], bool], *, most_cells: int) -> list[Cell]:
    """Cells of the shortest way, from the start's; empty if none is found by examining `most_cells`."""
    begin = cell_of(*start)
    costs: dict[Cell, float] = {begin: 0.0}
    came_from: dict[Cell, Cell] = {}
    waiting: list[tuple[float, Cell]] = [(0.0, begin)]
    done: set[Cell] = set()
    while waiting and len(done) < most_cells:
        _, cell = heapq.heappop(waiting)
        if cell == goal:
            return _traced(came_from, cell)
        if cell in done:
            continue
        done.add(cell)
        for east, north, length in _STEPS:
            other = cell[0] + east, cell[1] + north
            if other in done:
                continue
            if taken(other):
                if max(abs(other[0] - begin[0]), abs(other[1] - begin[1])) > _ESCAPE_CELLS:
                    continue
                length *= _ESCAPE
            cost = costs[cell] + length
            if cost < costs.get(other, math.inf):
                costs[other] = cost
                came_from[other] = cell
                ahead = math.hypot(other[0] - goal[0], other[1] - goal[1])
                heapq.heappush(waiting, (cost + ahead, other))
    return []


def _traced(came_from: dict[Cell, Cell], cell: Cell) -> list[Cell]:
    way = [cell]
    while cell in came_from:
        cell = came_from[cell]
        way.append(cell)
    return way[::-1]


def first_corner(start: Place, way: list[Cell], taken: Callable[[Cell], bool]) -> Place | None:
    """The farthest place of the way to which the straight line from its start is clear, or else its next place."""
    if len(way) < 2:
        return None
    low, high = 1, len(way) - 1
    while low < high:  # along a shortest way, what is out of sight stays out of sight, so bisection finds the border
        middle = (low + high + 1) // 2
        if is_clear(start, middle_of(way[middle]), taken):
            low = middle
        else:
            high = middle - 1
    return middle_of(way[low])
