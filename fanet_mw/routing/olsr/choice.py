"""What an OLSR node concludes: its multipoint relays (RFC 3626, 8.3.1) and its routing table (10). Pure functions."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fanet_mw.routing.olsr.parameters import WILL_ALWAYS, WILL_NEVER
from fanet_mw.units import NodeId


def multipoint_relays(
    node: NodeId, neighbors: Mapping[NodeId, frozenset[NodeId]], willingness: Mapping[NodeId, int]
) -> list[NodeId]:
    """Neighbors that together reach every strict 2-hop neighbor (8.3.1), ascending.

    `neighbors` gives for each symmetric neighbor its own symmetric neighbors. Ties that the RFC leaves open go to the
    lowest id. The optional step 5 (leave out what others cover) is not taken.
    """
    willing = [n for n in sorted(neighbors) if willingness[n] != WILL_NEVER]
    reach = {n: neighbors[n] - frozenset(neighbors) - {node} for n in willing}
    uncovered = set().union(*reach.values())
    chosen = [n for n in willing if willingness[n] == WILL_ALWAYS]
    providers: dict[NodeId, list[NodeId]] = {}
    for n in willing:
        for far in sorted(reach[n]):
            providers.setdefault(far, []).append(n)
    chosen += [only[0] for far, only in sorted(providers.items()) if len(only) == 1]
    for n in chosen:
        uncovered -= reach[n]
    while uncovered:
        best = max(
            (n for n in willing if reach[n] & uncovered),
            key=lambda n: (willingness[n], len(reach[n] & uncovered), len(reach[n]), -n),
        )
        chosen.append(best)
        uncovered -= reach[best]
    return sorted(set(chosen))


class Route(NamedTuple):
    """An entry of the routing table."""

    next_hop: NodeId
    hops: int


def routing_table(
    node: NodeId,
    neighbors: Mapping[NodeId, Sequence[NodeId]],
    willingness: Mapping[NodeId, int],
    topology: Sequence[tuple[NodeId, NodeId]],
) -> dict[NodeId, Route]:
    """The shortest known way to everyone (10): neighbors, 2-hop neighbors, then the topology set hop by hop.

    `topology` holds (last hop, destination). Of equally short ways the one over the lowest ids wins.
    """
    routes = {neighbor: Route(neighbor, 1) for neighbor in sorted(neighbors)}
    for neighbor in sorted(neighbors):
        if willingness[neighbor] != WILL_NEVER:
            for far in neighbors[neighbor]:
                if far != node and far not in routes:
                    routes[far] = Route(neighbor, 2)
    onward: dict[NodeId, list[NodeId]] = {}
    for last, destination in topology:
        onward.setdefault(last, []).append(destination)
    ring, hops = [far for far in routes if routes[far].hops == 2], 2
    while ring:
        hops += 1
        wider: list[NodeId] = []
        for last in sorted(ring):
            for destination in onward.get(last, ()):
                if destination != node and destination not in routes:
                    routes[destination] = Route(routes[last].next_hop, hops)
                    wider.append(destination)
        ring = wider
    return routes
