"""Two answers to the broadcast storm: flooding in which not every node relays. Everything is flooded, even packets for
one node.

    gossip   GOSSIP1(p, k): relay with probability p, always within the first k hops (Haas, Halpern, Li, ToN, 2006)
    counter  wait U(0, assess); do not relay if C copies are received in that time    (Ni et al., MobiCom 1999, 3.2)

The parameters are `routing.gossip_p`, `gossip_k`, `counter` and `assess_ms`. Not modeled: GOSSIP2 to GOSSIP4 of the
first paper (neighbor counts, second chances, zones), and the distance- and location-based schemes of the second.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.assessment import Assessment
from fanet_mw.routing.flooding import FloodingProtocol
from fanet_mw.units import MS


class Gossip(FloodingProtocol):
    """Flooding in which each node relays with a certain probability."""

    stream_name: ClassVar[str] = "storm"

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._p, self._k, self._jitter_ns = routing.gossip_p, routing.gossip_k, routing.jitter_ns

    def _consider(self, packet: Packet, *, now_ns: int) -> Sequence[Relay]:
        """Relay within k hops, or with probability p; `hops` counts the transmissions before the one received."""
        draw, jitter = self._random(), self._random()
        if packet.header.hops + 1 <= self._k or draw < self._p:
            return ((packet, now_ns + self._lead_ns + int(jitter * self._jitter_ns)),)
        return ()


class CounterBased(FloodingProtocol):
    """Flooding in which a node relays a packet unless enough other nodes have done so."""

    stream_name: ClassVar[str] = "storm"

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._assess_ns = round(routing.assess_ms * MS)
        self._assessment = Assessment(enough=routing.counter)

    def _consider(self, packet: Packet, *, now_ns: int) -> Sequence[Relay]:
        self._assessment.first_copy(packet, due_ns=now_ns + int(self._random() * self._assess_ns))
        return ()

    def on_copy(self, key: int, *, now_ns: int) -> None:
        self._assessment.on_copy(key, now_ns=now_ns)

    def next_wake_ns(self) -> int | None:
        return self._assessment.next_wake_ns()

    def wake(self, now_ns: int) -> None:
        for due_ns, packet in self._assessment.decided(now_ns=now_ns):
            self._port.relay((packet, max(due_ns + self._lead_ns, now_ns)))

    def waiting(self) -> int:
        return len(self._assessment)

    def report(self) -> Mapping[str, object]:
        return {"waiting": self.waiting()}
