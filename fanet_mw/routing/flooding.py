"""Plain flooding: every node re-broadcasts each new packet once, after a random jitter (paper, Figure 9).

`FloodingProtocol` is the common base of the protocols that flood everything, even packets for one node: `flooding`
here, `gossip` and `counter` in the files of these names.
"""

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.packet import Packet, Relay, is_used_up
from fanet_mw.units import BROADCAST
from fanet_mw.wire import FLAG_FLOOD


class FloodingProtocol(RoutingProtocol):
    """Floods everything; a subclass decides about each first copy. The node suppresses duplicates."""

    origin_flags: ClassVar[int] = FLAG_FLOOD
    contends_at_once: ClassVar[bool] = True
    stream_name: ClassVar[str]

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._lead_ns = port.scenario.radio.lead_ns
        self._random = port.stream(self.stream_name).random

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._port.transmit(packet.frame, BROADCAST, start_ns=due_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> Sequence[Relay]:
        header = packet.header
        if header.destination == self._port.node:
            return ()  # the packet has reached its destination
        if is_used_up(header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return ()
        return self._consider(packet, now_ns)

    @abstractmethod
    def _consider(self, packet: Packet, now_ns: int) -> Sequence[Relay]:
        """Decide about the first copy of a packet that may be relayed; returns the relay if that is decided already."""


class Flooding(FloodingProtocol):
    """Relays each packet at reception + lead + U(0, jitter)."""

    stream_name: ClassVar[str] = "jitter"

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._jitter_ns = port.scenario.routing.jitter_ns

    def _consider(self, packet: Packet, now_ns: int) -> Sequence[Relay]:
        return ((packet, now_ns + self._lead_ns + int(self._random() * self._jitter_ns)),)
