"""A bounded FIFO of packets that wait for a route: when it is full, the oldest is dropped, and each that expires."""

from typing import NamedTuple

from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.units import NodeId, seconds_to_ns


class Held(NamedTuple):
    """A packet, and the instant at which it expires."""

    packet: Packet
    ends_ns: int


class SendBuffer:
    """The packets of one node that wait for routes, first in, first out."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._capacity = port.scenario.routing.queue_frames
        self._hold_ns = seconds_to_ns(port.scenario.routing.lifetime_s)
        self._held: list[Held] = []

    def __len__(self) -> int:
        return len(self._held)

    def push(self, packet: Packet, *, now_ns: int) -> None:
        self._held.append(Held(packet, now_ns + self._hold_ns))
        if len(self._held) > self._capacity:
            self._drop_oldest(DropReason.QUEUE_FULL, now_ns)

    def destinations(self) -> list[NodeId]:
        return sorted({NodeId(held.packet.header.destination) for held in self._held})

    def take(self, destination: NodeId) -> list[Packet]:
        taken = [held.packet for held in self._held if held.packet.header.destination == destination]
        if taken:
            self._held = [held for held in self._held if held.packet.header.destination != destination]
        return taken

    def expire(self, *, now_ns: int) -> None:
        while self._held and self._held[0].ends_ns <= now_ns:
            self._drop_oldest(DropReason.EXPIRED, now_ns)

    def _drop_oldest(self, reason: DropReason, now_ns: int) -> None:
        self._port.drop(reason, self._held.pop(0).packet, now_ns=now_ns)

    def next_end_ns(self) -> int | None:
        return self._held[0].ends_ns if self._held else None
