"""The contract of clustering methods; `tests/property/test_clustering_contract.py` checks every method against it.

Each node is in exactly one cluster, and each cluster has one head, which is one of its members. The result depends on
the inputs alone, and not on their order. A method that guarantees more about its heads says so in a `Promise`.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol

from fanet_mw.graph.topology import Adjacency
from fanet_mw.units import Enu, NodeId

_UNKNOWN: Final[Mapping[NodeId, Enu]] = MappingProxyType({})


class Cluster(NamedTuple):
    """One cluster: its head is one of its members."""

    head: NodeId
    members: tuple[NodeId, ...]


class Swarm(NamedTuple):
    """What is known of the nodes. Positions and adjacency have the same keys; the other maps may lack some nodes."""

    positions: Mapping[NodeId, Enu]
    adjacency: Adjacency
    velocities: Mapping[NodeId, Enu] = _UNKNOWN
    """Velocities [m/s]; a node that is missing here is at rest."""
    previous: Sequence[Cluster] = ()
    """The present clusters, for methods that keep heads."""


class Promise(NamedTuple):
    """What a method guarantees: with `dominating` each member hears its head."""

    dominating: bool


class Clustering(Protocol):
    """A method that divides a swarm into clusters."""

    @property
    def promise(self) -> Promise: ...

    def divide(self, swarm: Swarm) -> list[Cluster]:
        """The clusters, in an order that depends only on the inputs."""
        ...


def succession(cluster: Cluster, swarm: Swarm) -> tuple[NodeId, ...]:
    """The head, then its stand-ins in order: members that hear the head first, as they notice when it is gone."""
    near, inside = frozenset(swarm.adjacency[cluster.head]), frozenset(cluster.members)

    def rank(node: NodeId) -> tuple[bool, int, NodeId]:
        return node not in near, -sum(1 for n in swarm.adjacency[node] if n in inside), node

    return (cluster.head, *sorted((node for node in cluster.members if node != cluster.head), key=rank))
