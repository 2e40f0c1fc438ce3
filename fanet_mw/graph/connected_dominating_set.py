"""A connected dominating set by local decisions: if its nodes relay, a flood reaches all nodes of a connected swarm.

Each node is in the set or hears a node of the set, and the set is connected. The set has no redundancy, so a frame that
a relay loses may be lost to others, too.
"""

from collections.abc import Mapping

from fanet_mw.graph.topology import Adjacency, components
from fanet_mw.rng import priority_hash
from fanet_mw.units import NodeId


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
