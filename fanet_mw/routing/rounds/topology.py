"""Who hears whom in the whole swarm: each node states its neighbors, and all pass that on in turns.

A statement bears the number of its epoch, a short interval of swarm time, so a newer one is known whoever passes it on
and whenever a node was started. A node states at the beginning of an epoch whether its neighbors have changed, and once
per second in any case. A link counts if both its ends state it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.graph.connected_dominating_set import dominates
from fanet_mw.graph.topology import Adjacency
from fanet_mw.units import NodeId, S
from fanet_mw.wire.rounds import HeardNodes

_MODULUS: Final = 256


def _nodes(heard: int) -> Iterator[NodeId]:
    """The nodes of a set of bits, in order."""
    while heard:
        last = heard & -heard
        yield NodeId(last.bit_length())
        heard ^= last


class _Stated(NamedTuple):
    epoch: int
    heard: int


class Topology:
    """The links of the swarm, as one node knows them."""

    def __init__(self, node: NodeId, *, count: int, epoch_ns: int, lifetime_ns: int) -> None:
        """`lifetime_ns`: how long a statement counts."""
        self._node = node
        self._count = count
        self._epoch_ns = epoch_ns
        self._lifetime = min(_MODULUS // 2, -(-lifetime_ns // epoch_ns))
        self._refresh = max(1, S // epoch_ns)
        self._stated: dict[NodeId, _Stated] = {}
        self._news: dict[NodeId, None] = {}
        """The nodes of which something is to be passed on, in the order in which it was heard."""
        self._own_epoch = -1
        self._links: Adjacency = {}
        self._hops: Mapping[NodeId, int] = {node: 0}
        self._dominates: bool | None = None
        """Whether this node is in the dominating set; None if that must be computed anew."""
        self._unreached_ns: dict[NodeId, int] = {}
        """The instant since which each node without a way is known to have none."""
        self._arranged_for = -1
        """The epoch for which links and hops were computed; -1: they must be computed anew."""

    # --- what is stated -------------------------------------------------------------------------------------------

    def next_epoch_ns(self) -> int:
        """The instant at which the next epoch begins."""
        return (self._own_epoch + 1) * self._epoch_ns

    def state(self, neighbors: Iterable[NodeId], *, now_ns: int) -> None:
        """An epoch has begun in which this node has these neighbors."""
        self._own_epoch = now_ns // self._epoch_ns
        heard = 0
        for neighbor in neighbors:
            heard |= 1 << (neighbor - 1)
        known = self._stated.get(self._node)
        if known is None or known.heard != heard or self._own_epoch - known.epoch >= self._refresh:
            self._note(self._node, self._own_epoch, heard)

    def hear(self, told: Sequence[HeardNodes], *, now_ns: int) -> None:
        """A neighbor passes on what nodes have stated."""
        current = now_ns // self._epoch_ns
        for node, short, heard in told:
            behind = (current + 1 - short) % _MODULUS - 1  # one epoch ahead is possible, because clocks differ
            if node == self._node or node > self._count or behind > self._lifetime or heard >> self._count:
                continue
            known = self._stated.get(NodeId(node))
            if known is None or current - behind > known.epoch:
                self._note(NodeId(node), current - behind, heard)

    def _note(self, node: NodeId, epoch: int, heard: int) -> None:
        known = self._stated.get(node)
        if known is None or known.heard != heard:
            self._arranged_for = -1
        self._stated[node] = _Stated(epoch, heard)
        self._news[node] = None

    @property
    def has_news(self) -> bool:
        return bool(self._news)

    def take_news(self, most: int) -> list[HeardNodes]:
        """What is to be passed on next, at most so many entries."""
        nodes = list(self._news)[:most]
        for node in nodes:
            del self._news[node]
        stated = ((node, self._stated[node]) for node in nodes)
        return [HeardNodes(node, one.epoch % _MODULUS, one.heard) for node, one in stated]

    # --- what follows from it -------------------------------------------------------------------------------------

    def _arrange(self, now_ns: int) -> None:
        """Compute the links and the hops anew if something has changed, or nodes are gone."""
        epoch = now_ns // self._epoch_ns
        if self._arranged_for == epoch:
            return
        self._arranged_for, self._dominates = epoch, None
        alive = {n: one.heard for n, one in sorted(self._stated.items()) if one.epoch >= epoch - self._lifetime}
        self._links = {
            n: tuple(m for m in _nodes(heard) if alive.get(m, 0) >> (n - 1) & 1) for n, heard in alive.items()
        }
        hops, ring = {self._node: 0}, [self._node]
        while ring:
            near = {m: hops[n] + 1 for n in ring for m in self._links.get(n, ()) if m not in hops}
            hops.update(near)
            ring = list(near)
        self._hops = hops
        since = self._unreached_ns
        self._unreached_ns = {
            NodeId(n): since.get(NodeId(n), now_ns) for n in range(1, self._count + 1) if n not in hops
        }

    def hops(self, now_ns: int) -> Mapping[NodeId, int]:
        """The hops to each node to which a way is known, this node included."""
        self._arrange(now_ns)
        return self._hops

    def neighbors_of(self, node: int, now_ns: int) -> Sequence[NodeId]:
        """The nodes with which a node has links."""
        self._arrange(now_ns)
        return self._links.get(NodeId(node), ())

    def dominates(self, now_ns: int) -> bool:
        """True if this node is one of the connected dominating set whose transmissions reach all nodes."""
        self._arrange(now_ns)
        if self._dominates is None:
            self._dominates = self._node not in self._links or dominates(self._node, self._links)
        return self._dominates

    def absent(self, now_ns: int, *, doubt_ns: int) -> Sequence[NodeId] | None:
        """The nodes to which there has been no way for longer than `doubt_ns`; None while there is a node to which
        there is none for less.
        """
        self._arrange(now_ns)
        if any(since_ns > now_ns - doubt_ns for since_ns in self._unreached_ns.values()):
            return None
        return tuple(self._unreached_ns)
