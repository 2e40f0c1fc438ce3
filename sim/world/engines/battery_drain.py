"""The batteries of a swarm, which flight drains.

An engine with rotors computes their power. For the other engines it is the power of steady flight at the same airspeed
and climb rate (`rotors/power.py`), from a table over both; acceleration costs nothing. A UAV on the ground needs power
for its avionics only.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from sim.world.arrays import Flags, Values
from sim.world.engines.contract import Engine
from sim.world.engines.rotors.power import trimmed_w
from sim.world.engines.rotors.vehicle_types import VEHICLES, Cell, Vehicle

_FASTEST_M_S: Final = 60.0
_CELLS: Final = 121
_CLIMBS_M_S: Final = np.array([0.0, 2.0, 5.0, 10.0, 20.0])


_CHARGE: Final = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
_CELL_V: Final = np.array([3.27, 3.61, 3.69, 3.73, 3.80, 3.87, 4.02, 4.20])


class Batteries:
    """The lithium polymer batteries of all UAVs: an open-circuit voltage that falls with the charge, and a resistance.

        P = V I,  V = V0(charge) - R I      ->      I = (V0 - sqrt(V0^2 - 4 R P)) / (2 R)

    The curve of one cell is a usual one (Tremblay and Dessaint, 2009, has the shape). Not modeled: temperature, age,
    recovery after a load.
    """

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


class BatteryDrain:
    """The batteries of all UAVs, and the power that empties them."""

    def __init__(self, scenario: Scenario, charges: Mapping[int, float] = {}) -> None:
        """`charges`: what sensors told last before the world was started again; those of all other nodes are drawn."""
        world = scenario.world
        self._vehicle = VEHICLES[world.vehicle]
        random = stream(scenario.seed, "charge")
        drawn = {node: random.uniform(*world.charge) for node in scenario.uav_ids}
        charge = np.array([charges.get(node, full) for node, full in drawn.items()])
        self.batteries = Batteries(self._vehicle.battery, charge)
        self._table = power_table(self._vehicle)

    def pass_time(self, seconds: float, engine: Engine, flies: Flags) -> list[int]:
        """Drain the batteries; returns the rows whose battery is empty."""
        power = engine.power_w()
        if power is None:
            power = self._steady_w(engine.velocities())
        self.batteries.drain(np.where(flies, power, self._vehicle.avionics_w), seconds)
        return np.flatnonzero(self.batteries.empty).tolist()

    def _steady_w(self, velocity: Values) -> Values:
        speed = np.minimum(np.linalg.norm(velocity[:, :2], axis=1), _FASTEST_M_S) * (_CELLS - 1) / _FASTEST_M_S
        climb = np.interp(velocity[:, 2], _CLIMBS_M_S, np.arange(len(_CLIMBS_M_S)))
        i = np.minimum(climb.astype(np.int64), len(_CLIMBS_M_S) - 2)
        j = np.minimum(speed.astype(np.int64), _CELLS - 2)
        v, u, table = climb - i, speed - j, self._table
        low = table[i, j] * (1 - u) + table[i, j + 1] * u
        high = table[i + 1, j] * (1 - u) + table[i + 1, j + 1] * u
        return np.asarray(low * (1 - v) + high * v)


def power_table(vehicle: Vehicle) -> Values:
    """Electrical power in steady flight, by climb (rows) and horizontal speed."""
    speeds = np.linspace(0.0, _FASTEST_M_S, _CELLS)
    return np.stack([trimmed_w(vehicle, speeds, np.full_like(speeds, climb)) for climb in _CLIMBS_M_S.tolist()])
