"""Divides nodes into k balanced clusters by position: recursive bisection along the longer axis.

The head of a cluster is the node nearest to its middle. Sizes differ by at most one, clusters are contiguous in space,
and the result depends only on positions and ids. The paper gives k, but not how it chooses the members.
"""

from collections.abc import Mapping
from typing import NamedTuple

from fanet_mw.routing.clustered.clustering.contract import Cluster, Promise, Swarm
from fanet_mw.units import Enu, NodeId


def balanced(positions: Mapping[NodeId, Enu], *, count: int) -> list[Cluster]:
    """Divide the nodes into `count` clusters (fewer when there are fewer nodes), from south-west to north-east."""
    nodes = sorted(positions)
    count = min(count, len(nodes))
    return [_with_head(part, positions) for part in _split(nodes, positions, count)] if count else []


class Balanced(NamedTuple):
    """The method `balanced` behind the contract. It sees only positions, so a member may be out of its head's range."""

    clusters: int

    @property
    def promise(self) -> Promise:
        return Promise(dominating=False, independent=False)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        return balanced(swarm.positions, count=self.clusters)


def _split(nodes: list[NodeId], positions: Mapping[NodeId, Enu], count: int) -> list[list[NodeId]]:
    if count == 1:
        return [nodes]
    easts = [positions[n].east for n in nodes]
    norths = [positions[n].north for n in nodes]
    along_east = max(easts) - min(easts) >= max(norths) - min(norths)

    def place(node: NodeId) -> tuple[float, float, NodeId]:
        at = positions[node]
        return (at.east, at.north, node) if along_east else (at.north, at.east, node)

    ordered = sorted(nodes, key=place)
    low = count // 2
    cut = (len(nodes) * low + count // 2) // count
    return _split(ordered[:cut], positions, low) + _split(ordered[cut:], positions, count - low)


def _with_head(members: list[NodeId], positions: Mapping[NodeId, Enu]) -> Cluster:
    size = len(members)
    middle = Enu(
        sum(positions[n].east for n in members) / size,
        sum(positions[n].north for n in members) / size,
        sum(positions[n].up for n in members) / size,
    )
    head = min(members, key=lambda n: (positions[n].minus(middle).norm(), n))
    return Cluster(head, tuple(sorted(members)))
