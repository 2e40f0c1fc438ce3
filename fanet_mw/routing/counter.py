"""Counter-based flooding: a node relays a packet unless it hears enough copies of it (Ni et al., MobiCom 1999, 3.2).

A node waits U(0, `routing.assess_ms`), and relays if it has received fewer than `routing.counter` copies by then. Not
modeled: the distance- and location-based schemes of the paper.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.flooding import FloodingProtocol
from fanet_mw.routing.random_assessment_delay import Assessment
from fanet_mw.units import MS, NodeId


class CounterBased(FloodingProtocol):
    """Flooding in which a node relays a packet unless enough other nodes have done so."""

    stream_name: ClassVar[str] = "storm"

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._assess_ns = round(routing.assess_ms * MS)
        self._assessment = Assessment(enough=routing.counter)

    def _consider(self, packet: Packet, now_ns: int) -> Sequence[Relay]:
        self._assessment.first_copy(packet, due_ns=now_ns + int(self._random() * self._assess_ns))
        return ()

    def on_copy(self, key: int, src: NodeId, *, now_ns: int) -> None:
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
