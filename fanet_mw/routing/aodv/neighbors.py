"""Whom AODV hears (RFC 3561, 6.9): a neighbor that said hello is lost when nothing comes from it for two intervals."""

from fanet_mw.routing.aodv.parameters import NEIGHBOR_LIFETIME_NS
from fanet_mw.units import NodeId


class Hellos:
    """Neighbors that have said hello, until when each is believed in."""

    def __init__(self) -> None:
        self._ends_ns: dict[NodeId, int] = {}
        self._check_ns: int | None = None
        """No neighbor ends before this: a lower bound, so that hearing one costs nothing."""

    def hello(self, neighbor: NodeId, *, now_ns: int) -> None:
        self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS
        if self._check_ns is None:
            self._check_ns = now_ns + NEIGHBOR_LIFETIME_NS

    def heard(self, neighbor: NodeId, *, now_ns: int) -> None:
        """Any packet keeps a neighbor that has said hello before."""
        if neighbor in self._ends_ns:
            self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS

    def forget(self, neighbor: NodeId) -> None:
        self._ends_ns.pop(neighbor, None)

    def lost(self, now_ns: int) -> list[NodeId]:
        """Take out who was silent for too long."""
        if self._check_ns is None or now_ns < self._check_ns:
            return []
        gone = [node for node in sorted(self._ends_ns) if self._ends_ns[node] <= now_ns]
        for node in gone:
            del self._ends_ns[node]
        self._check_ns = min(self._ends_ns.values(), default=None)
        return gone

    def next_ns(self) -> int | None:
        return self._check_ns
