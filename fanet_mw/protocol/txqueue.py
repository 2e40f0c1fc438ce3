"""The bounded priority queue of a node. Nothing leaves it without being transmitted or named in a drop.

Order: priority first (0 is the most urgent), then arrival. When full, the least important and youngest entry goes.
"""

from bisect import insort
from typing import NamedTuple

from fanet_mw.units import NodeId
from fanet_mw.wire import Header


class Packet(NamedTuple):
    """A routed packet as a node holds it: its header, decoded, and its bytes."""

    header: Header
    frame: bytes

    @property
    def origin(self) -> NodeId:
        return NodeId(self.header.origin)


class TxQueue:
    """Packets waiting for a slot or a route."""

    def __init__(self, *, capacity: int) -> None:
        self._capacity = capacity
        self._entries: list[tuple[int, int, Packet]] = []
        self._order = 0

    def __len__(self) -> int:
        return len(self._entries)

    def push(self, packet: Packet) -> Packet | None:
        """Add a packet; return the one that had to go for it (perhaps itself), or None."""
        self._order += 1
        insort(self._entries, (packet.header.priority, self._order, packet))
        return self._entries.pop()[2] if len(self._entries) > self._capacity else None

    def pop(self) -> Packet:
        """Take the most urgent packet."""
        assert self._entries, "whoever pops has looked at the length"
        return self._entries.pop(0)[2]

    def expire(self, *, before_us: int) -> list[Packet]:
        """Take out every packet generated before an instant [swarm us]."""
        stale = [entry[2] for entry in self._entries if entry[2].header.origin_us < before_us]
        if stale:
            self._entries = [entry for entry in self._entries if entry[2].header.origin_us >= before_us]
        return stale

    def drain(self) -> list[Packet]:
        """Take everything, most urgent first."""
        entries, self._entries = self._entries, []
        return [entry[2] for entry in entries]
