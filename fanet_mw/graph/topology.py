"""The topology of a swarm: each node's neighbors in order of id, as plain values. Pure functions.

`symmetric` keeps only links that work both ways. Not modeled: link quality; a link exists or not.
"""

from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache
from typing import Final, TypeVar

from fanet_mw.rng import priority_hash
from fanet_mw.units import Enu, NodeId

Adjacency = Mapping[NodeId, tuple[NodeId, ...]]
"""The neighbors of each node, ascending. Every node is a key; if b is a neighbor of a, then a is a neighbor of b."""

N = TypeVar("N", bound=int)
"""A node, or a place of a formation."""

_MIN_CELL_M: Final = 1e-3
_REMEMBERED: Final = 4096
"""The sets of nodes whose members a process remembers; most are the neighbors of somebody, and asked for again."""


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


@lru_cache(maxsize=_REMEMBERED)
def nodes_of(bits: int) -> tuple[NodeId, ...]:
    """The nodes of a set, in order: bit i stands for node i + 1."""
    nodes = []
    while bits:
        last = bits & -bits
        nodes.append(NodeId(last.bit_length()))
        bits ^= last
    return tuple(nodes)


def bits_of(nodes: Iterable[int]) -> int:
    """The set of these nodes: bit i stands for node i + 1."""
    return sum(1 << (node - 1) for node in nodes)


def link_sets(adjacency: Adjacency) -> dict[NodeId, int]:
    """The neighbors of each node as `bits_of` gives them."""
    return {node: bits_of(neighbors) for node, neighbors in adjacency.items()}


def dominates(node: NodeId, links: Mapping[NodeId, int]) -> bool:
    """True if `node` decides to belong to the set; `links`: `link_sets` of it and of its neighbors.

    It does not if any two of its neighbors are connected directly or over stronger nodes within its two hops (coverage
    condition I of Wu & Dai, "A generic distributed broadcast scheme in ad hoc wireless networks", ICDCS 2003). A hash
    of the id breaks ties: with plain ids, a swarm numbered row by row has no node with stronger ones all around.
    """
    ours = links[node]
    near = nodes_of(ours)
    later = {a: ours >> a << a for a in near}  # those with greater ids, so that each pair is looked at once
    if not any(later[a] & ~links[a] for a in near):
        return False
    known = ours
    for a in near:
        known |= links[a]
    reached = {a: links[a] for a in near}
    for way in _ways(links, near, known & _stronger_than(node, known.bit_length())):
        beside = [a for a in near if links[a] & way]  # or it is the way by itself, and joins nobody
        joined = bits_of(beside)
        for a in beside:
            reached[a] |= joined
    return any(later[a] & ~reached[a] for a in near)


def _ways(links: Mapping[NodeId, int], near: Iterable[NodeId], stronger: int) -> list[int]:
    """The connected parts of the stronger nodes, by the links of the near ones."""
    ways: list[int] = []
    apart = stronger
    for a in near:
        if stronger >> (a - 1) & 1:
            way = (links[a] | 1 << (a - 1)) & stronger
            apart &= ~way
            for other in [other for other in ways if other & way]:
                ways.remove(other)
                way |= other
            ways.append(way)
    return ways + [1 << (alone - 1) for alone in nodes_of(apart)]


@lru_cache(maxsize=_REMEMBERED)
def _stronger_than(node: NodeId, count: int) -> int:
    """The nodes, of the first `count` ones, that are stronger than `node`."""
    ours = _strength(node)
    return bits_of(n for n in range(1, count + 1) if _strength(NodeId(n)) > ours)


def _strength(node: NodeId) -> tuple[int, NodeId]:
    return priority_hash(node), node
