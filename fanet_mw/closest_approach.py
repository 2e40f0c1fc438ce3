"""The closest point of approach of two bodies that continue to fly straight. Pure geometry.

With r from one to the other and v the other's velocity relative to it, |r + v t| is least at t = -r.v / v.v (the TCPA
and DCPA of collision avoidance at sea and in the air).
"""

from typing import NamedTuple

from fanet_mw.units import Enu


class ClosestApproach(NamedTuple):
    """The instant at which two bodies are closest to each other, and the vector between them at that instant."""

    closest_s: float
    """The time until then, from now; 0 when they are nearest now."""
    apart: Enu
    """The vector from one body to the other at that time [m]."""

    @property
    def distance_m(self) -> float:
        return self.apart.norm()


def closest(position: Enu, velocity: Enu, *, within_s: float) -> ClosestApproach:
    """The closest approach in [0, `within_s`] of a body whose position and velocity relative to the other are given."""
    speed2 = velocity.east**2 + velocity.north**2 + velocity.up**2
    closing = -(position.east * velocity.east + position.north * velocity.north + position.up * velocity.up)
    at_s = min(max(0.0, closing / speed2), within_s) if speed2 > 0 else 0.0
    return ClosestApproach(
        at_s,
        Enu(
            position.east + velocity.east * at_s,
            position.north + velocity.north * at_s,
            position.up + velocity.up * at_s,
        ),
    )
