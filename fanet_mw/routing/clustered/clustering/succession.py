"""Who stands in for a cluster's head, and in which order; the same for every method of clustering."""

from fanet_mw.routing.clustered.clustering.contract import Cluster, Swarm
from fanet_mw.units import NodeId


def succession(cluster: Cluster, swarm: Swarm) -> tuple[NodeId, ...]:
    """The head, then its stand-ins in order: members that hear the head first, as they notice when it is gone."""
    near, inside = frozenset(swarm.adjacency[cluster.head]), frozenset(cluster.members)

    def rank(node: NodeId) -> tuple[bool, int, NodeId]:
        return node not in near, -sum(1 for n in swarm.adjacency[node] if n in inside), node

    return (cluster.head, *sorted((node for node in cluster.members if node != cluster.head), key=rank))
