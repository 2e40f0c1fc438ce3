"""What hellos say of our two hops: who is there, who hears whom, and whether that makes us a relay.

A link counts when both ends say so. What is known is as old as the hellos: a node that moves may for some hello
intervals believe another to relay in its place, and then nobody does (`clusters.repair_s` heals it).
"""

from collections.abc import Callable
from typing import NamedTuple

from fanet_mw.graph.connected_dominating_set import dominates
from fanet_mw.graph.multipoint_relays import multipoint_relays
from fanet_mw.units import NodeId
from fanet_mw.wire.claims import Claims, HeardNeighbor, SlotStatus


class _Entry(NamedTuple):
    heard_ns: int
    claims: Claims


class Neighborhood:
    """One node's two-hop knowledge."""

    def __init__(
        self, node: NodeId, *, lifetime_ns: int, rank: Callable[[NodeId, SlotStatus], float] = lambda _, __: 0.0
    ) -> None:
        """`rank`: which neighbors are to relay rather than others."""
        self._node = node
        self._lifetime_ns = lifetime_ns
        self._rank = rank
        self._entries: dict[NodeId, _Entry] = {}
        self._relays: tuple[NodeId, ...] = ()
        self._belongs: bool | None = None
        """Whether we dominate, as long as nothing has changed."""

    def hear(self, claims: Claims, *, now_ns: int) -> bool:
        """A neighbor's hello; True when it says something new."""
        if claims.node == self._node:
            return False
        known = self._entries.get(claims.node)
        self._entries[claims.node] = _Entry(now_ns, claims)
        if known is None or _matters(known.claims) != _matters(claims):
            self._belongs = None
        return known is None or known.claims != claims

    def alive(self, *, now_ns: int) -> list[Claims]:
        """What each neighbor said last, by id, without those that have fallen silent."""
        horizon_ns = now_ns - self._lifetime_ns
        if any(entry.heard_ns < horizon_ns for entry in self._entries.values()):
            self._entries = {n: entry for n, entry in self._entries.items() if entry.heard_ns >= horizon_ns}
            self._belongs = None
        return [self._entries[node].claims for node in sorted(self._entries)]

    def adjacency(self, *, now_ns: int) -> dict[NodeId, tuple[NodeId, ...]]:
        """The links that work both ways, of ourselves and of each neighbor."""
        both = [claims for claims in self.alive(now_ns=now_ns) if any(h.node == self._node for h in claims.heard)]
        found = {self._node: tuple(claims.node for claims in both)}
        for claims in both:
            others = {h.node for h in claims.heard if h.hears_us and h.node != self._node}
            found[claims.node] = tuple(sorted(others | {self._node}))
        return found

    def dominates(self, *, own_rank: float, now_ns: int) -> bool:
        """Whether a flood needs us as a relay, whoever began it."""
        alive = self.alive(now_ns=now_ns)
        if self._belongs is None:
            rank = {h.node: self._rank(h.node, h.standing) for claims in alive for h in claims.heard}
            rank.update((claims.node, self._rank(claims.node, claims.own)) for claims in alive)
            rank[self._node] = own_rank
            self._belongs = dominates(self._node, self.adjacency(now_ns=now_ns), priority=rank)
        return self._belongs

    def forget_rank(self) -> None:
        """Ranks have changed: ask again."""
        self._belongs = None

    def standings(self, *, now_ns: int) -> list[tuple[NodeId, SlotStatus]]:
        """What is said of everyone within two hops: by itself, if it is a neighbor; by all that hear it, if not."""
        alive = self.alive(now_ns=now_ns)
        known = frozenset(claims.node for claims in alive) | {self._node}
        others = [(h.node, h.standing) for claims in alive for h in claims.heard if h.node not in known]
        return [(claims.node, claims.own) for claims in alive] + others

    def chosen_by(self, neighbor: NodeId) -> bool:
        """Whether that neighbor's last hello names us as one of its multipoint relays."""
        entry = self._entries.get(neighbor)
        return entry is not None and any(h.relay for h in entry.claims.heard if h.node == self._node)

    def choose_relays(self, *, now_ns: int) -> None:
        """Our own multipoint relays, for the hello."""
        self._relays = multipoint_relays(self._node, self.adjacency(now_ns=now_ns))

    def heard(self, *, now_ns: int) -> tuple[HeardNeighbor, ...]:
        """What our hello says of our neighbors."""
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
    """What a hello says that may make or unmake a relay of us."""
    return claims.own.slot is None, tuple((h.node, h.hears_us, h.standing.slot is None) for h in claims.heard)
