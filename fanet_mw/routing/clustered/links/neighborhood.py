"""Two-hop knowledge from hellos: the nodes within two hops, their links, and whether this node must relay.

A link counts if both its ends state it. The knowledge is as old as the hellos: when nodes move, for some hello
intervals each of two nodes may believe that the other one relays. Packets that are lost so are repaired
(`clusters.repair_s`).
"""

from collections.abc import Callable
from typing import NamedTuple

from fanet_mw.graph.connected_dominating_set import dominates
from fanet_mw.graph.multipoint_relays import multipoint_relays
from fanet_mw.units import NodeId
from fanet_mw.wire.hello.neighbors import HeardNeighbor, NeighborList


class _Said(NamedTuple):
    heard_ns: int
    near: NeighborList


class Neighborhood:
    """What one node knows of the nodes within two hops."""

    def __init__(self, node: NodeId, *, lifetime_ns: int, rank: Callable[[NodeId], float] = lambda _: 0.0) -> None:
        """`rank` gives the rank of a node; nodes of greater rank are preferred as relays."""
        self._node = node
        self._lifetime_ns = lifetime_ns
        self._rank = rank
        self._entries: dict[NodeId, _Said] = {}
        self._relays: tuple[NodeId, ...] = ()
        self._belongs: bool | None = None
        """True if this node belongs to the dominating set; None if that must be computed anew."""

    def on_neighbor_list(self, near: NeighborList, *, now_ns: int) -> None:
        """A neighbor's hello was received, which names those that it hears."""
        if near.node == self._node:
            return
        known = self._entries.get(near.node)
        self._entries[near.node] = _Said(now_ns, near)
        if known is None or known.near.links != near.links:
            self._belongs = None

    def alive(self, *, now_ns: int) -> list[NeighborList]:
        """The last list of each neighbor whose hellos have not stopped, in the order of ids."""
        horizon_ns = now_ns - self._lifetime_ns
        if any(entry.heard_ns < horizon_ns for entry in self._entries.values()):
            self._entries = {n: entry for n, entry in self._entries.items() if entry.heard_ns >= horizon_ns}
            self._belongs = None
        return [self._entries[node].near for node in sorted(self._entries)]

    def adjacency(self, *, now_ns: int) -> dict[NodeId, tuple[NodeId, ...]]:
        """The links that work both ways, of this node and of its neighbors."""
        both = [near for near in self.alive(now_ns=now_ns) if any(h.node == self._node for h in near.heard)]
        found = {self._node: tuple(near.node for near in both)}
        for near in both:
            others = {h.node for h in near.heard if h.hears_us and h.node != self._node}
            found[near.node] = tuple(sorted(others | {self._node}))
        return found

    def dominates(self, *, now_ns: int) -> bool:
        """True if this node belongs to the relays of all floods."""
        alive = self.alive(now_ns=now_ns)
        if self._belongs is None:
            rank = {node: self._rank(node) for near in alive for node in (near.node, *(h.node for h in near.heard))}
            rank[self._node] = 0.0
            self._belongs = dominates(self._node, self.adjacency(now_ns=now_ns), priority=rank)
        return self._belongs

    def forget_rank(self) -> None:
        """Ranks have changed, so whether this node relays must be computed anew."""
        self._belongs = None

    def chosen_by(self, neighbor: NodeId) -> bool:
        """True if that neighbor has named this node as one of its multipoint relays in its last hello."""
        entry = self._entries.get(neighbor)
        return entry is not None and any(h.relay for h in entry.near.heard if h.node == self._node)

    def choose_relays(self, *, now_ns: int) -> None:
        """Choose this node's multipoint relays, which its next hello names."""
        self._relays = multipoint_relays(self._node, self.adjacency(now_ns=now_ns))

    def heard(self, *, now_ns: int) -> tuple[HeardNeighbor, ...]:
        """What this node's next hello states about its neighbors."""
        return tuple(
            HeardNeighbor(near.node, any(h.node == self._node for h in near.heard), near.node in self._relays)
            for near in self.alive(now_ns=now_ns)
        )
