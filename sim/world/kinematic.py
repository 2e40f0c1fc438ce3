"""A cheap engine: point masses with limited acceleration. For protocol work, where only distances matter.

Does not model: attitude, drag, and gravity but for wrecks. Bodies are spheres of `RADIUS_M` that notice contact but
do not bounce.
"""

from typing import Final

import numpy as np

from sim.world.engine import Engine, Flags, Rows
from sim.world.solids import Solids

ACCELERATION_M_S2: Final = 5.0
GRAVITY_M_S2: Final = 9.81
RADIUS_M: Final = 0.25
_CROWD: Final = 400
"""Above this many nodes contacts between bodies are not looked for: it is quadratic, and such swarms are for radio."""


class Kinematic(Engine):
    """Velocity follows the wish as fast as the acceleration allows."""

    name = "kinematic"

    def __init__(self, solids: Solids | None = None) -> None:
        self._solids = solids if solids is not None and solids.any else None
        self._at = np.zeros((0, 3))
        self._velocity = np.zeros((0, 3))
        self._touching: frozenset[tuple[int, int]] = frozenset()
        self._new: list[tuple[int, int]] = []
        self._wrecks: list[int] = []

    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        self._at = positions.copy()
        self._velocity = np.zeros_like(positions) if velocities is None else velocities.copy()
        self._touching, self._new, self._wrecks = frozenset(), [], []

    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        change = wanted_m_s - self._velocity
        size = np.linalg.norm(change, axis=1, keepdims=True)
        limit = ACCELERATION_M_S2 * dt_s
        change *= np.minimum(1.0, limit / np.maximum(size, 1e-12))
        before = self._velocity
        if self._wrecks:
            change[self._wrecks] = [0.0, 0.0, -GRAVITY_M_S2 * dt_s]
        self._velocity = before + change
        came_from = self._at
        self._at = came_from + (before + self._velocity) * (dt_s / 2)
        below = self._at[:, 2] < 0
        self._at[below, 2] = 0.0
        self._velocity[below] = 0.0
        if self._solids is not None:
            self._stop_at_walls(came_from, self._solids)
        self._notice_contacts()

    def blocked(self, first: Rows, second: Rows) -> Flags:
        return super().blocked(first, second) if self._solids is None else self._solids.blocked(first, second)

    def positions(self) -> Rows:
        return self._at

    def velocities(self) -> Rows:
        return self._velocity

    def fall(self, row: int) -> None:
        self._wrecks.append(row)

    def contacts(self) -> list[tuple[int, int]]:
        new, self._new = self._new, []
        return new

    def _stop_at_walls(self, came_from: Rows, solids: Solids) -> None:
        """Who would be within something solid is put back where it came from, or on the ground, and stands still."""
        inside = solids.gap_m(self._at) <= 0
        if inside.any():
            self._at[inside] = came_from[inside]
            self._at[inside, 2] = np.maximum(self._at[inside, 2], solids.ground_m(self._at[inside]))
            self._velocity[inside] = 0.0

    def _notice_contacts(self) -> None:
        gap = self._at[:, 2] if self._solids is None else self._solids.gap_m(self._at)
        now = {(0, int(i) + 1) for i in np.flatnonzero(gap <= RADIUS_M)}
        if len(self._at) <= _CROWD:
            apart = np.linalg.norm(self._at[:, None] - self._at[None], axis=2)
            first, second = np.nonzero(np.triu(apart < 2 * RADIUS_M, k=1))
            now |= {(int(a) + 1, int(b) + 1) for a, b in zip(first, second, strict=True)}
        self._new += sorted(now - self._touching)
        self._touching = frozenset(now)
