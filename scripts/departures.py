"""What ns-3's AODV and OLSR do otherwise than the RFCs and we, one departure at a time, and its effect on the rivals.

Each departure is a protocol with one rule changed to what ns-3's source does; `all` changes all of them. None of them
is part of the product, and all may look inside it. The table is that of `scripts/rivals.py`.

    PYTHONPATH=. python scripts/departures.py --protocols aodv --speeds 0 --seeds 1 2 3 4
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Final
from unittest.mock import patch

from fanet_mw import routing
from fanet_mw.bus.messages import Reception, TxOutcome
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.aodv import Aodv
from fanet_mw.routing.aodv import parameters as p
from fanet_mw.routing.aodv.messages import RREP, RouteReply, RouteRequest
from fanet_mw.routing.aodv.table import AodvRoute, AodvTable
from fanet_mw.routing.olsr import Olsr
from fanet_mw.routing.olsr import parameters as olsr
from fanet_mw.serial_number import later
from fanet_mw.units import BROADCAST, MS, NodeId
from scripts.rivals import COLUMNS, row


class Hellos(Aodv):
    """Every node says hello, on an active route or not, beginning within 0.1 s of each other (RFC 3561, 6.9)."""

    def start(self, now_ns: int) -> None:
        self._broadcast_ns = -1
        self._hello_ns = now_ns + int(self._random() * 100 * MS)

    def _send_hello(self, now_ns: int) -> None:
        since_ns = now_ns - self._broadcast_ns if self._broadcast_ns >= 0 else 0
        if not since_ns:
            node = self._port.node
            hello = RouteReply(0, node, self._seq, node, p.NEIGHBOR_LIFETIME_NS // MS)
            self._broadcast(RREP, hello.encode(), ttl=1, now_ns=now_ns)
        self._hello_ns = now_ns + max(1, p.HELLO_INTERVAL_NS - since_ns)
        self._broadcast_ns = -1


class StaleTable(AodvTable):
    """A route that broke keeps its sequence number, so a node that has not heard of it may answer with it."""

    def invalidate(self, route: AodvRoute, *, now_ns: int, seq: int | None = None) -> None:
        route.active = False
        route.ends_ns = now_ns + p.DELETE_PERIOD_NS


class Stale(Aodv):
    """Sequence numbers do not grow where a link breaks (RFC 3561, 6.11: they must)."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._table = StaleTable()


class Reverse(Aodv):
    """A RREQ replaces the reverse route whatever its sequence number and hop count (RFC 3561, 6.2: only if newer)."""

    def _on_request(self, request: RouteRequest, ttl: int, previous: NodeId, *, now_ns: int) -> None:
        known = self._table.entry(NodeId(request.originator), now_ns=now_ns)
        seen = (request.originator, request.rreq_id) in self._requests._ends_ns  # noqa: SLF001
        ignored = self._blacklist.get(previous, now_ns) > now_ns or request.originator == self._port.node
        if known is not None and not seen and not ignored:
            known.seq = later(known.seq, request.originator_seq)
            hops = request.hop_count + 1
            self._table._point(known, next_hop=previous, hops=hops, ends_ns=now_ns)  # noqa: SLF001
        super()._on_request(request, ttl, previous, now_ns=now_ns)


class Loop(Aodv):
    """A RREQ is not passed on that comes from the next hop of a route, even of one that is broken or expired."""

    _previous = NodeId(0)

    def _on_request(self, request: RouteRequest, ttl: int, previous: NodeId, *, now_ns: int) -> None:
        self._previous = previous
        super()._on_request(request, ttl, previous, now_ns=now_ns)

    def _pass_on(self, request: RouteRequest, *, hops: int, ttl: int, now_ns: int) -> None:
        known = self._table.entry(NodeId(request.destination), now_ns=now_ns)
        if known is None or known.next_hop != self._previous:
            super()._pass_on(request, hops=hops, ttl=ttl, now_ns=now_ns)


