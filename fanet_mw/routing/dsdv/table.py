"""DSDV's routes and which of them are news (Perkins and Bhagwat 1994, sections 3.1 to 3.4).

A newer sequence number beats a shorter way; of equally new ways the shorter wins. Forwarding uses the best way at once.
Telling others waits: a new destination or a broken way is told at once, another metric when it has settled, that is
after twice the weighted average of how long better ways with the same number kept coming.
"""

from dataclasses import dataclass
from typing import Final

from fanet_mw.routing.dsdv.messages import INFINITE, Advertised
from fanet_mw.serial import following, newer
from fanet_mw.units import NodeId, S

PERIODIC_UPDATE_NS: Final = 15 * S
"""ns-3's PeriodicUpdateInterval."""
MAX_SETTLING_NS: Final = 5 * S
"""ns-3's SettlingTime; here the bound of what the average may ask for."""
HOLD_NS: Final = 3 * PERIODIC_UPDATE_NS
"""A way that was not renewed for three periods is broken (ns-3's Holdtimes)."""
_WEIGHT: Final = 7 / 8
"""Of the past in the average settling time (ns-3's WeightedFactor 0.875)."""


@dataclass(slots=True)
class Route:
    """The way to one destination, as it is used and as it was last told."""

    next_hop: NodeId
    metric: int
    seq: int
    renewed_ns: int
    """When the sequence number last grew."""
    settling_ns: float = MAX_SETTLING_NS / 2
    """Weighted average of the settling time."""
    told_metric: int = -1
    """The metric last told to neighbors; -1: never told."""
    tell_ns: int | None = None
    """When the change is due to be told; None: nothing to tell before the next full dump."""


class Table:
    """Every route of one node."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._routes: dict[NodeId, Route] = {}
        self.seq = 0
        """Our own number: even, from ourselves."""
        self.tell_own_ns: int | None = None
        """Somebody called us unreachable: tell a newer number."""

    def next_hop(self, destination: NodeId) -> NodeId | None:
        route = self._routes.get(destination)
        return route.next_hop if route is not None and route.metric < INFINITE else None

    def count(self) -> int:
        return sum(1 for route in self._routes.values() if route.metric < INFINITE)

    # --- hearing ----------------------------------------------------------------------------------------------------

    def hear(self, sender: NodeId, told: Advertised, *, now_ns: int) -> None:
        """One route of a neighbor's update."""
        destination = NodeId(told.destination)
        metric = INFINITE if told.metric >= INFINITE - 1 else told.metric + 1
        if destination == self._node:
            if told.metric == INFINITE and newer(told.seq, self.seq):
                self.seq = following(told.seq)
                self.tell_own_ns = now_ns
            return
        route = self._routes.get(destination)
        if told.seq & 1:
            if route is not None and route.next_hop == sender and newer(told.seq, route.seq):
                self._break(route, seq=told.seq, now_ns=now_ns)
        elif metric == INFINITE:
            return
        elif route is None or route.metric == INFINITE:
            if route is None or newer(told.seq, route.seq):
                self._routes[destination] = Route(sender, metric, told.seq, now_ns, tell_ns=now_ns)
        elif newer(told.seq, route.seq):
            route.next_hop, route.seq, route.renewed_ns = sender, told.seq, now_ns
            self._settle(route, metric, now_ns=now_ns)
        elif told.seq == route.seq and metric < route.metric:
            late_ns = now_ns - route.renewed_ns
            route.settling_ns = _WEIGHT * route.settling_ns + (1 - _WEIGHT) * late_ns
            route.next_hop = sender
            self._settle(route, metric, now_ns=now_ns)

    def _settle(self, route: Route, metric: int, *, now_ns: int) -> None:
        route.metric = metric
        if metric == route.told_metric:
            route.tell_ns = None  # a newer number alone is no news: the next full dump carries it
        elif route.told_metric >= 0:
            route.tell_ns = now_ns + min(MAX_SETTLING_NS, int(2 * route.settling_ns))

    # --- breaking ---------------------------------------------------------------------------------------------------

    def lose(self, neighbor: NodeId, *, now_ns: int) -> bool:
        """A link broke: every way over it is infinite, with the next odd number; says whether there was one."""
        over = [r for r in self._routes.values() if r.next_hop == neighbor and r.metric < INFINITE]
        for route in over:
            self._break(route, seq=following(route.seq), now_ns=now_ns)
        return bool(over)

    def _break(self, route: Route, *, seq: int, now_ns: int) -> None:
        route.metric, route.seq, route.renewed_ns, route.tell_ns = INFINITE, seq, now_ns, now_ns

    def tidy(self, now_ns: int) -> None:
        """Ways that nobody renews are broken; broken ones are forgotten after as long."""
        for destination in sorted(self._routes):
            route = self._routes[destination]
            if route.renewed_ns + HOLD_NS <= now_ns:
                if route.metric == INFINITE:
                    del self._routes[destination]
                else:
                    self._break(route, seq=following(route.seq), now_ns=now_ns)

    # --- telling ----------------------------------------------------------------------------------------------------

    def next_news_ns(self) -> int | None:
        news = [route.tell_ns for route in self._routes.values() if route.tell_ns is not None]
        if self.tell_own_ns is not None:
            news.append(self.tell_own_ns)
        return min(news, default=None)

    def full(self) -> list[Advertised]:
        """Every route; our own number grows first."""
        self.seq = following(self.seq, step=2)
        return [self._own(), *(self._tell(destination) for destination in sorted(self._routes))]

    def news(self, now_ns: int) -> list[Advertised]:
        """What is due to be told, after ourselves."""
        due = [
            n for n in sorted(self._routes) if (tell_ns := self._routes[n].tell_ns) is not None and tell_ns <= now_ns
        ]
        return [self._own(), *(self._tell(destination) for destination in due)]

    def _own(self) -> Advertised:
        self.tell_own_ns = None
        return Advertised(self._node, 0, self.seq)

    def _tell(self, destination: NodeId) -> Advertised:
        route = self._routes[destination]
        route.told_metric, route.tell_ns = route.metric, None
        return Advertised(destination, route.metric, route.seq)
