"""Connected dominating sets that need more knowledge than a node has: for comparison with what nodes decide themselves.

`wu_li` uses two-hop knowledge, `guha_khuller` the whole topology, which takes fewer relays. A swarm in several parts
gets one set per part, with at least one node.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fanet_mw.graph.topology import Adjacency, components
from fanet_mw.units import NodeId

_EQUAL: Final[Mapping[NodeId, float]] = MappingProxyType({})


def wu_li(adjacency: Adjacency, *, priority: Mapping[NodeId, float] = _EQUAL) -> tuple[NodeId, ...]:
    """Marking (Wu & Li 1999) and pruning by rule k (Dai & Wu 2004), which contains their rules 1 and 2.

    A node is marked when two of its neighbors do not hear each other. It is pruned when marked neighbors of higher
    priority (the number, then the id), connected among themselves, hear all of its neighbors.
    """
    near = {node: frozenset(adjacency[node]) for node in adjacency}
    marked = frozenset(node for node in adjacency if not _complete(adjacency[node], near))
    rank = {node: (priority.get(node, 0.0), node) for node in adjacency}
    kept = {node for node in marked if not _covered(node, marked, near, rank)}
    for part in components(adjacency):
        if not any(node in kept for node in part):
            kept.add(max(part, key=rank.__getitem__))  # all hear each other, so one relay is enough
    return tuple(sorted(kept))


def _complete(nodes: tuple[NodeId, ...], near: Mapping[NodeId, frozenset[NodeId]]) -> bool:
    return all(b in near[a] for i, a in enumerate(nodes) for b in nodes[i + 1 :])


def _covered(
    node: NodeId,
    marked: frozenset[NodeId],
    near: Mapping[NodeId, frozenset[NodeId]],
    rank: Mapping[NodeId, tuple[float, NodeId]],
) -> bool:
    stronger = {n: () for n in sorted(near[node]) if n in marked and rank[n] > rank[node]}
    among = {n: tuple(sorted(m for m in near[n] if m in stronger)) for n in stronger}
    return any(near[node] <= frozenset(part).union(*(near[n] for n in part)) for part in components(among))


def guha_khuller(adjacency: Adjacency) -> tuple[NodeId, ...]:
    """Grow one tree per part from its best connected node; always add the relay that reaches most new nodes.

    Guha & Khuller 1998, algorithm I, with its look-ahead over pairs: a relay that reaches few may open the way to one
    that reaches many.
    """
    relays: list[NodeId] = []
    for part in components(adjacency):
        relays += _grow(part, adjacency)
    return tuple(sorted(relays))


def _grow(part: tuple[NodeId, ...], adjacency: Adjacency) -> list[NodeId]:
    first = max(part, key=lambda n: (len(adjacency[n]), -n))
    relays = [first]
    white = set(part) - {first, *adjacency[first]}
    gray = set(adjacency[first])
    while white:
        best = max(_steps(sorted(gray), adjacency, white), key=lambda step: (step[0], [-n for n in step[1]]))
        for node in best[1]:
            relays.append(node)
            gray.update(n for n in adjacency[node] if n in white)
            white.difference_update(adjacency[node])
            gray.discard(node)
    return relays


def _steps(gray: list[NodeId], adjacency: Adjacency, white: set[NodeId]) -> list[tuple[float, tuple[NodeId, ...]]]:
    """The new nodes per relay of each gray node, alone or with one of its white neighbors."""
    steps: list[tuple[float, tuple[NodeId, ...]]] = []
    for node in gray:
        fresh = frozenset(n for n in adjacency[node] if n in white)
        if not fresh:
            continue
        steps.append((len(fresh), (node,)))
        for second in sorted(fresh):
            more = fresh.union(n for n in adjacency[second] if n in white)
            steps.append((len(more) / 2, (node, second)))
    return steps
