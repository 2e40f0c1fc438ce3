"""Finds the pairs of stations within reach of each other [m], by cells of the ground that are as wide as the reach."""

import math

import numpy as np
import numpy.typing as npt

from emulator.kernel.jit import jit
from emulator.kernel.state import Ints, Reals


@jit
def pairs(
    at: Reals, reach: float, column: Ints, keys: Ints, order: Ints, rows: int, found: Ints, distance: Reals
) -> int:
    """Ordered pairs in reach, into `found` (int64 [n, 2]) and `distance` as far as they have room; returns how many
    there are. `order` lists the stations by cell, `keys` their cells; three cells of one column are adjacent.
    """
    n = 0
    for a in range(at.shape[0]):
        first = n
        for side in range(-1, 2):
            cell = column[a] + side * rows
            i = np.searchsorted(keys, cell - 1)
            while i < keys.shape[0] and keys[i] <= cell + 1:
                b = order[i]
                i += 1
                dx, dy, dz = at[a, 0] - at[b, 0], at[a, 1] - at[b, 1], at[a, 2] - at[b, 2]
                square = dx * dx + dy * dy + dz * dz
                if a == b or not square <= reach * reach:
                    continue
                if n >= found.shape[0]:
                    n += 1
                    continue
                j = n
                while (
                    j > first and found[j - 1, 1] > b
                ):  # keeps the destinations ascending, whichever cells they are in
                    found[j, 1] = found[j - 1, 1]
                    distance[j] = distance[j - 1]
                    j -= 1
                found[n, 0] = a
                found[j, 1] = b
                distance[j] = math.sqrt(square)
                n += 1
    return n


def neighbors(at: npt.NDArray[np.float64], reach: float) -> tuple[Ints, Reals]:
    """Ordered pairs in reach [n, 2], by source then destination, and distances [m]; none for a place not finite."""
    known = np.flatnonzero(np.isfinite(at).all(axis=1))
    if not len(known):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.float64)
    here = np.ascontiguousarray(at[known])
    east, north = np.floor((here[:, :2] - here[:, :2].min(axis=0)) / reach).astype(np.int64).T
    rows = int(north.max()) + 3  # with an empty cell at either end, no column borders on the next one
    cell = east * rows + north
    order = np.argsort(cell, kind="stable")
    room = 32 * len(here)
    while True:
        found = np.zeros((room, 2), np.int64)
        distance = np.zeros(room, np.float64)
        count = int(pairs(here, reach, cell, cell[order], order, rows, found, distance))
        if count <= room:
            return known[found[:count]], distance[:count]
        room = count
