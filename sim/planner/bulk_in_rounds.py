"""How much bulk for all the slots of rounds carry at most, where nodes stand.

In each slot one node of those within two hops of each other sends, drawn by a hash
(`fanet_mw/routing/rounds/bulk_slots.py`). Relays take part in each slot, so one has a share of one in as many as there
are relays within its two hops, and has to send the packets of all; who is no relay takes part in one slot of eight,
with its own packets.
"""

from collections.abc import Mapping
from typing import NamedTuple

from fanet_mw.graph.greedy_dominating_set import greedy_dominating_set
from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.rounds.bulk_slots import SELDOM
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.units import NodeId, S


class BulkLoad(NamedTuple):
    """What one node has to send, and what its slots carry, in packets a second."""

    node: NodeId
    needed: float
    carried: float


def greatest_load(
    adjacency: Adjacency, rates: Mapping[NodeId, float], timing: RoundTiming, *, longest_bytes: int
) -> BulkLoad:
    """The node whose slots are fullest. `rates`: the packets for all that each node makes a second; `longest_bytes`: of
    a packet on the air. The swarm is taken to be connected.
    """
    links = [0] * (max(adjacency) + 1)
    for node, near in adjacency.items():
        links[node] = sum(1 << (other - 1) for other in near)
    chosen = greedy_dominating_set(links, min(adjacency))
    relays = {node for node in adjacency if chosen >> (node - 1) & 1}
    slots = timing.slots * (timing.slot_bytes // longest_bytes) * S / timing.period_ns
    total = sum(rates.values())
    loads = []
    for node, around in two_hop(adjacency).items():
        share = slots / (1 + len(relays.intersection(around)))
        if node in relays:
            loads.append(BulkLoad(node, total, share))
        else:
            loads.append(BulkLoad(node, rates.get(node, 0.0), share / SELDOM))
    return max(loads, key=lambda load: (load.needed / load.carried, -load.node))
