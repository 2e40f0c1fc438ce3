"""A cheap engine: point masses with limited acceleration, for work on protocols, where only distances matter.

Not modeled: attitude, drag and wind; gravity only acts on crashed UAVs. Bodies are spheres whose contacts are
detected, but which do not bounce. The greatest speed is in `sim/world/mobility/guidance.py`.
"""

from typing import Final

import numpy as np

from sim.world.arrays import Rows
from sim.world.engines.contacts import Contacts
from sim.world.engines.contract import GRAVITY_M_S2, Engine
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment.solids import Solids

ACCELERATION_M_S2: Final = 5.0


class Kinematic(Engine):
    """The velocity follows the wanted one as fast as the greatest acceleration allows."""

    name = "kinematic"

    def __init__(self, solids: Solids | None = None, *, radius_m: float = IRIS.reach_m) -> None:
        self._solids = solids if solids is not None and solids.any else None
        self._at = np.zeros((0, 3))
        self._velocity = np.zeros((0, 3))
        self._contacts = Contacts(radius_m, self._solids)
        self._wrecks: list[int] = []

    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        self._at = positions.copy()
        self._velocity = np.zeros_like(positions) if velocities is None else velocities.copy()
        self._wrecks = []
        self._contacts.reset()

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
        if self._solids is None:
            stopped = self._at[:, 2] < 0
            self._at[stopped, 2] = 0.0
            self._velocity[stopped] = 0.0
        else:
            self._solids.stop(came_from, self._at, self._velocity)
        self._contacts.notice(came_from, self._at)
