"""The bounded priority queue of a node. Each packet leaves it either to be transmitted, or to be dropped with a reason.

Packets are ordered by priority (0 is the most urgent), then by arrival. If the queue is full, the newest packet of the
least important priority is evicted. Some classes expire sooner than others: a collision warning is worth nothing after
a second.
"""

from bisect import bisect_left, insort
from collections.abc import Callable
from typing import Protocol

from fanet_mw.errors import DropReason
from fanet_mw.node.duplicates import key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.scenario import Routing
from fanet_mw.units import US
from fanet_mw.wire import PRIORITY_REPORT, PRIORITY_SAFETY


class Drop(Protocol):
    """Takes a packet that is evicted or expired, as `Port.drop` does."""

    def __call__(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None: ...


def _unsaid(reason: DropReason, packet: Packet, *, now_ns: int) -> None:
    """Say nothing about a packet that is one of several copies."""


class TxQueue:
    """Packets that wait for a slot or a route."""

    def __init__(self, routing: Routing, drop: Drop = _unsaid) -> None:
        self._drop = drop
        self._capacity = routing.queue_frames
        self._lifetime_ns = whole_ns = routing.lifetime_ns(-1)
        self._sooner_us = {p: (whole_ns - routing.lifetime_ns(p)) // US for p in (PRIORITY_SAFETY, PRIORITY_REPORT)}
        """How much earlier than the others each priority class expires, for the classes that do."""
        self._entries: list[tuple[int, int, Packet]] = []
        self._order = 0
        self._fresh_us = 0
        """No packet in the queue expires by an earlier horizon (`_fresh_until_us`)."""

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, key: object) -> bool:
        """True if a packet with this key (`duplicates.key_of`) is queued."""
        return bool(self._entries) and any(key_of_packet(entry[2]) == key for entry in self._entries)

    def remove(self, key: int) -> None:
        self._entries = [entry for entry in self._entries if key_of_packet(entry[2]) != key]

    def push(self, packet: Packet, *, rank: int | None = None, now_ns: int) -> None:
        """Add a packet, or drop it or another one. `rank`: its priority here, by default its own."""
        self._order += 1
        if rank is None:
            rank = packet.header.priority
        fresh_us = self._fresh_until_us(packet)
        if not self._entries or fresh_us < self._fresh_us:
            self._fresh_us = fresh_us
        insort(self._entries, (rank, self._order, packet))
        if len(self._entries) > self._capacity:
            self._drop(DropReason.QUEUE_FULL, self._entries.pop()[2], now_ns=now_ns)

    def pop(self) -> Packet:
        """Remove the most urgent packet."""
        assert self._entries, "whoever pops has looked at the length"
        return self._entries.pop(0)[2]

    def pop_fitting(self, size: int) -> list[Packet]:
        """Remove the most urgent packets, in order, as long as together they fit into `size` bytes."""
        taken = []
        while self._entries and len(self._entries[0][2].frame) <= size:
            taken.append(self.pop())
            size -= len(taken[-1].frame)
        return taken

    def waiting(self, rank: int) -> list[Packet]:
        """The packets that wait at one priority, in order."""
        return [packet for _, _, packet in self._of(rank)]

    def take(self, size: int, *, rank: int) -> list[Packet]:
        """Remove packets of one priority, in order, as long as together they fit into `size` bytes."""
        taken: list[Packet] = []
        begin = bisect_left(self._entries, (rank,))
        for _, _, packet in self._of(rank):
            if len(packet.frame) > size:
                break
            size -= len(packet.frame)
            taken.append(packet)
        del self._entries[begin : begin + len(taken)]
        return taken

    def take_older(self, *, before_us: int, rank: int) -> list[Packet]:
        """Remove the packets of one priority that were generated before an instant [swarm us]."""
        older = [entry for entry in self._of(rank) if entry[2].header.origin_us < before_us]
        for entry in older:
            self._entries.remove(entry)
        return [entry[2] for entry in older]

    def put_off(self, stays: Callable[[Packet], bool], *, rank: int, behind: int) -> None:
        """Move packets of one priority to a less important one, in order, but for those that stay."""
        for entry in [entry for entry in self._of(rank) if not stays(entry[2])]:
            self._entries.remove(entry)
            insort(self._entries, (behind, *entry[1:]))

    def _of(self, rank: int) -> list[tuple[int, int, Packet]]:
        return self._entries[bisect_left(self._entries, (rank,)) : bisect_left(self._entries, (rank + 1,))]

    def expire(self, *, now_ns: int) -> None:
        """Drop all packets that are older than the lifetime of their class."""
        if not self._entries:
            return  # as at most wake-ups
        before_us = (now_ns - self._lifetime_ns) // US
        if before_us <= self._fresh_us:
            return  # otherwise each wake-up would examine the whole queue
        stale: list[tuple[int, int, Packet]] = []
        kept: list[tuple[int, int, Packet]] = []
        for entry in self._entries:
            (stale if self._fresh_until_us(entry[2]) < before_us else kept).append(entry)
        self._entries = kept
        self._fresh_us = min((self._fresh_until_us(packet) for _, _, packet in kept), default=0)
        for _, _, packet in stale:
            self._drop(DropReason.EXPIRED, packet, now_ns=now_ns)

    def _fresh_until_us(self, packet: Packet) -> int:
        """The packet's origin time [swarm us], less the amount by which the lifetime of its class is shorter. It
        expires one full lifetime after this instant.
        """
        return packet.header.origin_us - self._sooner_us.get(packet.header.priority, 0)

    def drain(self) -> list[Packet]:
        """Remove all packets, the most urgent first."""
        entries, self._entries = self._entries, []
        return [entry[2] for entry in entries]
