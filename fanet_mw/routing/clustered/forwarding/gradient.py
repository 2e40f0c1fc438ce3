"""Routes to cluster heads: hellos carry hop counts that grow from each head outwards (a gradient).

As in DSDV, a route carries a sequence number of its head. A newer number prevails over a shorter route, and of routes
with the same number the shorter prevails, so that no loop forms. A node without a head (the leader), or without a route
to its own head, takes a neighbor's route to another head, so that its packets reach some head.
"""

from typing import Final, NamedTuple

from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.serial_number import following, newer
from fanet_mw.units import NodeId

UNREACHABLE: Final = 255
NO_HEAD: Final = NodeId(0)
_SEQ_BITS: Final = 16
_STALE: Final = 4
"""A route is given up after this number of hello intervals without a new sequence number of its head."""
_FORGET: Final = 4
"""After this many times that duration, no node states a dead head any more. A head that is stated then has restarted,
and its sequence number begins at 0."""


class RouteToHead(NamedTuple):
    """The next hop towards a head; at the head itself the next hop is the head and hops is 0."""

    head: NodeId
    head_seq: int
    hops: int
    parent: NodeId
    fresh_ns: int
    """The instant at which the sequence number of the head last advanced."""


class Gradient:
    """The route of one node to a head."""

    def __init__(self, *, node: NodeId, neighbors: Neighbors, hello_ns: int) -> None:
        self._node = node
        self._neighbors = neighbors
        self._stale_ns = _STALE * hello_ns
        self._own_head = NO_HEAD
        self._seq = 0
        self._route: RouteToHead | None = None
        self._news: dict[int, tuple[int, int]] = {}
        """The newest sequence number of each head, and the instant since which it is known. A neighbor that goes on to
        state a dead head changes nothing here."""

    def join(self, head: NodeId, *, now_ns: int) -> None:
        """Follow the head that the schedule gives, perhaps this node; a route to another is only second best."""
        if head == self._own_head:
            return
        self._own_head = head
        self._route = RouteToHead(head, self._seq, 0, self._node, now_ns) if head == self._node else None

    def advance(self, now_ns: int) -> None:
        if self._own_head == self._node:
            self._seq = following(self._seq, bits=_SEQ_BITS)
            self._route = RouteToHead(self._node, self._seq, 0, self._node, now_ns)

    def on_hello(self, neighbor: Neighbor, *, now_ns: int) -> None:
        beacon = neighbor.beacon
        if self._own_head == self._node:
            return  # this node is a head itself
        route = self.route(now_ns=now_ns)
        if beacon.hops_to_head >= UNREACHABLE - 1 or beacon.head == NO_HEAD:
            if route is not None and route.parent == neighbor.node:
                self._route = None
            return
        fresh_ns = self._heard(beacon.head, beacon.head_seq, now_ns)
        if fresh_ns + self._stale_ns < now_ns:
            return
        offered = RouteToHead(NodeId(beacon.head), beacon.head_seq, beacon.hops_to_head + 1, neighbor.node, fresh_ns)
        if route is None or self._better(offered, route):
            self._route = offered

    def _heard(self, head: int, seq: int, now_ns: int) -> int:
        """A head's sequence number is `seq` at least, not fresher if it comes again; returns since when it is known."""
        known = self._news.get(head)
        forgotten = known is None or known[1] + _FORGET * self._stale_ns < now_ns
        if known is None or forgotten or newer(seq, known[0], bits=_SEQ_BITS):
            self._news[head] = seq, now_ns
            return now_ns
        return known[1]

    def _better(self, offered: RouteToHead, route: RouteToHead) -> bool:
        if offered.head != route.head:
            return offered.head == self._own_head
        if newer(offered.head_seq, route.head_seq, bits=_SEQ_BITS):
            # The parent may only be late to state the new number: that is no reason to switch to a longer route.
            one_step = offered.head_seq == following(route.head_seq, bits=_SEQ_BITS)
            return offered.parent == route.parent or offered.hops <= route.hops or not one_step
        return offered.head_seq == route.head_seq and offered.hops < route.hops

    def news_ns(self, head: NodeId) -> int | None:
        """The instant at which this head's sequence number last advanced in received hellos; None if it never did."""
        known = self._news.get(head)
        return None if known is None else known[1]

    def on_flood_of_head(self, head: NodeId, *, parent: NodeId, hops: int, now_ns: int) -> None:
        """Take the reverse way of a head's flood as a route to that head, until hellos state one."""
        route = self.route(now_ns=now_ns)
        if hops >= UNREACHABLE - 1:
            return  # a hello cannot state so many hops
        if head == self._own_head != self._node and (route is None or route.head != head):
            self._route = RouteToHead(head, 0, hops, parent, now_ns)

    def lose(self, neighbor: NodeId) -> None:
        """Drop all routes over a neighbor, because the link to it has failed."""
        self._neighbors.forget(neighbor)
        if self._route is not None and self._route.parent == neighbor:
            self._route = None

    def route(self, *, now_ns: int) -> RouteToHead | None:
        """The current route; None if there is none, or if it is stale."""
        route = self._route
        if route is not None and route.parent != self._node and route.fresh_ns + self._stale_ns < now_ns:
            self._route = route = None
        return route
