"""Divides nodes into k balanced, connected clusters: recursive bisection along the longer axis, or along the graph.

A cut by position that leaves both sides connected is taken; where it would tear one, the side is grown hop by hop from
one end of the graph. The head is the node nearest to the middle, unless others have fewer members farther than three
hops. Sizes differ by at most one where all cuts are by position. The paper gives k, but not how it chooses the members.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.graph.topology import Adjacency, components, levels
from fanet_mw.routing.clustered.clustering.contract import Cluster, Promise, Swarm
from fanet_mw.units import Enu, NodeId

_NEAR_HOPS: Final = 3


def balanced(positions: Mapping[NodeId, Enu], adjacency: Adjacency, *, count: int) -> list[Cluster]:
    """Divide the nodes into `count` clusters (fewer when there are fewer nodes), each connected if the swarm is."""
    nodes = sorted(positions)
    count = min(count, len(nodes))
    return [_with_head(part, positions, adjacency) for part in _split(nodes, positions, adjacency, count) if part]


class Balanced(NamedTuple):
    """The method `balanced` behind the contract. A member may be out of its head's range."""

    clusters: int

    @property
    def promise(self) -> Promise:
        return Promise(dominating=False)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        return balanced(swarm.positions, swarm.adjacency, count=self.clusters)


def among(nodes: Sequence[NodeId], adjacency: Adjacency) -> Adjacency:
    """The links of some nodes with each other."""
    inside = frozenset(nodes)
    return {node: tuple(near for near in adjacency[node] if near in inside) for node in nodes}


def _split(
    nodes: list[NodeId], positions: Mapping[NodeId, Enu], adjacency: Adjacency, count: int
) -> list[list[NodeId]]:
    if count <= 1:
        return [nodes] * count
    low = count // 2
    cut = (len(nodes) * low + count // 2) // count
    ordered = _by_position(nodes, positions)
    sides = ordered[:cut], ordered[cut:]
    links = among(nodes, adjacency)
    if len(components(links)) == 1 and any(len(components(among(side, links))) > 1 for side in sides):
        sides = _by_hops(links, ordered[0], cut)
        low = min(max(round(count * len(sides[0]) / len(nodes)), 1, count - len(sides[1])), count - 1, len(sides[0]))
    return _split(sides[0], positions, adjacency, low) + _split(sides[1], positions, adjacency, count - low)


def _by_position(nodes: list[NodeId], positions: Mapping[NodeId, Enu]) -> list[NodeId]:
    """The nodes in order along the longer axis."""
    easts = [positions[n].east for n in nodes]
    norths = [positions[n].north for n in nodes]
    along_east = max(easts) - min(easts) >= max(norths) - min(norths)

    def place(node: NodeId) -> tuple[float, float, NodeId]:
        at = positions[node]
        return (at.east, at.north, node) if along_east else (at.north, at.east, node)

    return sorted(nodes, key=place)


def _by_hops(links: Adjacency, start: NodeId, cut: int) -> tuple[list[NodeId], list[NodeId]]:
    """Two connected sides of a connected graph, the first of about `cut` nodes, from one end of it to the other."""
    begin = _farthest(levels(links, start))
    from_begin = levels(links, begin)
    end = _farthest(from_begin)
    to_end = levels(links, end)
    ordered = sorted(links, key=lambda node: (from_begin[node] - to_end[node], from_begin[node], node))
    first = _joined(ordered[:cut], begin, links)
    second = _joined([node for node in ordered if node not in first], end, links)
    return [node for node in ordered if node not in second], sorted(second)


def _farthest(hops: Mapping[NodeId, int]) -> NodeId:
    return max(hops, key=lambda node: (hops[node], -node))


def _joined(nodes: Sequence[NodeId], to: NodeId, links: Adjacency) -> frozenset[NodeId]:
    """The nodes with a way to one of them over these nodes."""
    return frozenset(levels(among(nodes, links), to))


def _with_head(members: list[NodeId], positions: Mapping[NodeId, Enu], adjacency: Adjacency) -> Cluster:
    size = len(members)
    middle = Enu(
        sum(positions[n].east for n in members) / size,
        sum(positions[n].north for n in members) / size,
        sum(positions[n].up for n in members) / size,
    )
    links = among(members, adjacency)

    def far(node: NodeId) -> int:
        hops = levels(links, node)
        return sum(hops.get(member, size) > _NEAR_HOPS for member in members)

    head = min(members, key=lambda n: (far(n), positions[n].minus(middle).norm(), n))
    return Cluster(head, tuple(sorted(members)))
