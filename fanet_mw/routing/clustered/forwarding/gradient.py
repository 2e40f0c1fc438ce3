"""The way to a head: hop counts grow from each head outwards, carried by hellos, kept fresh by the head's sequence.

As in DSDV, a route carries the head's own sequence number: newer prevails over shorter, and of equally new routes the
shorter prevails, so an old route is never chosen through a node that depends on it. A node without a head (the leader),
or without a way to its own head, joins a neighbor's way to another head, so that the packet reaches some head at least.
"""

from typing import Final, NamedTuple

from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.units import NodeId

UNREACHABLE: Final = 255
NO_HEAD: Final = NodeId(0)
_STALE: Final = 4
"""The number of hello intervals without a new sequence number of the head after which a route is given up."""
_FORGET: Final = 4
"""After this many times as long no node states a dead head any more: a head stated then has restarted, from 0."""


class RouteToHead(NamedTuple):
    """The next hop towards a head; at the head itself the next hop is the head and hops is 0."""

    head: NodeId
    head_seq: int
    hops: int
    parent: NodeId
    fresh_ns: int
    """The instant at which the head's sequence number last advanced."""


def newer(a: int, b: int) -> bool:
    """True if 16-bit sequence `a` comes after `b` (RFC 1982 serial numbers)."""
    return 0 < ((a - b) & 0xFFFF) < 0x8000


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
        """The newest sequence number of each head, and since when; a node that states a dead head brings no news."""

    def join(self, head: NodeId, *, now_ns: int) -> None:
        """Follow the head that the schedule gives, perhaps this node itself; a route to another is second best now."""
        if head == self._own_head:
            return
        self._own_head = head
        self._route = RouteToHead(head, self._seq, 0, self._node, now_ns) if head == self._node else None

    def advance(self, now_ns: int) -> None:
        """Advance the head's own sequence number, once per hello."""
        if self._own_head == self._node:
            self._seq = (self._seq + 1) & 0xFFFF
            self._route = RouteToHead(self._node, self._seq, 0, self._node, now_ns)

    def on_hello(self, neighbor: Neighbor, *, now_ns: int) -> None:
        """Take in a neighbor's hello, which may bring a better route."""
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
        """The instant since which a head's sequence is known to be at least this; the same news by another way is not
        fresher.
        """
        known = self._news.get(head)
        forgotten = known is None or known[1] + _FORGET * self._stale_ns < now_ns
        if known is None or forgotten or newer(seq, known[0]):
            self._news[head] = seq, now_ns
            return now_ns
        return known[1]

    def _better(self, offered: RouteToHead, route: RouteToHead) -> bool:
        if offered.head != route.head:
            return offered.head == self._own_head
        if newer(offered.head_seq, route.head_seq):
            # The parent may only be late to state it: one step newer by a longer way is no reason to switch.
            one_step = (offered.head_seq - route.head_seq) & 0xFFFF == 1
            return offered.parent == route.parent or offered.hops <= route.hops or not one_step
        return offered.head_seq == route.head_seq and offered.hops < route.hops

    def news_ns(self, head: NodeId) -> int | None:
        """The instant at which this head's sequence last advanced in received hellos; None when it never did."""
        known = self._news.get(head)
        return None if known is None else known[1]

    def on_flood_of_head(self, head: NodeId, *, parent: NodeId, hops: int, now_ns: int) -> None:
        """Take a flood from the head as a route back, until hellos bring a route."""
        route = self.route(now_ns=now_ns)
        if hops >= UNREACHABLE - 1:
            return  # the head is farther than a hello can state
        if head == self._own_head != self._node and (route is None or route.head != head):
            self._route = RouteToHead(head, 0, hops, parent, now_ns)

    def lose(self, neighbor: NodeId) -> None:
        """Drop a neighbor to which the link has failed."""
        self._neighbors.forget(neighbor)
        if self._route is not None and self._route.parent == neighbor:
            self._route = None

    def route(self, *, now_ns: int) -> RouteToHead | None:
        """The current route; None when there is none or its news is stale."""
        route = self._route
        if route is not None and route.parent != self._node and route.fresh_ns + self._stale_ns < now_ns:
            self._route = route = None
        return route
