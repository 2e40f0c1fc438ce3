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
from fanet_mw.wire.hello.claims import Claims, HeardNeighbor, SlotStatus


class _HeardClaims(NamedTuple):
    heard_ns: int
    claims: Claims


class Neighborhood:
    """What one node knows of the nodes within two hops."""

    def __init__(
        self, node: NodeId, *, lifetime_ns: int, rank: Callable[[NodeId, SlotStatus], float] = lambda _, __: 0.0
    ) -> None:
        """`rank` gives the rank of a node; nodes of greater rank are preferred as relays."""
        self._node = node
        self._lifetime_ns = lifetime_ns
        self._rank = rank
        self._entries: dict[NodeId, _HeardClaims] = {}
        self._relays: tuple[NodeId, ...] = ()
        self._belongs: bool | None = None
        """True if this node belongs to the dominating set; None if that must be computed anew."""

    def on_claims(self, claims: Claims, *, now_ns: int) -> bool:
        """A neighbor's hello was received with these claims; returns True if they contain something new."""
        if claims.node == self._node:
            return False
        known = self._entries.get(claims.node)
        self._entries[claims.node] = _HeardClaims(now_ns, claims)
        if known is None or _matters(known.claims) != _matters(claims):
            self._belongs = None
        return known is None or known.claims != claims

    def alive(self, *, now_ns: int) -> list[Claims]:
        """The last claims of each neighbor whose hellos have not stopped, in the order of ids."""
        horizon_ns = now_ns - self._lifetime_ns
        if any(entry.heard_ns < horizon_ns for entry in self._entries.values()):
            self._entries = {n: entry for n, entry in self._entries.items() if entry.heard_ns >= horizon_ns}
            self._belongs = None
        return [self._entries[node].claims for node in sorted(self._entries)]

    def adjacency(self, *, now_ns: int) -> dict[NodeId, tuple[NodeId, ...]]:
        """The links that work both ways, of this node and of its neighbors."""
        both = [claims for claims in self.alive(now_ns=now_ns) if any(h.node == self._node for h in claims.heard)]
        found = {self._node: tuple(claims.node for claims in both)}
        for claims in both:
            others = {h.node for h in claims.heard if h.hears_us and h.node != self._node}
            found[claims.node] = tuple(sorted(others | {self._node}))
        return found

    def dominates(self, *, own_rank: float, now_ns: int) -> bool:
        """True if this node belongs to the relays of all floods."""
        alive = self.alive(now_ns=now_ns)
        if self._belongs is None:
            rank = {h.node: self._rank(h.node, h.status) for claims in alive for h in claims.heard}
            rank.update((claims.node, self._rank(claims.node, claims.own)) for claims in alive)
            rank[self._node] = own_rank
            self._belongs = dominates(self._node, self.adjacency(now_ns=now_ns), priority=rank)
        return self._belongs

    def forget_rank(self) -> None:
        """Ranks have changed, so whether this node relays must be computed anew."""
        self._belongs = None

    def slot_statuses(self, *, now_ns: int) -> list[tuple[NodeId, SlotStatus]]:
        """The slot status of every node within two hops: its own statement, or the statements of all neighbors that
        hear it.
        """
        alive = self.alive(now_ns=now_ns)
        known = frozenset(claims.node for claims in alive) | {self._node}
        others = [(h.node, h.status) for claims in alive for h in claims.heard if h.node not in known]
        return [(claims.node, claims.own) for claims in alive] + others

    def chosen_by(self, neighbor: NodeId) -> bool:
        """True if that neighbor has named this node as one of its multipoint relays in its last hello."""
        entry = self._entries.get(neighbor)
        return entry is not None and any(h.relay for h in entry.claims.heard if h.node == self._node)

    def choose_relays(self, *, now_ns: int) -> None:
        """Choose this node's multipoint relays, which its next hello names."""
        self._relays = multipoint_relays(self._node, self.adjacency(now_ns=now_ns))

    def heard(self, *, now_ns: int) -> tuple[HeardNeighbor, ...]:
        """What this node's next hello states about its neighbors."""
        return tuple(
            HeardNeighbor(
                claims.node,
                claims.own,
                any(h.node == self._node for h in claims.heard),
                claims.node in self._relays,
            )
            for claims in self.alive(now_ns=now_ns)
        )


def _matters(claims: Claims) -> tuple[object, ...]:
    """Those parts of a neighbor's claims on which it depends whether this node relays."""
    return claims.own.slot is None, tuple((h.node, h.hears_us, h.status.slot is None) for h in claims.heard)
