"""Gossip: flooding in which each node relays a packet with a certain probability, one answer to the broadcast storm.

It is GOSSIP1(p, k) of Haas, Halpern and Li (ToN, 2006): a node relays with probability p, and always within the first k
hops (`routing.gossip_p`, `gossip_k`). Everything is flooded, even packets for one node. Not modeled: GOSSIP2 to GOSSIP4
of the paper (neighbor counts, second chances, zones).
"""

from collections.abc import Sequence
from typing import ClassVar

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.flooding import FloodingProtocol


class Gossip(FloodingProtocol):
    """Flooding in which each node relays with a certain probability."""

    stream_name: ClassVar[str] = "storm"

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._p, self._k, self._jitter_ns = routing.gossip_p, routing.gossip_k, routing.jitter_ns

    def _consider(self, packet: Packet, now_ns: int) -> Sequence[Relay]:
        """Relay within k hops, or with probability p; `hops` counts the transmissions before the one received."""
        draw, jitter = self._random(), self._random()
        if packet.header.hops + 1 <= self._k or draw < self._p:
            return ((packet, now_ns + self._lead_ns + int(jitter * self._jitter_ns)),)
        return ()
