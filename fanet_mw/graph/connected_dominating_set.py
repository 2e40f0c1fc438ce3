"""Connected dominating sets: relays with which a flood reaches all nodes, because each node is in the set or hears it.

There are two constructions: `wu_li` needs only two-hop knowledge, so that each node can decide for itself whether it
belongs; `guha_khuller` sees the whole topology and needs fewer relays. A swarm in several parts gets one set per part,
with at least one node. Without a spare relay a loss is final; redundancy takes more relays.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fanet_mw.graph.topology import Adjacency, components
from fanet_mw.rng import priority_hash
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


def dominates(node: NodeId, adjacency: Adjacency, *, priority: Mapping[NodeId, float] = _EQUAL) -> bool:
    """True if `node` belongs to the set, as it decides by itself; `adjacency` needs only the node and its neighbors.

    It does not belong if any two of its neighbors hear each other or are connected over nodes that are all stronger
    (coverage condition I of Wu & Dai, "A generic distributed broadcast scheme in ad hoc wireless networks", ICDCS
    2003), as far as its two hops show. This prunes what rule k prunes, and more in sparse swarms, where connections
    lead around the node. A hash of the id breaks ties: with plain ids, a swarm numbered row by row has no node with
    stronger ones all around. Where all nodes hear each other none belongs, because each sender reaches all.
    """
    near = {n: frozenset(adjacency[n]) for n in (node, *adjacency[node])}
    if _complete(adjacency[node], near):
        return False
    ours = _strength(node, priority)
    known = frozenset().union(*near.values()) - {node}
    stronger = {n for n in known if _strength(n, priority) > ours}
    links = {
        n: tuple(m for m in sorted(stronger) if m in near.get(n, ()) or n in near.get(m, ())) for n in sorted(stronger)
    }
    ways = [frozenset(part) for part in components(links)]
    over = {n: frozenset(i for i, way in enumerate(ways) if n in way or near[n] & way) for n in adjacency[node]}
    return not all(
        b in near[a] or over[a] & over[b] for i, a in enumerate(adjacency[node]) for b in adjacency[node][i + 1 :]
    )


def _strength(node: NodeId, priority: Mapping[NodeId, float]) -> tuple[float, int, NodeId]:
    return priority.get(node, 0.0), priority_hash(node), node


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
