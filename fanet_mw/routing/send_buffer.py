"""A bounded FIFO of packets that wait for a route: when it is full, the oldest is evicted; each packet expires, too."""

from typing import NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.units import NodeId


class Held(NamedTuple):
    """A packet, and the instant at which it expires."""

    packet: Packet
    ends_ns: int


class SendBuffer:
    """The packets of one node that wait for routes, first in, first out."""

    def __init__(self, *, capacity: int, hold_ns: int) -> None:
        self._capacity = capacity
        self._hold_ns = hold_ns
        self._held: list[Held] = []

    def __len__(self) -> int:
        return len(self._held)

    def push(self, packet: Packet, *, now_ns: int) -> Packet | None:
        self._held.append(Held(packet, now_ns + self._hold_ns))
        return self._held.pop(0).packet if len(self._held) > self._capacity else None

    def destinations(self) -> list[NodeId]:
        return sorted({NodeId(held.packet.header.destination) for held in self._held})

    def take(self, destination: NodeId) -> list[Packet]:
        taken = [held.packet for held in self._held if held.packet.header.destination == destination]
        if taken:
            self._held = [held for held in self._held if held.packet.header.destination != destination]
        return taken

    def expire(self, *, now_ns: int) -> list[Packet]:
        over = [held.packet for held in self._held if held.ends_ns <= now_ns]
        if over:
            self._held = [held for held in self._held if held.ends_ns > now_ns]
        return over

    def next_end_ns(self) -> int | None:
        return self._held[0].ends_ns if self._held else None
