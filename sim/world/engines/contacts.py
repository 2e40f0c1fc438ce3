"""Detects which bodies touch each other, once for each contact. The ground, walls and hillsides count as body 0."""

from typing import Final

import numpy as np

from sim.world.engines.contract import Rows
from sim.world.environment.solids import Solids

_CROWD: Final = 400
"""With more bodies than this, contacts between bodies are not detected, because the effort is quadratic."""


class Contacts:
    """The contacts of a swarm of equal spheres."""

    def __init__(self, radius_m: float, solids: Solids | None) -> None:
        self._radius_m = radius_m
        self._solids = solids
        self._touching: frozenset[tuple[int, int]] = frozenset()
        self._new: list[tuple[int, int]] = []

    def reset(self) -> None:
        self._touching, self._new = frozenset(), []

    def notice(self, at: Rows) -> None:
        """Examine all bodies at their places [nodes, 3]."""
        gap = at[:, 2] if self._solids is None else self._solids.gap_m(at)
        now = {(0, int(i) + 1) for i in np.flatnonzero(gap <= self._radius_m)}
        if len(at) <= _CROWD:
            apart = np.linalg.norm(at[:, None] - at[None], axis=2)
            first, second = np.nonzero(np.triu(apart < 2 * self._radius_m, k=1))
            now |= {(int(a) + 1, int(b) + 1) for a, b in zip(first, second, strict=True)}
        self._new += sorted(now - self._touching)
        self._touching = frozenset(now)

    def take(self) -> list[tuple[int, int]]:
        """The contacts that began since the last call."""
        new, self._new = self._new, []
        return new
