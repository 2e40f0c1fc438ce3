"""AODV's neighbors (RFC 3561, 6.9): one that has sent a hello is lost when nothing comes from it for two intervals."""

from fanet_mw.routing.aodv.parameters import NEIGHBOR_LIFETIME_NS
from fanet_mw.units import NodeId


class HelloNeighbors:
    """The neighbors that have sent a hello, and until when each counts as present."""

    def __init__(self) -> None:
        self._ends_ns: dict[NodeId, int] = {}
        self._check_ns: int | None = None
        """No neighbor is lost before this instant: a lower bound, so that a packet from a neighbor costs nothing."""

    def on_hello(self, neighbor: NodeId, *, now_ns: int) -> None:
        self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS
        if self._check_ns is None:
            self._check_ns = now_ns + NEIGHBOR_LIFETIME_NS

    def on_packet(self, neighbor: NodeId, *, now_ns: int) -> None:
        """Prolong a neighbor that has sent a hello at some time, because a packet came from it."""
        if neighbor in self._ends_ns:
            self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS

    def forget(self, neighbor: NodeId) -> None:
        self._ends_ns.pop(neighbor, None)

    def lost(self, now_ns: int) -> list[NodeId]:
        """Remove and return the neighbors that have been silent for too long."""
        if self._check_ns is None or now_ns < self._check_ns:
            return []
        gone = [node for node in sorted(self._ends_ns) if self._ends_ns[node] <= now_ns]
        for node in gone:
            del self._ends_ns[node]
        self._check_ns = min(self._ends_ns.values(), default=None)
        return gone

    def next_ns(self) -> int | None:
        return self._check_ns
