"""A small connected dominating set of links that are known as a whole: if its nodes relay, a flood reaches all nodes.

The set has no redundancy, so a frame that a relay loses may be lost to others, too.
"""

from collections.abc import Sequence
from heapq import heapify, heappop, heappush

from fanet_mw.graph.topology import nodes_of
from fanet_mw.units import NodeId


def greedy_dominating_set(links: Sequence[int], node: NodeId) -> int:
    """The relays of the part of the swarm in which `node` is: the one with most neighbors, then always the one next to
    the set that reaches most others (Guha and Khuller, 1998, algorithm I). Whoever knows the same links finds the same.

    `links`: the neighbors of each node, by its id; the first entry is of no node. Sets are integers as in `nodes_of`.
    """
    part = ring = 1 << (node - 1)
    while ring:
        around = 0
        for each in nodes_of(ring):
            around |= links[each]
        ring = around & ~part
        part |= ring
    first = max(nodes_of(part), key=lambda each: (links[each].bit_count(), -each))
    relays = 1 << (first - 1)
    reached = relays | links[first]
    next_to = [(-(links[each] & ~reached).bit_count(), each) for each in nodes_of(links[first])]
    heapify(next_to)
    while next_to:
        most, each = heappop(next_to)
        new = links[each] & ~reached
        if new.bit_count() < -most:  # others have reached some of these meanwhile
            heappush(next_to, (-new.bit_count(), each))
        elif new:
            relays |= 1 << (each - 1)
            reached |= new
            for other in nodes_of(new):
                heappush(next_to, (-(links[other] & ~reached).bit_count(), other))
    return relays
