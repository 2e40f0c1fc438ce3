"""Multipoint relays: the neighbors that relay what a node sends, so that every node two hops away receives it.

Each node chooses its own relays from what its neighbors' hellos say (RFC 3626, 8.3.1). A packet is relayed by the nodes
that its last sender has chosen. Unlike in a connected dominating set, the relays depend on where the packet comes from.
"""

from collections.abc import Mapping

from fanet_mw.graph.topology import Adjacency
from fanet_mw.routing.olsr.parameters import WILL_ALWAYS, WILL_DEFAULT, WILL_NEVER
from fanet_mw.units import NodeId


def multipoint_relays(node: NodeId, adjacency: Adjacency, *, willingness: Mapping[NodeId, int]) -> tuple[NodeId, ...]:
    """The relays of `node`, of which `adjacency` must hold it and its neighbors. As in the RFC: always willing ones;
    those that alone reach some node; then by willingness, nodes added, degree, lower id. Redundant ones are not
    dropped, an optional step.
    """
    will = {n: willingness.get(n, WILL_DEFAULT) for n in adjacency[node]}
    near = frozenset(adjacency[node])
    reach = {
        n: frozenset(m for m in adjacency[n] if m != node and m not in near)
        for n in adjacency[node]
        if will[n] != WILL_NEVER
    }
    relays = {n for n in reach if will[n] == WILL_ALWAYS}
    relays |= _only_ones(reach)
    missing = set().union(*reach.values()) if reach else set()
    for n in relays:
        missing -= reach[n]
    while missing:
        # The degree D(y) counts the neighbors of y other than `node` and its neighbors, which is the whole of `reach`.
        best = max(
            (n for n in reach if n not in relays and reach[n] & missing),
            key=lambda n: (will[n], len(reach[n] & missing), len(reach[n]), -n),
        )
        relays.add(best)
        missing -= reach[best]
    return tuple(sorted(relays))


def _only_ones(reach: Mapping[NodeId, frozenset[NodeId]]) -> set[NodeId]:
    through: dict[NodeId, list[NodeId]] = {}
    for n in reach:
        for far in sorted(reach[n]):
            through.setdefault(far, []).append(n)
    return {ways[0] for ways in through.values() if len(ways) == 1}
