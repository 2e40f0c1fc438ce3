"""MOBIC (Basu, Khan and Little 2001): heads by aggregate local mobility. No scenario offers it; it is compared with."""

import math
from collections.abc import Iterable

from fanet_mw.routing.clustered.clustering import Elected, Swarm
from fanet_mw.units import NodeId


def by_mobility(node: NodeId, swarm: Swarm) -> float:
    """The score of a node: its aggregate local mobility."""
    return swarm.mobility.get(node, 0.0)


MOBIC = Elected(by_mobility)


def aggregate_mobility_db2(powers_dbm: Iterable[tuple[float, float]]) -> float:
    """MOBIC's M of one node [dB^2]: the mean square of the relative mobility to each neighbor (Basu et al. 2001).

    Each pair is (previous, new) received power of two successive hellos of one neighbor. Their ratio, new - previous
    in dB, is positive when it comes nearer. Mean square and not variance: the deviation is from 0, from not moving.
    """
    squares = [(new - old) ** 2 for old, new in powers_dbm]
    return math.fsum(squares) / len(squares) if squares else 0.0
