"""AODV's routing table (RFC 3561, 2 and 6.2): next hop, distance, freshness and lifetime of each destination.

    active --expired or broken--> inactive (keeps its sequence number) --DELETE_PERIOD--> deleted

Entries expire when they are looked at; nothing here has a timer.
"""

from dataclasses import dataclass, field

from fanet_mw.routing.aodv.parameters import DELETE_PERIOD_NS
from fanet_mw.serial_number import following, later, newer
from fanet_mw.units import NodeId


@dataclass(slots=True)
class AodvRoute:
    """One entry of the table. `seq` has no meaning while `seq_valid` is false."""

    destination: NodeId
    next_hop: NodeId
    hops: int
    ends_ns: int
    """The instant at which an active entry expires, or an inactive one is deleted."""
    seq: int = 0
    seq_valid: bool = False
    active: bool = True
    precursors: dict[NodeId, None] = field(default_factory=dict)
    """The neighbors that may be using this route over this node, in the order in which they came."""


class AodvTable:
    """All routes of one node."""

    def __init__(self) -> None:
        self._routes: dict[NodeId, AodvRoute] = {}

    def entry(self, destination: NodeId, *, now_ns: int) -> AodvRoute | None:
        """The entry of a destination, active or not; expiry is applied first."""
        route = self._routes.get(destination)
        if route is None:
            return None
        if route.active and route.ends_ns <= now_ns:
            route.active = False
            route.ends_ns += DELETE_PERIOD_NS
        if not route.active and route.ends_ns <= now_ns:
            del self._routes[destination]
            return None
        return route

    def active(self, destination: NodeId, *, now_ns: int) -> AodvRoute | None:
        route = self.entry(destination, now_ns=now_ns)
        return route if route is not None and route.active else None

    def learn_neighbor(self, neighbor: NodeId, *, ends_ns: int, now_ns: int, seq: int | None = None) -> AodvRoute:
        """Note a packet that came directly from this node (6.2); a hello also brings its sequence number (6.9)."""
        route = self.entry(neighbor, now_ns=now_ns)
        if route is None:
            route = self._routes[neighbor] = AodvRoute(neighbor, neighbor, 1, ends_ns)
        else:
            self._point(route, next_hop=neighbor, hops=1, ends_ns=ends_ns)
        if seq is not None:
            route.seq, route.seq_valid = seq, True
        return route

    def offer(self, destination: NodeId, *, seq: int, hops: int, next_hop: NodeId, ends_ns: int, now_ns: int) -> bool:
        """Consider a route with a known sequence number; returns True if it was taken (6.2, 6.7)."""
        route = self.entry(destination, now_ns=now_ns)
        if route is None:
            self._routes[destination] = AodvRoute(destination, next_hop, hops, ends_ns, seq, seq_valid=True)
            return True
        if route.seq_valid:
            if newer(route.seq, seq):
                return False
            if route.seq == seq and route.active and hops >= route.hops:
                if route.next_hop == next_hop and route.hops == hops:
                    self.extend(route, ends_ns=ends_ns)
                return False
        self._point(route, next_hop=next_hop, hops=hops, ends_ns=ends_ns)
        route.seq, route.seq_valid = seq, True
        return True

    def _point(self, route: AodvRoute, *, next_hop: NodeId, hops: int, ends_ns: int) -> None:
        if not route.active:  # its former precursors were told, or have given the route up too
            route.precursors = {}
            route.ends_ns = ends_ns
        route.next_hop, route.hops, route.active = next_hop, hops, True
        self.extend(route, ends_ns=ends_ns)

    def extend(self, route: AodvRoute | None, *, ends_ns: int) -> None:
        """Keep an active route that is used (6.2)."""
        if route is not None and route.active and ends_ns > route.ends_ns:
            route.ends_ns = ends_ns

    def over(self, next_hop: NodeId, *, now_ns: int) -> list[AodvRoute]:
        """The active routes that use a neighbor, by destination."""
        found = [self.active(destination, now_ns=now_ns) for destination in sorted(self._routes)]
        return [route for route in found if route is not None and route.next_hop == next_hop]

    def invalidate(self, route: AodvRoute, *, now_ns: int, seq: int | None = None) -> None:
        """Deactivate a broken route: its sequence number grows, or is the number that a RERR names (6.11)."""
        if seq is not None:
            route.seq, route.seq_valid = seq if not route.seq_valid else later(seq, route.seq), True
        elif route.seq_valid:
            route.seq = following(route.seq)
        route.active = False
        route.ends_ns = now_ns + DELETE_PERIOD_NS
