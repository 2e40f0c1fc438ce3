"""DSDV at one node (Perkins and Bhagwat, SIGCOMM 1994): each node advertises its distances, with sequence numbers.

A newer number prevails over a shorter route. A new destination or a broken route is advertised at once, another metric
when it has settled: after twice the weighted average of how long better routes with the same number kept coming. As in
ns-3 a packet without a route waits at its origin, an infinite metric counts only from the next hop, and the periods are
the same. Broadcast data is flooded. Not modeled: the base-station extension and layer-2 addresses (section 4).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

from fanet_mw.bus.messages import Reception, TxOutcome
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.dsdv.messages import FULL, INCREMENTAL, INFINITE, PER_ENTRY, Advertised, Update
from fanet_mw.routing.hop_by_hop import HopByHop
from fanet_mw.routing.rival_control_messages import Family
from fanet_mw.serial_number import following, newer
from fanet_mw.units import NodeId, S, earliest

PERIODIC_UPDATE_NS: Final = 15 * S
"""ns-3's PeriodicUpdateInterval."""
MAX_SETTLING_NS: Final = 5 * S
"""ns-3's SettlingTime; here an upper bound of the settling time."""
HOLD_NS: Final = 3 * PERIODIC_UPDATE_NS
"""A route that has not been renewed for three periods is broken (ns-3's Holdtimes)."""
_WEIGHT: Final = 7 / 8
"""The weight of the past in the average settling time (ns-3's WeightedFactor 0.875)."""


@dataclass(slots=True)
class DsdvRoute:
    """The route to one destination, as it is used and as it was last advertised."""

    next_hop: NodeId
    metric: int
    seq: int
    renewed_ns: int
    settling_ns: float = MAX_SETTLING_NS / 2
    """The weighted average of the settling time."""
    advertised_metric: int = -1
    """The metric that was last advertised; -1 when none was."""
    due_ns: int | None = None
    """The instant at which the change is to be advertised; None when it can wait for the next full dump."""


class DsdvTable:
    """All routes of one node."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._routes: dict[NodeId, DsdvRoute] = {}
        self.seq = 0
        """This node's own sequence number, which is even."""
        self.own_due_ns: int | None = None
        """When a newer number of this node is to be advertised, as another has called it unreachable."""

    def next_hop(self, destination: NodeId) -> NodeId | None:
        route = self._routes.get(destination)
        return route.next_hop if route is not None and route.metric < INFINITE else None

    def count(self) -> int:
        return sum(1 for route in self._routes.values() if route.metric < INFINITE)

    # --- receiving --------------------------------------------------------------------------------------------------

    def on_advertised(self, sender: NodeId, advertised: Advertised, *, now_ns: int) -> None:
        """Take in one route of a neighbor's update."""
        destination = NodeId(advertised.destination)
        metric = INFINITE if advertised.metric >= INFINITE - 1 else advertised.metric + 1
        if destination == self._node:
            if advertised.metric == INFINITE and newer(advertised.seq, self.seq):
                self.seq = following(advertised.seq)
                self.own_due_ns = now_ns
            return
        route = self._routes.get(destination)
        if advertised.seq & 1:
            if route is not None and route.next_hop == sender and newer(advertised.seq, route.seq):
                self._break(route, seq=advertised.seq, now_ns=now_ns)
        elif metric == INFINITE:
            return
        elif route is None or route.metric == INFINITE:
            if route is None or newer(advertised.seq, route.seq):
                self._routes[destination] = DsdvRoute(sender, metric, advertised.seq, now_ns, due_ns=now_ns)
        elif newer(advertised.seq, route.seq):
            route.next_hop, route.seq, route.renewed_ns = sender, advertised.seq, now_ns
            self._update_metric(route, metric, now_ns=now_ns)
        elif advertised.seq == route.seq and metric < route.metric:
            late_ns = now_ns - route.renewed_ns
            route.settling_ns = _WEIGHT * route.settling_ns + (1 - _WEIGHT) * late_ns
            route.next_hop = sender
            self._update_metric(route, metric, now_ns=now_ns)

    def _update_metric(self, route: DsdvRoute, metric: int, *, now_ns: int) -> None:
        route.metric = metric
        if metric == route.advertised_metric:
            route.due_ns = None  # a newer number alone is no change: the next full dump carries it
        elif route.advertised_metric >= 0:
            route.due_ns = now_ns + min(MAX_SETTLING_NS, int(2 * route.settling_ns))

    # --- breaking ---------------------------------------------------------------------------------------------------

    def lose(self, neighbor: NodeId, *, now_ns: int) -> bool:
        """A link has broken: routes over it become infinite, with the next odd number; True if there were any."""
        over = [r for r in self._routes.values() if r.next_hop == neighbor and r.metric < INFINITE]
        for route in over:
            self._break(route, seq=following(route.seq), now_ns=now_ns)
        return bool(over)

    def _break(self, route: DsdvRoute, *, seq: int, now_ns: int) -> None:
        route.metric, route.seq, route.renewed_ns, route.due_ns = INFINITE, seq, now_ns, now_ns

    def tidy(self, now_ns: int) -> None:
        """Break the routes that no node renews, and delete the broken ones after the same time."""
        for destination in sorted(self._routes):
            route = self._routes[destination]
            if route.renewed_ns + HOLD_NS <= now_ns:
                if route.metric == INFINITE:
                    del self._routes[destination]
                else:
                    self._break(route, seq=following(route.seq), now_ns=now_ns)

    # --- advertising ------------------------------------------------------------------------------------------------

    def next_news_ns(self) -> int | None:
        news = [route.due_ns for route in self._routes.values() if route.due_ns is not None]
        if self.own_due_ns is not None:
            news.append(self.own_due_ns)
        return min(news, default=None)

    def full(self) -> list[Advertised]:
        """All routes for a full dump; the node's own number grows first."""
        self.seq = following(self.seq, step=2)
        return [self._own(), *(self._advertise(destination) for destination in sorted(self._routes))]

    def news(self, now_ns: int) -> list[Advertised]:
        """The node itself, and the routes whose changes are due to be advertised."""
        due = [n for n in sorted(self._routes) if (due_ns := self._routes[n].due_ns) is not None and due_ns <= now_ns]
        return [self._own(), *(self._advertise(destination) for destination in due)]

    def _own(self) -> Advertised:
        self.own_due_ns = None
        return Advertised(self._node, 0, self.seq)

    def _advertise(self, destination: NodeId) -> Advertised:
        route = self._routes[destination]
        route.advertised_metric, route.due_ns = route.metric, None
        return Advertised(destination, route.metric, route.seq)


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
