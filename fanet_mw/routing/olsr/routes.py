"""The routing table that an OLSR node computes (RFC 3626, 10), as a pure function."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fanet_mw.routing.olsr.parameters import WILL_NEVER
from fanet_mw.units import NodeId


class OlsrRoute(NamedTuple):
    """An entry of the routing table."""

    next_hop: NodeId
    hops: int


def routing_table(
    node: NodeId,
    neighbors: Mapping[NodeId, Sequence[NodeId]],
    willingness: Mapping[NodeId, int],
    topology: Sequence[tuple[NodeId, NodeId]],
) -> dict[NodeId, OlsrRoute]:
    """The shortest known routes (10), `topology` by pairs (last hop, destination); ties by the lowest last hop."""
    routes = {neighbor: OlsrRoute(neighbor, 1) for neighbor in sorted(neighbors)}
    for neighbor in sorted(neighbors):
        if willingness[neighbor] != WILL_NEVER:
            for far in neighbors[neighbor]:
                if far != node and far not in routes:
                    routes[far] = OlsrRoute(neighbor, 2)
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
                    routes[destination] = OlsrRoute(routes[last].next_hop, hops)
                    wider.append(destination)
        ring = wider
    return routes
