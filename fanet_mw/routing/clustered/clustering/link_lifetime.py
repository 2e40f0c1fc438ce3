"""Relative motion of nodes: how long a link between two of them will last."""

import math

from fanet_mw.routing.clustered.clustering.contract import Swarm
from fanet_mw.units import STILL, Enu, NodeId


def link_lifetime_s(swarm: Swarm, a: NodeId, b: NodeId, *, range_m: float) -> float:
    """The time until two nodes leave each other's range, if both fly on straight [s]; infinite at equal velocities.

    Link expiration time after Su, Lee & Gerla 2001: the greater root of |offset + t drift| = range.
    """
    offset = swarm.positions[b].minus(swarm.positions[a])
    drift = swarm.velocities.get(b, STILL).minus(swarm.velocities.get(a, STILL))
    speed2 = _dot(drift, drift)
    if speed2 <= 0.0:
        return math.inf
    along = _dot(offset, drift)
    inside = along * along - speed2 * (_dot(offset, offset) - range_m * range_m)
    return max(0.0, (math.sqrt(inside) - along) / speed2) if inside >= 0 else 0.0


def _dot(a: Enu, b: Enu) -> float:
    return a.east * b.east + a.north * b.north + a.up * b.up
