"""The contract of a mobility model: where each UAV should be at an instant, and how that place moves."""

from typing import NamedTuple, Protocol

from sim.world.arrays import Rows


class Track(NamedTuple):
    """The place at which each UAV should be now, and how that place moves."""

    places: Rows
    velocities: Rows


class MobilityModel(Protocol):
    """Where UAVs fly while no setpoint says otherwise. A class of another package (`fanet_mw.extensions`) takes the
    places [n, 3] where they start, and the scenario.
    """

    def track(self, t_s: float) -> Track:
        """The places of all UAVs at a swarm instant [s], asked in order; the same calls give the same places."""
        ...
