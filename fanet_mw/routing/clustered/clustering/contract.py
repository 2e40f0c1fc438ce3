"""What every clustering method takes and gives. `tests/property/test_clustering_contract.py` holds all to it.

Every node is in exactly one cluster, each cluster has one head, which is its member; the result depends on the inputs
alone, not on their order. What a method says of its heads beyond that, it promises in `Promise`.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol

from fanet_mw.graph.topology import Adjacency
from fanet_mw.units import Enu, NodeId

_NOTHING: Final[Mapping[NodeId, float]] = MappingProxyType({})
_UNKNOWN: Final[Mapping[NodeId, Enu]] = MappingProxyType({})


class Cluster(NamedTuple):
    """One cluster: its head is one of its members."""

    head: NodeId
    members: tuple[NodeId, ...]


class Swarm(NamedTuple):
    """What is known of the nodes; positions and adjacency have the same keys, the rest may lack some or all."""

    positions: Mapping[NodeId, Enu]
    adjacency: Adjacency
    energy: Mapping[NodeId, float] = _NOTHING
    """What is left, 0..1; 1 where not known."""
    mobility: Mapping[NodeId, float] = _NOTHING
    """Aggregate local mobility [dB^2], see `mobility.py`; 0 where not known."""
    velocities: Mapping[NodeId, Enu] = _UNKNOWN
    """[m/s]; at rest where not known."""
    previous: Sequence[Cluster] = ()
    """The clusters that stand now, for methods that keep heads."""


class Promise(NamedTuple):
    """`dominating`: each member hears its head. `independent`: no two heads hear each other."""

    dominating: bool
    independent: bool


class Clustering(Protocol):
    """A way to divide a swarm."""

    @property
    def promise(self) -> Promise: ...

    def divide(self, swarm: Swarm) -> list[Cluster]:
        """The clusters, in an order that the inputs decide."""
        ...


def heads_of(clusters: Sequence[Cluster]) -> tuple[NodeId, ...]:
    """The heads, ascending."""
    return tuple(sorted(cluster.head for cluster in clusters))
