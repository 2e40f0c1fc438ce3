"""Route discovery of AODV: the destinations searched for, how far each search goes, when it is repeated (6.3, 6.4).

Section numbers are of RFC 3561. A search has TTL 1, 3, 5, 7, then NET_DIAMETER, RREQ_RETRIES times with doubled
waiting; then it has failed. For a destination that had a route the first TTL is that route's hop count + TTL_INCREMENT.
"""

from collections import deque
from dataclasses import dataclass

from fanet_mw.routing.aodv.parameters import (
    NET_DIAMETER,
    NET_TRAVERSAL_TIME_NS,
    NODE_TRAVERSAL_TIME_NS,
    PATH_DISCOVERY_TIME_NS,
    RREQ_RETRIES,
    TIMEOUT_BUFFER,
    TTL_INCREMENT,
    TTL_START,
    TTL_THRESHOLD,
)
from fanet_mw.units import NodeId, S


class RateLimit:
    """A limit of the number of events in any second."""

    def __init__(self, most: int) -> None:
        self._recent_ns: deque[int] = deque(maxlen=most)

    def free_ns(self, now_ns: int) -> int:
        """The earliest instant at which the next event is allowed."""
        full = len(self._recent_ns) == self._recent_ns.maxlen
        return max(now_ns, self._recent_ns[0] + S) if full else now_ns

    def count(self, now_ns: int) -> None:
        self._recent_ns.append(now_ns)


class SeenRequests:
    """The (originator, RREQ id) of the requests that came within the last PATH_DISCOVERY_TIME (6.5)."""

    def __init__(self) -> None:
        self._ends_ns: dict[tuple[int, int], int] = {}

    def is_new(self, originator: int, rreq_id: int, *, now_ns: int) -> bool:
        """True if this request has not been handled yet; from now on it has."""
        ends_ns = self._ends_ns
        while ends_ns and ends_ns[oldest := next(iter(ends_ns))] <= now_ns:
            del ends_ns[oldest]
        name = originator, rreq_id
        if name in ends_ns:
            return False
        ends_ns[name] = now_ns + PATH_DISCOVERY_TIME_NS
        return True


@dataclass(slots=True)
class RouteSearch:
    """The search for one destination."""

    destination: NodeId
    ttl: int
    due_ns: int
    """The instant at which the next RREQ is sent, or the search has failed."""
    full: int = 0
    """The number of RREQs already sent with TTL = NET_DIAMETER."""
    asked: bool = False
    """True when a RREQ with the present TTL has been sent; false while the rate limit holds it back."""

    def sent(self, now_ns: int) -> None:
        """A RREQ was sent with the present TTL: wait for its ring (6.4), or at full width doubled each time (6.3)."""
        self.asked = True
        if self.ttl < NET_DIAMETER:
            self.due_ns = now_ns + 2 * NODE_TRAVERSAL_TIME_NS * (self.ttl + TIMEOUT_BUFFER)
        else:
            self.due_ns = now_ns + (NET_TRAVERSAL_TIME_NS << self.full)
            self.full += 1

    def widen(self) -> None:
        self.asked = False
        self.ttl = self.ttl + TTL_INCREMENT if self.ttl + TTL_INCREMENT <= TTL_THRESHOLD else NET_DIAMETER

    @property
    def exhausted(self) -> bool:
        return self.full >= RREQ_RETRIES


class Discovery:
    """All searches of one node."""

    def __init__(self) -> None:
        self._searches: dict[NodeId, RouteSearch] = {}

    def __contains__(self, destination: NodeId) -> bool:
        return destination in self._searches

    def begin(self, destination: NodeId, *, last_hops: int | None, now_ns: int) -> RouteSearch:
        """Start a search; `last_hops` is the hop count of a former route."""
        ttl = TTL_START if last_hops is None else last_hops + TTL_INCREMENT
        search = RouteSearch(destination, ttl if ttl <= TTL_THRESHOLD else NET_DIAMETER, now_ns)
        self._searches[destination] = search
        return search

    def end(self, destination: NodeId) -> None:
        self._searches.pop(destination, None)

    def due(self, now_ns: int) -> list[RouteSearch]:
        """The searches whose waiting is over, by destination."""
        return [self._searches[node] for node in sorted(self._searches) if self._searches[node].due_ns <= now_ns]

    def wanted(self) -> list[NodeId]:
        return sorted(self._searches)

    def next_ns(self) -> int | None:
        return min((search.due_ns for search in self._searches.values()), default=None)
