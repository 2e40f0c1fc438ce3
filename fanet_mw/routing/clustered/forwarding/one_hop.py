"""Hands a packet for one neighbor to that neighbor, acknowledged by the radio, instead of flooding it.

If the neighbor does not answer, it is forgotten until its next hello, and the packet goes the way of all others.
"""

from typing import Final

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbors
from fanet_mw.node.packet import Packet
from fanet_mw.units import NodeId

_UNICAST: Final = 0
"""The phase flags of a packet that goes to its receiver."""


class OneHop:
    """The packets of one node that are under way to the neighbor that is their receiver."""

    def __init__(self, port: Port, neighbors: Neighbors) -> None:
        self._port = port
        self._neighbors = neighbors
        self._under_way: dict[int, Packet] = {}
        """By the sequence number of the transmit request."""

    def __len__(self) -> int:
        return len(self._under_way)

    def send(self, packet: Packet, *, start_ns: int, now_ns: int) -> bool:
        """Send a packet to its receiver; False if that is no neighbor."""
        receiver = NodeId(packet.header.destination)
        if not self._neighbors.has(receiver, now_ns=now_ns):
            return False
        self._under_way[self._port.transmit_to(packet, receiver, flags=_UNICAST, start_ns=start_ns)] = packet
        return True

    def failed(self, status: TxStatus) -> Packet | None:
        """A transmission has ended; returns the packet, to be sent another way, if it was one of these and has not
        arrived.
        """
        packet = self._under_way.pop(status.seq, None)
        if packet is None or status.outcome is TxOutcome.ACKED:
            return None
        self._neighbors.forget(NodeId(packet.header.destination))
        return packet
