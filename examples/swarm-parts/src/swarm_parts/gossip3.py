"""GOSSIP3(p, k, m): relay with probability p; who does not, and then hears fewer than m copies, relays after all.

Haas, Halpern, Li, "Gossip-based ad hoc routing", IEEE/ACM Trans. Netw. 14(3), 2006, section 5. The first k hops always
relay.
"""

from collections.abc import Mapping

from pydantic import BaseModel, Field

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet
from fanet_mw.units import BROADCAST, MS, NodeId
from fanet_mw.wire import FLAG_FLOOD


class Options(BaseModel, extra="forbid"):
    """The table `[routing.options]`."""

    p: float = Field(0.65, ge=0, le=1)
    """Probability of a relay."""
    k: int = Field(1, ge=0, le=255)
    """Within so many hops of the origin everyone relays."""
    least_copies: int = Field(1, ge=1, le=1000)
    """m: who was silent relays after all when it heard fewer copies than this."""
    patience_ms: float = Field(50, ge=1, le=10_000)
    """How long who was silent listens."""


class Gossip3(RoutingProtocol):
    """One node's part in it. Everything is flooded, unicast too."""

    Options = Options
    origin_flags = FLAG_FLOOD

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._options = Options.model_validate(port.scenario.routing.options)
        self._lead_ns = port.scenario.radio.lead_ns
        self._jitter_ns = port.scenario.routing.jitter_ns
        self._random = port.stream("gossip3").random
        self._silent: dict[int, tuple[int, Packet]] = {}
        """What this node did not relay, by key: the instant at which it decides anew. In order of these instants."""
        self._copies: dict[int, int] = {}
        """How many copies of these were heard since."""

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._port.transmit(packet.frame, BROADCAST, start_ns=due_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        header = packet.header
        if header.destination == self._port.node:
            return
        if header.hop_limit <= 1:
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return
        if header.hops + 1 <= self._options.k or self._random() < self._options.p:
            self._relay(packet, now_ns)
            return
        key = key_of(origin=header.origin, seq=header.seq)
        self._silent[key] = now_ns + round(self._options.patience_ms * MS), packet
        self._copies[key] = 0

    def on_copy(self, key: int, src: NodeId, *, now_ns: int) -> None:
        if key in self._copies:
            self._copies[key] += 1

    def next_wake_ns(self) -> int | None:
        return next((due_ns for due_ns, _ in self._silent.values()), None)

    def wake(self, now_ns: int) -> None:
        for key, (due_ns, packet) in list(self._silent.items()):
            if due_ns > now_ns:
                break
            del self._silent[key]
            if self._copies.pop(key) < self._options.least_copies:
                self._relay(packet, now_ns)

    def waiting(self) -> int:
        return len(self._silent)

    def report(self) -> Mapping[str, object]:
        return {"waiting": self.waiting()}

    def _relay(self, packet: Packet, now_ns: int) -> None:
        start_ns = now_ns + self._lead_ns + int(self._random() * self._jitter_ns)
        self._port.transmit(self._port.forwarded(packet, flags=FLAG_FLOOD), BROADCAST, start_ns=start_ns)
