r"""When each relay of one flood sends, in equal sub-slots, so that no two copies collide at any node.

    sub-slot      0      1      2      3          the root sends in 0; each relay after one it hears
    root  ------> A ---> C ---> E                 C and D have no common neighbor: they share a sub-slot
           \----> B ---> D

Two relays share a sub-slot only if they are more than two hops apart: then no node receives both, and neither of them
senses the other and defers. In the order of levels (breadth first from the root over the relays) each gets the earliest
sub-slot that is free. With `prune`, relays that would reach no new node stay silent. The schedule does not repeat: a
lost copy is lost to all nodes behind it unless another relay reaches them.
"""

from collections.abc import Collection
from typing import NamedTuple

from fanet_mw.errors import LocalProtocolError
from fanet_mw.graph.topology import Adjacency, levels, two_hop
from fanet_mw.units import NodeId


class Turn(NamedTuple):
    """One relay sends in one sub-slot; it has the packet from `source` (itself, for the root)."""

    subslot: int
    node: NodeId
    source: NodeId


class BroadcastSchedule(NamedTuple):
    """The turns by sub-slot, and how many sub-slots the flood takes."""

    turns: tuple[Turn, ...]
    subslots: int


def shortest_relays(adjacency: Adjacency, root: NodeId) -> tuple[NodeId, ...]:
    """Relays for which every node is as many hops from the root as it can be: a greedy cover of each level by the last.

    More relays than a connected dominating set, but the fewest hops; with `broadcast_schedule` often fewer sub-slots.
    """
    hops = levels(adjacency, root)
    relays: list[NodeId] = []
    for level in range(1, max(hops.values())):
        missing = {n for n, h in hops.items() if h == level + 1}
        candidates = sorted(n for n, h in hops.items() if h == level)
        while missing:
            best = max(candidates, key=lambda n: (sum(1 for m in adjacency[n] if m in missing), -n))
            relays.append(best)
            missing.difference_update(adjacency[best])
    return tuple(sorted(relays))


def broadcast_schedule(
    adjacency: Adjacency, root: NodeId, relays: Collection[NodeId], *, prune: bool = True, hop_subslots: int = 1
) -> BroadcastSchedule:
    """The schedule of a flood from `root` through `relays`, for all that root and relays reach.

    A relay sends `hop_subslots` after its source at the earliest: what it needs to receive and announce.
    Raises LocalProtocolError when the root is no node. Relays that the flood does not reach get no turn.
    """
    if hop_subslots < 1:
        raise LocalProtocolError(f"hop_subslots = {hop_subslots} must be >= 1")
    if root not in adjacency:
        raise LocalProtocolError(f"root = {root} must be a node of the adjacency")
    sending = frozenset(relays) | {root}
    tree = {n: tuple(m for m in adjacency[n] if m in sending) for n in adjacency if n in sending}
    hops = levels(tree, root)
    rivals = {node: frozenset(near) for node, near in two_hop(adjacency).items()}
    turns = {root: Turn(0, root, root)}
    users: dict[int, list[NodeId]] = {0: [root]}
    reached = {root, *adjacency[root]}
    for node in _order(hops, adjacency, reached, prune=prune):
        source = min((turns[n] for n in tree[node] if n in turns), key=lambda turn: (turn.subslot, turn.node))
        subslot = source.subslot + hop_subslots
        while any(user in rivals[node] for user in users.get(subslot, ())):
            subslot += 1
        turns[node] = Turn(subslot, node, source.node)
        users.setdefault(subslot, []).append(node)
    return BroadcastSchedule(tuple(sorted(turns.values())), max(users) + 1)


def pipeline_spacing(schedule: BroadcastSchedule, adjacency: Adjacency) -> int:
    """How many sub-slots apart floods of one schedule can follow each other without meeting; at least 1.

    With floods every d sub-slots, all turns of one residue modulo d are on the air together; none of them may be within
    two hops of another.
    """
    rivals = {node: frozenset(near) for node, near in two_hop(adjacency).items()}
    for spacing in range(1, schedule.subslots):
        users: dict[int, list[NodeId]] = {}
        for turn in schedule.turns:
            users.setdefault(turn.subslot % spacing, []).append(turn.node)
        if not any(b in rivals[a] for group in users.values() for i, a in enumerate(group) for b in group[i + 1 :]):
            return spacing
    return schedule.subslots


def _order(hops: dict[NodeId, int], adjacency: Adjacency, reached: set[NodeId], *, prune: bool) -> list[NodeId]:
    """The relays level by level, those that reach most new nodes first; with `prune` without those that reach none.

    A node enters `reached` only by a relay that sends, so each relay in the order has a sender before it, even where
    pruned relays are silent.
    """
    order: list[NodeId] = []
    for level in range(1, max(hops.values()) + 1):
        waiting = sorted(n for n, h in hops.items() if h == level)
        while waiting:
            best = max(waiting, key=lambda n: (sum(1 for m in adjacency[n] if m not in reached), -n))
            waiting.remove(best)
            if prune and all(m in reached for m in adjacency[best]):
                continue
            order.append(best)
            reached.update(adjacency[best])
    return order
