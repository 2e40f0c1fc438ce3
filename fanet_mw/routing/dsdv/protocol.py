"""DSDV at one node (Perkins and Bhagwat, SIGCOMM 1994): each node advertises its distances, with sequence numbers.

    every 15 s  -> full dump, own number + 2
    changes     -> an incremental update within a second: new destinations and broken routes at once, another metric
                   when it has settled
    link breaks -> infinite metric, odd number; a link has broken when a unicast is not acknowledged, or when at a full
                   dump no update has renewed the route for three periods

As in ns-3 a packet without a route waits at its origin, an infinite metric counts only from the next hop, and the
periods are the same. Broadcast data is flooded. Not modeled: the base-station extension and layer-2 addresses
(section 4).
"""

from collections.abc import Mapping
from typing import ClassVar, Final

from fanet_mw.bus.messages import Reception, TxOutcome
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.dsdv.messages import FULL, INCREMENTAL, PER_ENTRY, Advertised, Update
from fanet_mw.routing.dsdv.table import PERIODIC_UPDATE_NS, DsdvTable
from fanet_mw.routing.hop_by_hop import HopByHop
from fanet_mw.routing.rival_control_messages import Family
from fanet_mw.units import NodeId, S, earliest

_GATHER_NS: Final = 1 * S
"""A change is advertised after U(0, this time), with all changes that have come by then (ns-3's triggered updates)."""


class Dsdv(HopByHop):
    """Destination-sequenced distance vector routing."""

    family: ClassVar[Family] = Family.DSDV

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._table = DsdvTable(port.node)
        self._most = control.capacity(port.scenario.radio.max_frame_bytes) // PER_ENTRY
        self._full_ns: int | None = None
        self._news_ns: int | None = None

    def start(self, now_ns: int) -> None:
        self._full_ns = now_ns + int(self._random() * _GATHER_NS)

    # --- data -------------------------------------------------------------------------------------------------------

    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        next_hop = self._table.next_hop(NodeId(packet.header.destination))
        if next_hop is not None:
            self._send(packet, next_hop, start_ns=start_ns, now_ns=now_ns)
            return
        self._room.push(packet, now_ns=now_ns)

    def _route_transit(self, packet: Packet, reception: Reception, *, start_ns: int, now_ns: int) -> None:
        next_hop = self._table.next_hop(NodeId(packet.header.destination))
        if next_hop is None:
            self._port.drop(DropReason.NO_ROUTE, packet, now_ns=now_ns)
        else:
            self._send(packet, next_hop, start_ns=start_ns, now_ns=now_ns)

    def _on_failure(self, packet: Packet, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        self._drop_failed(packet, outcome, now_ns=now_ns)
        if outcome is TxOutcome.RETRY_LIMIT and self._table.lose(next_hop, now_ns=now_ns):
            self._plan(now_ns)

    # --- control ----------------------------------------------------------------------------------------------------

    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if number not in (FULL, INCREMENTAL):
            raise MalformedFrameError(f"DSDV message {number}")
        for advertised in Update.decode(body).routes:
            self._table.on_advertised(reception.src, advertised, now_ns=now_ns)
        self._release(now_ns)
        self._plan(now_ns)

    def _release(self, now_ns: int) -> None:
        for destination in self._room.destinations():
            next_hop = self._table.next_hop(destination)
            if next_hop is not None:
                for packet in self._room.take(destination):
                    self._send(packet, next_hop, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def _plan(self, now_ns: int) -> None:
        due_ns = self._table.next_news_ns()
        if due_ns is not None and (self._news_ns is None or self._news_ns > due_ns + _GATHER_NS):
            self._news_ns = max(now_ns, due_ns) + int(self._random() * _GATHER_NS)

    def _advertise(self, number: int, routes: list[Advertised], *, now_ns: int) -> None:
        for at in range(0, len(routes), self._most):
            update = Update(tuple(routes[at : at + self._most]))
            self._send_control(number, update.encode(), start_ns=self._jittered(now_ns, self._jitter_ns), now_ns=now_ns)

    # --- time -------------------------------------------------------------------------------------------------------

    def _due_ns(self) -> int | None:
        return earliest(self._full_ns, self._news_ns, self._room.next_end_ns())

    def _on_wake(self, now_ns: int) -> None:
        self._room.expire(now_ns=now_ns)
        if self._full_ns is not None and now_ns >= self._full_ns:
            self._table.tidy(now_ns)
            self._advertise(FULL, self._table.full(), now_ns=now_ns)
            self._full_ns += PERIODIC_UPDATE_NS
            self._news_ns = None
        elif self._news_ns is not None and now_ns >= self._news_ns:
            self._advertise(INCREMENTAL, self._table.news(now_ns), now_ns=now_ns)
            self._news_ns = None
        self._plan(now_ns)

    # --- reporting --------------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        return {"control_sent": self.control_sent, "waiting": self.waiting(), "routes": self._table.count()}
