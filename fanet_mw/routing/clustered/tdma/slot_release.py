"""A head's queue and when it lets packets out: only inside its own slot, announced one lead ahead.

`burst` releases at the least gap; `spread` divides the slot among what is queued at its beginning, so that the flood
of one packet moves on before the next one starts. What does not fit waits for the next occurrence of the slot. A head
that is deposed lets out what it still holds in the slot that it had: handing it over would cost more than flooding it.
"""

from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.slots import Slot, Superframe
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS

_SPREAD_CAP_NS: Final = 40 * MS
"""Two floods this far apart no longer meet (some hops x lead + jitter + airtime); more would only add delay."""


class Tenure(NamedTuple):
    """The slot of a superframe that a head has, or had when it last was head."""

    superframe: Superframe
    slot: int


class SlotRelease:
    """The queue of one head, let out in its slot."""

    def __init__(self, queue: TxQueue, clusters: Clusters, *, lead_ns: int) -> None:
        self._queue = queue
        self.expire = queue.expire
        """The queue's own method: it is asked at every wake-up."""
        self._spread = clusters.pacing == "spread"
        self._least_gap_ns = max(1, round(clusters.release_gap_ms * MS))
        self._lead_ns = lead_ns
        self._slot: Slot | None = None
        self._gap_ns = self._least_gap_ns
        self._free_ns = 0
        """One gap after the last release: nothing leaves before, though the queue was empty meanwhile."""
        self._next_ns: int | None = None
        """The instant of the next release; None while nothing is queued or the node owns no slot."""

    def __len__(self) -> int:
        return len(self._queue)

    def push(self, packet: Packet, tenure: Tenure, *, now_ns: int) -> Packet | None:
        """Queue a packet; returns the one evicted for it."""
        evicted = self._queue.push(packet)
        if self._next_ns is None:
            self.arm(tenure, now_ns=now_ns)
        return evicted

    def more(self, size: int) -> list[Packet]:
        """Packets that fit into what a frame released now has left [bytes]."""
        return self._queue.pop_fitting(size)

    def drain(self) -> list[Packet]:
        """Give up all that is queued, because it goes another way."""
        self._next_ns = self._slot = None
        return self._queue.drain()

    def arm(self, tenure: Tenure, *, now_ns: int) -> None:
        """Find the first instant at which a packet may go."""
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
        """Packets to announce now, each with its instant."""
        released = []
        while self._next_ns is not None and self._next_ns - self._lead_ns <= now_ns and len(self._queue):
            if self._slot is not None and self._next_ns == self._slot.start_ns:
                self._gap_ns = self._gap_for(self._slot)  # the queue as it is when the slot opens
            released.append((self._queue.pop(), self._next_ns))
            self._free_ns = self._next_ns + self._gap_ns
            self.arm(tenure, now_ns=now_ns)
        if not len(self._queue):
            self._next_ns = None
        return released
