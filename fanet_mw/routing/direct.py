"""No routing: each packet is transmitted once, to its destination or to all nodes in range. It shows the MAC alone."""

from typing import ClassVar

from fanet_mw.bus.messages import Reception
from fanet_mw.node.contract import RoutingProtocol
from fanet_mw.node.packet import Packet
from fanet_mw.units import NodeId


class Direct(RoutingProtocol):
    """Sends its own packets once and relays nothing."""

    contends_at_once: ClassVar[bool] = True

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        saturated = self._port.scenario.saturated
        self._port.transmit(packet.frame, NodeId(packet.header.destination), start_ns=due_ns, wants_status=saturated)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        pass  # the node has delivered the packet already, or it is for another node
