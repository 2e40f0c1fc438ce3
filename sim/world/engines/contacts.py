"""Detects which bodies touch each other, once for each contact. The ground, roofs, walls and hillsides count as body 0.

A step moves bodies straight, and a contact is the closest approach within it, as in `sim/world/incidents.py`: two that
pass each other between two instants have touched, too.
"""

import math
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from sim.world.arrays import Rows, Values
from sim.world.environment.solids import Solids

Indices = npt.NDArray[np.int64]

_ASKEW: Final = np.array([1.0, math.sqrt(2) - 1, math.sqrt(3) - 1])
_SWEEP: Final = _ASKEW / (2 * np.linalg.norm(_ASKEW))
"""The direction, by half of a unit vector: it is multiplied by twice the middle of a step."""
_NO_PAIRS: Final = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)


@cache
def _numbers(count: int) -> Indices:
    return np.arange(1, count + 1)


def approaches(before: Rows, after: Rows, *, within_m: float) -> tuple[Indices, Indices, Values]:
    """The pairs that come nearer than this in a step, and how near: by sorting the middles of all steps along one
    direction (sweep and prune; Cohen et al., I-COLLIDE, 1995), in which no two places of a grid lie beside each other.
    """
    way = after - before
    reach = within_m + math.sqrt(float((way * way).sum(axis=1).max(initial=0.0)))
    along = (before + after) @ _SWEEP
    order = np.argsort(along, kind="stable")
    along = along[order]
    counts = np.searchsorted(along, along + reach, side="right") - _numbers(len(order))
    if not counts.any():
        return _NO_PAIRS
    first = np.repeat(np.arange(len(order)), counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    a, b = order[first], order[second]
    a, b = np.minimum(a, b), np.maximum(a, b)
    apart, change = before[a] - before[b], way[a] - way[b]
    moved2 = np.maximum((change**2).sum(axis=1), 1e-12)
    share = np.clip(-(apart * change).sum(axis=1) / moved2, 0.0, 1.0)
    distance = np.sqrt(((apart + change * share[:, None]) ** 2).sum(axis=1))
    near = distance < within_m
    return a[near], b[near], distance[near]


class Contacts:
    """The contacts of a swarm of equal spheres."""

    def __init__(self, radius_m: float, solids: Solids | None) -> None:
        self._radius_m = radius_m
        self._solids = solids
        self._touching: frozenset[tuple[int, int]] = frozenset()
        self._new: list[tuple[int, int]] = []

    def reset(self) -> None:
        self._touching, self._new = frozenset(), []

    def notice(self, before: Rows, after: Rows, also: frozenset[tuple[int, int]] = frozenset()) -> None:
        """Examine a step of all bodies between two places [nodes, 3]; `also`: pairs that are known to touch in it."""
        if self._solids is None:
            gap = np.minimum(before[:, 2], after[:, 2])
        else:
            gap = self._solids.least_gap_m(before, after, within_m=self._radius_m)
        first, second, _ = approaches(before, after, within_m=2 * self._radius_m)
        now = {(0, row + 1) for row in np.flatnonzero(gap <= self._radius_m).tolist()} | also
        now |= {(a + 1, b + 1) for a, b in zip(first.tolist(), second.tolist(), strict=True)}
        self._new += sorted(now - self._touching)
        self._touching = frozenset(now)

    def possible(self, before: Rows, after: Rows, *, margin_m: float) -> bool:
        """False if nothing comes nearer to anything in a step than touching and this margin; then nothing touches."""
        within_m = self._radius_m + margin_m
        if self._solids is None:
            gap = np.minimum(before[:, 2], after[:, 2])
        else:
            gap = self._solids.least_gap_m(before, after, within_m=within_m)
        pairs, _, _ = approaches(before, after, within_m=self._radius_m + within_m)
        found = bool(len(pairs)) or float(gap.min(initial=np.inf)) <= within_m
        if not found:
            self._touching = frozenset()
        return found

    def take(self) -> list[tuple[int, int]]:
        """The contacts that began since the last call."""
        new, self._new = self._new, []
        return new
