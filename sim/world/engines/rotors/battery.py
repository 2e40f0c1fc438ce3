"""Lithium polymer batteries: an open-circuit voltage that falls with the charge, behind a resistance.

    P = V I,  V = V0(charge) - R I      ->      I = (V0 - sqrt(V0^2 - 4 R P)) / (2 R)

The curve of one cell is a usual one (4.20 V full, 3.70 V at a tenth, 3.27 V empty; Tremblay and Dessaint, 2009, has
the shape). Not modeled: temperature, age, recovery after a load.
"""

from typing import Final

import numpy as np

from sim.world.arrays import Flags, Values
from sim.world.engines.rotors.vehicle_types import Cell

_CHARGE: Final = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
_CELL_V: Final = np.array([3.27, 3.61, 3.69, 3.73, 3.80, 3.87, 4.02, 4.20])


class Batteries:
    """The batteries of all UAVs, one for each."""

    def __init__(self, cell: Cell, charge: Values) -> None:
        """`charge`: share of the capacity that each holds at first."""
        self._cell = cell
        self.charge = charge.astype(np.float64)
        self.current_a = np.zeros(len(charge))
        self.voltage_v = self._open_v()

    @property
    def empty(self) -> Flags:
        return np.asarray(self.charge <= 0.0)

    def drain(self, power_w: Values, seconds: float) -> None:
        """Deliver power for some seconds; a battery that cannot delivers what it can."""
        open_v, r = self._open_v(), self._cell.resistance_ohm
        root = np.sqrt(np.maximum(open_v**2 - 4 * r * power_w, 0.0))
        self.current_a = np.where(self.charge > 0, (open_v - root) / (2 * r), 0.0)
        self.voltage_v = open_v - r * self.current_a
        self.charge = np.maximum(self.charge - self.current_a * seconds / 3600 / self._cell.capacity_ah, 0.0)

    def _open_v(self) -> Values:
        return np.asarray(self._cell.cells * np.interp(self.charge, _CHARGE, _CELL_V))
