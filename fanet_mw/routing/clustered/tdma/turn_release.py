"""Releases the queued packets of a node in its turns: one frame in each turn, announced to the radio one lead ahead.

The base class in this file has the queue and the next turn. A subclass knows which turns the node has:
`timetable/root_release.py` for its own floods, and `timetable/call_release.py` for frames to neighbors alone.
"""

from abc import ABC, abstractmethod
from typing import NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue


class OwnTurn(NamedTuple):
    """A future turn in which the node may transmit."""

    start_ns: int
    frame_bytes: int
    """The number of bytes that the turn can carry; 0 means one packet of any length."""


class TurnRelease(ABC):
    """The queue of one node, and the next turn for which a frame is planned."""

    def __init__(self, queue: TxQueue, *, lead_ns: int) -> None:
        self._queue = queue
        self._lead_ns = lead_ns
        self._free_ns = 0
        """The first instant after the last turn that was used."""
        self._next: OwnTurn | None = None

    @abstractmethod
    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        """The first turn of the node from an instant on."""

    def has_turn(self, *, now_ns: int) -> bool:
        """True if this node has a turn from now on."""
        return self._turn(max(now_ns + self._lead_ns, self._free_ns)) is not None

    def __len__(self) -> int:
        return len(self._queue)

    def push(self, packet: Packet, *, now_ns: int) -> Packet | None:
        """Queue a packet; returns the packet that was evicted for it, if any."""
        return self._push(packet, packet.header.priority, now_ns)

    def _push(self, packet: Packet, rank: int, now_ns: int) -> Packet | None:
        evicted = self._queue.push(packet, rank=rank)
        if self._next is None:
            self._arm(now_ns)
        return evicted

    def holds(self, key: int) -> bool:
        """True if the packet with this key (`duplicates.key_of`) is queued."""
        return key in self._queue

    def expire(self, *, before_us: int) -> list[Packet]:
        return self._queue.expire(before_us=before_us)

    def drain(self) -> list[Packet]:
        """Take out all queued packets, because they will go another way."""
        self._next = None
        return self._queue.drain()

    def next_wake_ns(self) -> int | None:
        return None if self._next is None else self._next.start_ns - self._lead_ns

    def due(self, *, now_ns: int) -> list[tuple[list[Packet], int]]:
        """Take out the packets to announce now: for each frame its packets, and the instant of the frame."""
        released = []
        while self._next is not None and self._next.start_ns - self._lead_ns <= now_ns and len(self._queue):
            released.append((self._fill(self._next.frame_bytes), self._next.start_ns))
            self._free_ns = self._next.start_ns + 1
            self._arm(now_ns)
        if not len(self._queue):
            self._next = None
        return released

    def _fill(self, size: int) -> list[Packet]:
        """Take out the packets for one turn: the most urgent one, and others that fit into the same frame."""
        first = self._queue.pop()
        return [first, *self._queue.pop_fitting(size - len(first.frame))]

    def _arm(self, now_ns: int) -> None:
        earliest_ns = max(now_ns + self._lead_ns, self._free_ns)
        self._next = self._turn(earliest_ns) if len(self._queue) else None
