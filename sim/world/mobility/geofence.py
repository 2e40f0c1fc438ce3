"""The geofence of the world, a rectangle `FENCE_M` outside the area, and what setpoints can do about it.

A position setpoint is clipped to the area. A velocity setpoint is limited so that the UAV can brake before it reaches
the geofence; with `mobility.geofence = "return"` it is not limited, and a UAV that is beyond the geofence flies home.
"""

from typing import Final

import numpy as np

from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu
from sim.world.arrays import Flags, Rows
from sim.world.environment.layout import positions

FENCE_M: Final = 50.0
"""The distance of the geofence from the area."""
FLOOR_M: Final = 5.0
"""A position or take-off setpoint below this height is raised to it."""
CEILING_M: Final = 1000.0
"""A position or take-off setpoint above this height is lowered to it."""
BRAKE_M_S2: Final = 2.5
"""The deceleration with which braking is planned: half of what a UAV can do, because it reacts with a lag."""
HOLD_M_S: Final = 5.0
"""The greatest speed at which a UAV comes back to the position that it holds, or back inside the geofence."""


def fence_of(scenario: Scenario) -> "Geofence":
    """The geofence that the world of a scenario will have."""
    return Geofence(scenario, np.array(positions(scenario)[: scenario.nodes.count], np.float64))


class Geofence:
    """The area of a swarm and the geofence around it. Where UAVs command themselves (`mobility.model = "onboard"`) the
    area reaches as far as their starts.
    """

    def __init__(self, scenario: Scenario, starts: Rows) -> None:
        half = np.full(2, scenario.world.area_m / 2)
        if scenario.mobility.model == "onboard":
            half = np.maximum(half, np.abs(starts[:, :2]).max(axis=0))
        self._half_east_m, self._half_north_m = map(float, half)

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far the geofence lies from the middle of the area, to the east and west, and to the north and south."""
        return self._half_east_m + FENCE_M, self._half_north_m + FENCE_M

    def clipped(self, place: Enu) -> Enu:
        """The place in the area, and between `FLOOR_M` and `CEILING_M`, that is nearest to a place."""
        return Enu(
            max(-self._half_east_m, min(self._half_east_m, place.east)),
            max(-self._half_north_m, min(self._half_north_m, place.north)),
            max(FLOOR_M, min(CEILING_M, place.up)),
        )

    def beyond(self, at: Rows) -> Flags:
        """True for each UAV that is beyond the geofence."""
        return np.asarray((np.abs(at[:, :2]) > self.reach_m).any(axis=1))

    def brake(self, wish: Rows, at: Rows) -> Rows:
        """The wished velocities, limited so that each UAV can brake before the geofence; a UAV beyond it is brought
        back.
        """
        limited = wish.copy()
        for axis, half in ((0, self._half_east_m), (1, self._half_north_m)):
            outwards = np.copysign(1.0, at[:, axis])
            left_m = half + FENCE_M - np.abs(at[:, axis])
            most = np.where(left_m > 0, np.sqrt(2 * BRAKE_M_S2 * np.maximum(left_m, 0.0)), -HOLD_M_S)
            limited[:, axis] = np.where(wish[:, axis] * outwards > most, most * outwards, wish[:, axis])
        return limited
