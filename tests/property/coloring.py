"""Slots with spatial reuse, computed at one place: two nodes share a slot only beyond two hops of each other.

No node then receives two frames of one slot, so frames in slots do not collide with each other, not even those of
hidden stations. The least number of slots is a graph coloring of the two-hop conflicts (NP-hard); each of the two
greedy orders needs at most the greatest number of conflicts plus one. Tests and benchmarks compare claims over the air
with these. Not modeled: interference from beyond two hops.
"""

import heapq
from collections.abc import Mapping

from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.clustered.claimed.slot_claims import lowest_free
from fanet_mw.units import NodeId


def welsh_powell(adjacency: Adjacency) -> dict[NodeId, int]:
    """The lowest free slot for each node, nodes with most conflicts first (Welsh & Powell 1967)."""
    rivals = two_hop(adjacency)
    slots: dict[NodeId, int] = {}
    for node in sorted(rivals, key=lambda n: (-len(rivals[n]), n)):
        slots[node] = lowest_free(slots[rival] for rival in rivals[node] if rival in slots)
    return slots


def dsatur(adjacency: Adjacency) -> dict[NodeId, int]:
    """The lowest free slot for each node, next the node with most different slots among its rivals (Brelaz 1979)."""
    rivals = two_hop(adjacency)
    seen: dict[NodeId, set[int]] = {node: set() for node in rivals}
    heap = [(0, -len(rivals[node]), node) for node in rivals]
    heapq.heapify(heap)
    slots: dict[NodeId, int] = {}
    while heap:
        saturation, _, node = heapq.heappop(heap)
        if node in slots or -saturation != len(seen[node]):
            continue  # the entry is outdated: the node was pushed again when its rivals had more slots
        slots[node] = lowest_free(seen[node])
        for rival in rivals[node]:
            if rival not in slots and slots[node] not in seen[rival]:
                seen[rival].add(slots[node])
                heapq.heappush(heap, (-len(seen[rival]), -len(rivals[rival]), rival))
    return slots


def clashes(slots: Mapping[NodeId, int | None], adjacency: Adjacency) -> list[tuple[NodeId, NodeId]]:
    """Pairs within two hops that share a slot, the lower id first; a node without a slot clashes with none."""
    rivals = two_hop(adjacency)
    return [
        (node, rival)
        for node in sorted(rivals)
        for rival in rivals[node]
        if node < rival and slots.get(node) is not None and slots.get(node) == slots.get(rival)
    ]
