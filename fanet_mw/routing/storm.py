"""Two answers to the broadcast storm: flooding in which not everyone relays. Everything is flooded, unicast too.

`gossip`   GOSSIP1(p, k): relay with probability p, always within the first k hops  (Haas, Halpern, Li, ToN 14(3), 2006)
`counter`  wait U(0, assess), stay silent if C copies were heard meanwhile          (Ni et al., MobiCom 1999, 3.2)

Probabilities and bounds are `routing.gossip_p`, `gossip_k`, `counter`, `assess_ms`. Does not model: GOSSIP2 to 4 of the
same paper (neighbor counts, second chances, zones), nor the distance- and location-based schemes of the other.
"""

import heapq
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from fanet_mw.errors import DropReason
from fanet_mw.messages import Reception
from fanet_mw.protocol.contract import Port, RoutingProtocol
from fanet_mw.protocol.seen import key_of
from fanet_mw.protocol.txqueue import Packet
from fanet_mw.units import BROADCAST, MS
from fanet_mw.wire import FLAG_FLOOD


class _Storm(RoutingProtocol):
    """What both share: everything goes out as a flood, and a first copy is a question."""

    origin_flags: ClassVar[int] = FLAG_FLOOD

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._lead_ns = port.scenario.radio.lead_ns
        self._random = port.stream("storm").random

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._port.transmit(packet.frame, BROADCAST, start_ns=due_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if packet.header.destination == self._port.node:
            return  # it has arrived
        if packet.header.hop_limit <= 1:
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return
        self._consider(packet, now_ns=now_ns)

    @abstractmethod
    def _consider(self, packet: Packet, *, now_ns: int) -> None:
        """The first copy of a packet that may be relayed."""

    def _relay(self, packet: Packet, *, start_ns: int) -> None:
        self._port.transmit(self._port.forwarded(packet, flags=FLAG_FLOOD), BROADCAST, start_ns=start_ns)


class Gossip(_Storm):
    """Relay by lot."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._p, self._k, self._jitter_ns = routing.gossip_p, routing.gossip_k, routing.jitter_ns

    def _consider(self, packet: Packet, *, now_ns: int) -> None:
        """`hops` counts transmissions before the one we heard: the neighbors of the origin are hop 1."""
        lot, jitter = self._random(), self._random()
        if packet.header.hops + 1 <= self._k or lot < self._p:
            self._relay(packet, start_ns=now_ns + self._lead_ns + int(jitter * self._jitter_ns))


class CounterBased(_Storm):
    """Relay what few others relay."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        routing = port.scenario.routing
        self._enough, self._assess_ns = routing.counter, round(routing.assess_ms * MS)
        self._pending: dict[int, tuple[int, Packet]] = {}
        """Copies heard and the packet, by key, of those under assessment."""
        self._due: list[tuple[int, int]] = []

    def _consider(self, packet: Packet, *, now_ns: int) -> None:
        key = key_of(origin=packet.header.origin, seq=packet.header.seq)
        self._pending[key] = 1, packet
        heapq.heappush(self._due, (now_ns + int(self._random() * self._assess_ns), key))

    def overheard(self, key: int, *, now_ns: int) -> None:
        copies, packet = self._pending.get(key, (0, None))
        if packet is None:
            return
        if copies + 1 >= self._enough:
            del self._pending[key]
        else:
            self._pending[key] = copies + 1, packet

    def next_wake_ns(self) -> int | None:
        while self._due and self._due[0][1] not in self._pending:
            heapq.heappop(self._due)  # decided meanwhile
        return self._due[0][0] if self._due else None

    def wake(self, now_ns: int) -> None:
        while (due_ns := self.next_wake_ns()) is not None and due_ns <= now_ns:
            _, key = heapq.heappop(self._due)
            self._relay(self._pending.pop(key)[1], start_ns=now_ns + self._lead_ns)

    def waiting(self) -> int:
        return len(self._pending)

    def report(self) -> Mapping[str, object]:
        return {"waiting": self.waiting()}