class Trusting(Aodv):
    """A neighbor to which data was forwarded counts as heard for 3 s, whether it was or not."""

    def _route_transit(self, packet: Packet, reception: Reception, *, start_ns: int, now_ns: int) -> None:
        super()._route_transit(packet, reception, start_ns=start_ns, now_ns=now_ns)
        route = self._table.active(NodeId(packet.header.destination), now_ns=now_ns)
        if route is not None:
            ends_ns = self._hellos._ends_ns  # noqa: SLF001
            for neighbor in (route.next_hop, reception.src):
                ends_ns[neighbor] = max(ends_ns.get(neighbor, 0), now_ns + p.ACTIVE_ROUTE_TIMEOUT_NS)


class Unlisted(Aodv):
    """No blacklist: ns-3 sets the timer of its RREP-ACK, but never starts it (RFC 3561, 6.8)."""

    def _on_control_failure(self, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        super()._on_control_failure(next_hop, outcome, now_ns=now_ns)
        self._blacklist.clear()


class Patient(Aodv):
    """Packets that wait are sent when a RREP or the end of a ring comes, not by any other news of a route."""

    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        self._answered = number == RREP and not RouteReply.decode(body).is_hello
        super()._on_control(number, body, packet, reception, now_ns=now_ns)

    def wake(self, now_ns: int) -> None:
        self._answered = bool(self._discovery.due(now_ns))
        super().wake(now_ns)

    def _release(self, now_ns: int) -> None:
        if self._answered:
            super()._release(now_ns)


class AllOfAodv(Hellos, Stale, Reverse, Loop, Trusting, Unlisted, Patient):
    """Every departure of AODV at once."""


class Circling(Olsr):
    """A data packet that comes back is routed on, as IP does, until its hops are used up."""

    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        self._port.forget(packet)
        super()._route_own(packet, start_ns=start_ns, now_ns=now_ns)


class Periodic(Olsr):
    """Messages are made every interval, not sooner by a jitter, and held back by one (RFC 3626, 18.1)."""

    def start(self, now_ns: int) -> None:
        self._hello_ns = self._tc_ns = now_ns

    def _next(self, now_ns: int, interval_ns: int) -> int:
        return now_ns + interval_ns

    def _send_control(
        self, number: int, body: bytes, *, start_ns: int, now_ns: int, to: NodeId = BROADCAST, ttl: int = 1
    ) -> None:
        late_ns = self._jittered(now_ns, olsr.MAXJITTER_NS)
        super()._send_control(number, body, start_ns=late_ns, now_ns=now_ns, to=to, ttl=ttl)


class AllOfOlsr(Circling, Periodic):
    """Every departure of OLSR at once."""


DEPARTURES: Final[Mapping[str, Mapping[str, type[Any]]]] = {
    "aodv": {
        "none": Aodv,
        "hellos": Hellos,
        "stale": Stale,
        "reverse": Reverse,
        "loop": Loop,
        "trusting": Trusting,
        "unlisted": Unlisted,
        "patient": Patient,
        "all": AllOfAodv,
    },
    "olsr": {"none": Olsr, "circling": Circling, "periodic": Periodic, "all": AllOfOlsr},
}


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description="Run the rivals with what ns-3 does otherwise, and print their table.")
    parser.add_argument("--protocols", nargs="+", default=list(DEPARTURES), choices=list(DEPARTURES))
    parser.add_argument("--only", nargs="+", help="these departures instead of all")
    parser.add_argument("--speeds", nargs="+", type=float, default=[0.0, 10.0])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="further scenario keys")
    chosen = parser.parse_args(arguments)
    sys.stdout.write(f"| departure | {' | '.join(COLUMNS)} |\n|{'---|' * (len(COLUMNS) + 1)}\n")
    for protocol in chosen.protocols:
        for name, changed in DEPARTURES[protocol].items():
            if chosen.only and name not in chosen.only:
                continue
            with patch.object(routing, "maker_of", lambda _, changed=changed: changed):
                for speed in chosen.speeds:
                    sys.stdout.write(f"| {name} {row(protocol, speed, chosen.seeds, chosen.set)}\n")
                    sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
