"""The contract of a mobility model: where each UAV should be at an instant, and how that place moves."""

from typing import NamedTuple, Protocol

from sim.world.arrays import Rows


class Track(NamedTuple):
    """The place at which each UAV should be now, and how that place moves."""

    places: Rows
    velocities: Rows


class MobilityModel(Protocol):
    """A mobility model: where UAVs fly while no setpoint says otherwise.

    Another package may bring one (`fanet_mw.extensions`): a class that takes the places [n, 3] where the UAVs start,
    and the scenario.
    """

    def track(self, t_s: float) -> Track:
        """The places of all UAVs at a swarm instant [s], asked in order; the same calls give the same places."""
        ...
