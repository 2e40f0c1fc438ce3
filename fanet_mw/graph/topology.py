"""The topology of a swarm: each node's neighbors in order of id, as plain values. Pure functions.

`symmetric` keeps only links that work both ways. Not modeled: link quality; a link exists or not.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import Final, TypeVar

from fanet_mw.rng import priority_hash
from fanet_mw.units import Enu, NodeId

Adjacency = Mapping[NodeId, tuple[NodeId, ...]]
"""The neighbors of each node, ascending. Every node is a key; if b is a neighbor of a, then a is a neighbor of b."""

N = TypeVar("N", bound=int)
"""A node, or a place of a formation."""

_MIN_CELL_M: Final = 1e-3


def symmetric(heard: Mapping[NodeId, Collection[NodeId]]) -> dict[NodeId, tuple[NodeId, ...]]:
    """Keep the links on which both ends hear each other; nodes that are named only by others are dropped."""
    nodes = sorted(heard)
    sets = {node: frozenset(heard[node]) for node in nodes}
    return {
        node: tuple(other for other in sorted(sets[node]) if other != node and other in sets and node in sets[other])
        for node in nodes
    }


def within_range(
    positions: Mapping[NodeId, Enu], *, range_m: float, reaches: Mapping[NodeId, float] = {}
) -> dict[NodeId, tuple[NodeId, ...]]:
    """All nodes within `range_m` in 3 dimensions; `reaches`: factors of nodes with antennas of their own."""
    cell_m = max(range_m, _MIN_CELL_M)
    cells: dict[tuple[int, int], list[NodeId]] = {}
    place = {node: (int(at.east // cell_m), int(at.north // cell_m)) for node, at in positions.items()}
    for node in sorted(positions):
        cells.setdefault(place[node], []).append(node)

    def near(node: NodeId) -> Iterable[NodeId]:
        east, north = place[node]
        for x in (east - 1, east, east + 1):
            for y in (north - 1, north, north + 1):
                yield from cells.get((x, y), ())

    found = {
        node: {n for n in near(node) if n != node and positions[n].minus(positions[node]).norm() <= range_m}
        for node in sorted(positions)
    }
    for node, times in sorted(reaches.items()):
        if node in positions:
            far = [n for n in positions if n != node and positions[n].minus(positions[node]).norm() <= times * range_m]
            found[node].update(far)
            for other in far:
                found[other].add(node)
    return {node: tuple(sorted(others)) for node, others in found.items()}


def two_hop(adjacency: Adjacency) -> dict[NodeId, tuple[NodeId, ...]]:
    """The nodes within two hops of each node: their frames can collide with its own at a common neighbor."""
    found = {}
    for node in sorted(adjacency):
        reach = set(adjacency[node])
        for neighbor in adjacency[node]:
            reach.update(adjacency[neighbor])
        reach.discard(node)
        found[node] = tuple(sorted(reach))
    return found


def levels(adjacency: Mapping[N, Iterable[N]], *roots: N) -> dict[N, int]:
    """The hops from the nearest root to each node, breadth first; nodes that cannot be reached are missing."""
    hops = dict.fromkeys(roots, 0)
    frontier = list(roots)
    while frontier:
        following = []
        for node in frontier:
            for neighbor in adjacency[node]:
                if neighbor not in hops:
                    hops[neighbor] = hops[node] + 1
                    following.append(neighbor)
        frontier = following
    return hops


def components(adjacency: Adjacency) -> list[tuple[NodeId, ...]]:
    """The connected components of a swarm, each as its nodes, in the order of their lowest ids."""
    done: set[NodeId] = set()
    found = []
    for node in sorted(adjacency):
        if node not in done:
            part = tuple(sorted(levels(adjacency, node)))
            done.update(part)
            found.append(part)
    return found


def dominates(node: NodeId, adjacency: Adjacency) -> bool:
    """True if `node` decides to belong to the set; `adjacency` needs only the node and its neighbors. It does not if
    any two of its neighbors (as where all hear each other) are connected directly or over stronger nodes within its two
    hops (coverage condition I of Wu & Dai, "A generic distributed broadcast scheme in ad hoc wireless networks", ICDCS
    2003). A hash of the id breaks ties: with plain ids, a swarm numbered row by row has no node with stronger ones all
    around.
    """
    near = {n: frozenset(adjacency[n]) for n in (node, *adjacency[node])}
    if _complete(adjacency[node], near):
        return False
    ours = _strength(node)
    known = frozenset().union(*near.values()) - {node}
    stronger = sorted(n for n in known if _strength(n) > ours)
    links = {n: tuple(m for m in stronger if m in near.get(n, ()) or n in near.get(m, ())) for n in stronger}
    ways = [frozenset(part) for part in components(links)]
    over = {n: frozenset(i for i, way in enumerate(ways) if n in way or near[n] & way) for n in adjacency[node]}
    return not all(
        b in near[a] or over[a] & over[b] for i, a in enumerate(adjacency[node]) for b in adjacency[node][i + 1 :]
    )


def _strength(node: NodeId) -> tuple[int, NodeId]:
    return priority_hash(node), node


def _complete(nodes: tuple[NodeId, ...], near: Mapping[NodeId, frozenset[NodeId]]) -> bool:
    return all(b in near[a] for i, a in enumerate(nodes) for b in nodes[i + 1 :])
