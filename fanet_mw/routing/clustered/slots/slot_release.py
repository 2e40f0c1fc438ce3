"""The transmit queue of a cluster head: packets are released only in its own slot, each announced one lead ahead.

By `clusters.pacing = "burst"` they follow each other with the least gap (`clusters.release_gap_ms`), by `"spread"` the
slot is divided evenly among those that wait when it begins, up to 40 ms apart, so that one flood has moved on before
the next. What does not fit waits for the next occurrence of the slot. A head that loses its role uses its old slot for
the rest: sending them to the new head would cost more.
"""

from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.slot_timing import Slot, Superframe
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS

_SPREAD_CAP_NS: Final = 40 * MS
"""Two floods this far apart no longer meet (some hops of lead, jitter and airtime); more would only add delay."""


class Tenure(NamedTuple):
    """The slot that a node has as head, or had when it last was head, and the superframe of that slot."""

    superframe: Superframe
    slot: int


class SlotRelease:
    """The transmit queue of one head."""

    def __init__(self, queue: TxQueue, clusters: Clusters, *, lead_ns: int) -> None:
        self._queue = queue
        self.expire = queue.expire
        """The method that drops expired packets; it is called at every wake-up."""
        self._spread = clusters.pacing == "spread"
        self._least_gap_ns = max(1, round(clusters.release_gap_ms * MS))
        self._lead_ns = lead_ns
        self._slot: Slot | None = None
        """The occurrence of the slot in which the next packet is released."""
        self._gap_ns = self._least_gap_ns
        """The time between two releases in that occurrence."""
        self._free_ns = 0
        """No packet is released before this instant, which is one gap after the last release."""
        self._next_ns: int | None = None

    def __len__(self) -> int:
        return len(self._queue)

    def push(self, packet: Packet, tenure: Tenure, *, now_ns: int) -> None:
        self._queue.push(packet, now_ns=now_ns)
        if self._next_ns is None:
            self.arm(tenure, now_ns=now_ns)

    def more(self, size: int) -> list[Packet]:
        """Take out packets that fit into the remaining `size` bytes of a frame that is released now."""
        return self._queue.pop_fitting(size)

    def drain(self) -> list[Packet]:
        """Take out all queued packets, because they will go another way."""
        self._next_ns = self._slot = None
        return self._queue.drain()

    def arm(self, tenure: Tenure, *, now_ns: int) -> None:
        if not len(self._queue):
            self._next_ns = None
            return
        earliest_ns = max(now_ns + self._lead_ns, self._free_ns)
        slot = tenure.superframe.occurrence(tenure.slot, not_before_ns=earliest_ns)
        if slot != self._slot:
            self._slot = slot
            self._gap_ns = self._gap_for(slot)
        self._next_ns = max(slot.start_ns, earliest_ns)

    def _gap_for(self, slot: Slot) -> int:
        if not self._spread:
            return self._least_gap_ns
        share_ns = (slot.end_ns - slot.start_ns) // max(1, len(self._queue))
        return max(self._least_gap_ns, min(share_ns, _SPREAD_CAP_NS))

    def next_wake_ns(self) -> int | None:
        return None if self._next_ns is None else self._next_ns - self._lead_ns

    def due(self, tenure: Tenure, *, now_ns: int) -> list[tuple[Packet, int]]:
        """Take out the packets to announce now, each with its instant."""
        released = []
        while self._next_ns is not None and self._next_ns - self._lead_ns <= now_ns and len(self._queue):
            if self._slot is not None and self._next_ns == self._slot.start_ns:
                self._gap_ns = self._gap_for(self._slot)  # the gap follows from the queue when the slot begins
            released.append((self._queue.pop(), self._next_ns))
            self._free_ns = self._next_ns + self._gap_ns
            self.arm(tenure, now_ns=now_ns)
        if not len(self._queue):
            self._next_ns = None
        return released
