"""The batteries of a swarm, which flight drains.

An engine with rotors computes their power. For the other engines it is the power of steady flight at the same airspeed
and climb rate (`rotors/power.py`), from a table over both; acceleration costs nothing. A UAV on the ground needs power
for its avionics only.
"""

from typing import Final

import numpy as np

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from sim.world.arrays import Flags, Values
from sim.world.engines.contract import Engine
from sim.world.engines.rotors.battery import Batteries
from sim.world.engines.rotors.power import trimmed_w
from sim.world.engines.rotors.vehicle_types import VEHICLES, Vehicle

_FASTEST_M_S: Final = 60.0
_CELLS: Final = 121
_CLIMBS_M_S: Final = np.array([0.0, 2.0, 5.0, 10.0, 20.0])


class BatteryDrain:
    """The batteries of all UAVs, and the power that empties them."""

    def __init__(self, scenario: Scenario) -> None:
        world = scenario.world
        self._vehicle = VEHICLES[world.vehicle]
        random = stream(scenario.seed, "charge")
        charge = np.array([random.uniform(*world.charge) for _ in scenario.uav_ids])
        self.batteries = Batteries(self._vehicle.battery, charge)
        self._table = power_table(self._vehicle)

    def pass_time(self, seconds: float, engine: Engine, flies: Flags) -> list[int]:
        """Drain the batteries; returns the rows whose battery has become empty."""
        power = engine.power_w()
        if power is None:
            power = self._steady_w(engine.velocities())
        before = self.batteries.empty
        self.batteries.drain(np.where(flies, power, self._vehicle.avionics_w), seconds)
        return np.flatnonzero(self.batteries.empty & ~before).tolist()

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
