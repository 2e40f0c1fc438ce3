"""Slots with spatial reuse, computed at one place: two nodes share a slot only beyond two hops of each other.

Then no node hears two frames of one slot, so slotted frames meet no collision among themselves, hidden stations
included. The fewest slots is graph coloring of the two-hop conflicts (NP-hard); the two greedy orders here need at most
the greatest number of conflicts plus one. `slot_claims.py` does the same over the air. Not modelled: interference from
beyond two hops.
"""

import heapq
from collections.abc import Iterable, Mapping
from itertools import count

from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.units import NodeId


def welsh_powell(adjacency: Adjacency) -> dict[NodeId, int]:
    """The lowest free slot for each node, those with most conflicts first (Welsh & Powell 1967)."""
    rivals = two_hop(adjacency)
    slots: dict[NodeId, int] = {}
    for node in sorted(rivals, key=lambda n: (-len(rivals[n]), n)):
        slots[node] = lowest_free(slots[rival] for rival in rivals[node] if rival in slots)
    return slots


def dsatur(adjacency: Adjacency) -> dict[NodeId, int]:
    """The lowest free slot for each node, next the one that sees most different slots taken (Brelaz 1979)."""
    rivals = two_hop(adjacency)
    seen: dict[NodeId, set[int]] = {node: set() for node in rivals}
    heap = [(0, -len(rivals[node]), node) for node in rivals]
    heapq.heapify(heap)
    slots: dict[NodeId, int] = {}
    while heap:
        saturation, _, node = heapq.heappop(heap)
        if node in slots or -saturation != len(seen[node]):
            continue  # an older entry: pushed again when it saw more
        slots[node] = lowest_free(seen[node])
        for rival in rivals[node]:
            if rival not in slots and slots[node] not in seen[rival]:
                seen[rival].add(slots[node])
                heapq.heappush(heap, (-len(seen[rival]), -len(rivals[rival]), rival))
    return slots


def lowest_free(taken: Iterable[int]) -> int:
    """The lowest slot that is not taken."""
    used = frozenset(taken)
    return next(slot for slot in count() if slot not in used)


def clashes(slots: Mapping[NodeId, int | None], adjacency: Adjacency) -> list[tuple[NodeId, NodeId]]:
    """Pairs within two hops that share a slot, the lower id first; nodes without a slot clash with nobody."""
    rivals = two_hop(adjacency)
    return [
        (node, rival)
        for node in sorted(rivals)
        for rival in rivals[node]
        if node < rival and slots.get(node) is not None and slots.get(node) == slots.get(rival)
    ]
