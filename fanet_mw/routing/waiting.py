"""Packets that wait for a route: bounded, oldest out first, each with its end. Nothing leaves without a name."""

from typing import NamedTuple

from fanet_mw.node.queue import Packet
from fanet_mw.units import NodeId


class Held(NamedTuple):
    """A packet and the instant beyond which nobody wants it."""

    packet: Packet
    ends_ns: int


class WaitingRoom:
    """First in, first out, by destination."""

    def __init__(self, *, capacity: int, hold_ns: int) -> None:
        self._capacity = capacity
        self._hold_ns = hold_ns
        self._held: list[Held] = []

    def __len__(self) -> int:
        return len(self._held)

    def push(self, packet: Packet, *, now_ns: int) -> Packet | None:
        """Take a packet in; return the oldest, if it had to go."""
        self._held.append(Held(packet, now_ns + self._hold_ns))
        return self._held.pop(0).packet if len(self._held) > self._capacity else None

    def destinations(self) -> list[NodeId]:
        """For whom packets wait, ascending."""
        return sorted({NodeId(held.packet.header.destination) for held in self._held})

    def take(self, destination: NodeId) -> list[Packet]:
        """Take out everything for one destination, in the order it came."""
        taken = [held.packet for held in self._held if held.packet.header.destination == destination]
        if taken:
            self._held = [held for held in self._held if held.packet.header.destination != destination]
        return taken

    def expire(self, *, now_ns: int) -> list[Packet]:
        """Take out what nobody wants any more."""
        over = [held.packet for held in self._held if held.ends_ns <= now_ns]
        if over:
            self._held = [held for held in self._held if held.ends_ns > now_ns]
        return over

    def next_end_ns(self) -> int | None:
        return self._held[0].ends_ns if self._held else None
