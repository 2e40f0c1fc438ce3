"""AODV at one node (RFC 3561): a route is requested when it is needed, and its users are reported when it breaks.

    needed  -> RREQ floods, ring by ring -> the destination, or a node with a route, answers RREP along the reverse way
    used    -> the route, its reverse and both next hops stay active
    broken  -> (unicast not acknowledged, or hellos gone) -> RERR to the precursors

Broadcast data is flooded, by each node once after U(0, `routing.jitter_ms`), and so are RREQs. Not modeled: local
repair (6.12, optional), multicast, gateways, RREP-ACK (the MAC acknowledges), the quiet time after a reboot (6.13).
"""

from collections.abc import Mapping
from typing import ClassVar

from fanet_mw.bus.messages import Reception, TxOutcome
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.aodv import parameters as p
from fanet_mw.routing.aodv.discovery import Discovery, RateLimit, RouteSearch, SeenRequests
from fanet_mw.routing.aodv.messages import (
    DESTINATION_ONLY,
    GRATUITOUS,
    RERR,
    RREP,
    RREQ,
    UNKNOWN_SEQUENCE,
    RouteError,
    RouteReply,
    RouteRequest,
    Unreachable,
    most_unreachable,
)
from fanet_mw.routing.aodv.parameters import NEIGHBOR_LIFETIME_NS
from fanet_mw.routing.aodv.table import AodvRoute, AodvTable
from fanet_mw.routing.hop_by_hop import HopByHop
from fanet_mw.routing.rival_control_messages import Family
from fanet_mw.serial_number import following, later, newer
from fanet_mw.units import BROADCAST, MS, NodeId, earliest


class HelloNeighbors:
    """The neighbors that have sent a hello, and until when each counts as present."""

    def __init__(self) -> None:
        self._ends_ns: dict[NodeId, int] = {}
        self._check_ns: int | None = None
        """No neighbor is lost before this instant: a lower bound, so that a packet from a neighbor costs nothing."""

    def on_hello(self, neighbor: NodeId, *, now_ns: int) -> None:
        self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS
        if self._check_ns is None:
            self._check_ns = now_ns + NEIGHBOR_LIFETIME_NS

    def on_packet(self, neighbor: NodeId, *, now_ns: int) -> None:
        """Prolong a neighbor that has sent a hello at some time, because a packet came from it."""
        if neighbor in self._ends_ns:
            self._ends_ns[neighbor] = now_ns + NEIGHBOR_LIFETIME_NS

    def forget(self, neighbor: NodeId) -> None:
        self._ends_ns.pop(neighbor, None)

    def lost(self, now_ns: int) -> list[NodeId]:
        """Remove and return the neighbors that have been silent for too long."""
        if self._check_ns is None or now_ns < self._check_ns:
            return []
        gone = [node for node in sorted(self._ends_ns) if self._ends_ns[node] <= now_ns]
        for node in gone:
            del self._ends_ns[node]
        self._check_ns = min(self._ends_ns.values(), default=None)
        return gone

    def next_ns(self) -> int | None:
        return self._check_ns


class Aodv(HopByHop):
    """Ad hoc on-demand distance vector routing."""

    family: ClassVar[Family] = Family.AODV

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._table = AodvTable()
        self._discovery = Discovery()
        self._requests = SeenRequests()
        self._hellos = HelloNeighbors()
        self._rreq_limit = RateLimit(p.RREQ_RATELIMIT)
        self._rerr_limit = RateLimit(p.RERR_RATELIMIT)
        self._blacklist: dict[NodeId, int] = {}
        """Neighbors that have not acknowledged a unicast RREP or RERR, and until when their RREQs are ignored (6.8)."""
        self._most_unreachable = most_unreachable(control.capacity(port.scenario.radio.max_frame_bytes))
        self._seq = 0
        self._rreq_id = 0
        self._hello_ns: int | None = None
        self._broadcast_ns = -p.HELLO_INTERVAL_NS
        """The instant at which this node last sent a broadcast, which takes the place of a hello (6.9)."""
        self._in_use_until_ns = -1

    def start(self, now_ns: int) -> None:
        self._hello_ns = now_ns + int(self._random() * p.HELLO_INTERVAL_NS)

    # --- data -----------------------------------------------------------------------------------------------------

    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        destination = NodeId(packet.header.destination)
        route = self._table.active(destination, now_ns=now_ns)
        if route is not None:
            self._use(route, now_ns=now_ns)
            self._send(packet, route.next_hop, start_ns=start_ns, now_ns=now_ns)
            return
        self._room.push(packet, now_ns=now_ns)
        self._search(destination, now_ns=now_ns)

    def _route_transit(self, packet: Packet, reception: Reception, *, start_ns: int, now_ns: int) -> None:
        self._hellos.on_packet(reception.src, now_ns=now_ns)
        destination = NodeId(packet.header.destination)
        route = self._table.active(destination, now_ns=now_ns)
        if route is None:
            self._port.drop(DropReason.NO_ROUTE, packet, now_ns=now_ns)
            self._report_no_route(destination, reception.src, now_ns=now_ns)
            return
        self._use(route, now_ns=now_ns)
        self._keep(packet.origin, reception.src, now_ns=now_ns)
        self._send(packet, route.next_hop, start_ns=start_ns, now_ns=now_ns)

    def _on_arrival(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        self._hellos.on_packet(reception.src, now_ns=now_ns)
        self._keep(packet.origin, reception.src, now_ns=now_ns)

    def _use(self, route: AodvRoute, *, now_ns: int) -> None:
        """Keep this route and the route to its next hop active, because a data packet uses them (6.2)."""
        self._keep(route.destination, route.next_hop, now_ns=now_ns)

    def _keep(self, far: NodeId, near: NodeId, *, now_ns: int) -> None:
        ends_ns = self._in_use_until_ns = now_ns + p.ACTIVE_ROUTE_TIMEOUT_NS
        self._table.extend(self._table.active(far, now_ns=now_ns), ends_ns=ends_ns)
        if near != far:
            self._table.extend(self._table.active(near, now_ns=now_ns), ends_ns=ends_ns)

    def _on_failure(self, packet: Packet, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        self._drop_failed(packet, outcome, now_ns=now_ns)
        if outcome is TxOutcome.RETRY_LIMIT:
            self._link_broke(next_hop, now_ns=now_ns)

    # --- route discovery ------------------------------------------------------------------------------------------

    def _search(self, destination: NodeId, *, now_ns: int) -> None:
        if destination in self._discovery:
            return
        known = self._table.entry(destination, now_ns=now_ns)
        search = self._discovery.begin(destination, last_hops=known.hops if known else None, now_ns=now_ns)
        self._ask(search, now_ns=now_ns)

    def _ask(self, search: RouteSearch, *, now_ns: int) -> None:
        """Originate a RREQ (6.3), or wait until the rate limit allows it."""
        free_ns = self._rreq_limit.free_ns(now_ns)
        if free_ns > now_ns:
            search.due_ns = free_ns
            return
        self._rreq_limit.count(now_ns)
        self._seq = following(self._seq)
        self._rreq_id = following(self._rreq_id)
        known = self._table.entry(search.destination, now_ns=now_ns)
        seq_known = known is not None and known.seq_valid
        request = RouteRequest(
            flags=GRATUITOUS | (0 if seq_known else UNKNOWN_SEQUENCE),
            hop_count=0,
            rreq_id=self._rreq_id,
            destination=search.destination,
            destination_seq=known.seq if known is not None and known.seq_valid else 0,
            originator=self._port.node,
            originator_seq=self._seq,
        )
        self._requests.is_new(self._port.node, self._rreq_id, now_ns=now_ns)
        self._broadcast(RREQ, request.encode(), ttl=search.ttl, now_ns=now_ns)
        search.sent(now_ns)

    def _repeat(self, search: RouteSearch, *, now_ns: int) -> None:
        """A search has had no answer in time: widen it, or give it up (6.3)."""
        if search.exhausted:
            self._discovery.end(search.destination)
            for packet in self._room.take(search.destination):
                self._port.drop(DropReason.NO_ROUTE, packet, now_ns=now_ns)
            return
        if search.asked:
            search.widen()
        self._ask(search, now_ns=now_ns)

    def _release(self, now_ns: int) -> None:
        """Send the packets that wait for routes that have become known."""
        for destination in self._discovery.wanted():
            route = self._table.active(destination, now_ns=now_ns)
            if route is None:
                continue
            self._discovery.end(destination)
            for packet in self._room.take(destination):
                self._use(route, now_ns=now_ns)
                self._send(packet, route.next_hop, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    # --- control --------------------------------------------------------------------------------------------------

    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        previous = reception.src
        if number == RREQ:
            self._on_request(RouteRequest.decode(body), packet.header.hop_limit, previous, now_ns=now_ns)
        elif number == RREP:
            reply = RouteReply.decode(body)
            if reply.is_hello:
                self._on_hello(reply, previous, now_ns=now_ns)
            else:
                self._on_reply(reply, packet.header.hop_limit, previous, now_ns=now_ns)
        elif number == RERR:
            self._on_error(RouteError.decode(body), previous, now_ns=now_ns)
        else:
            raise MalformedFrameError(f"AODV message {number}")
        self._hellos.on_packet(previous, now_ns=now_ns)
        self._release(now_ns)

    def _neighbor(self, node: NodeId, *, now_ns: int) -> None:
        self._table.learn_neighbor(node, ends_ns=now_ns + p.ACTIVE_ROUTE_TIMEOUT_NS, now_ns=now_ns)

    def _on_request(self, request: RouteRequest, ttl: int, previous: NodeId, *, now_ns: int) -> None:
        """Handle a RREQ (6.5): set up the reverse route, then answer, or relay it to the next ring."""
        if self._blacklist.get(previous, now_ns) > now_ns or request.originator == self._port.node:
            return
        self._neighbor(previous, now_ns=now_ns)
        if not self._requests.is_new(request.originator, request.rreq_id, now_ns=now_ns):
            return
        hops = request.hop_count + 1
        least_ns = now_ns + 2 * p.NET_TRAVERSAL_TIME_NS - 2 * hops * p.NODE_TRAVERSAL_TIME_NS
        originator = NodeId(request.originator)
        self._table.offer(
            originator, seq=request.originator_seq, hops=hops, next_hop=previous, ends_ns=least_ns, now_ns=now_ns
        )
        self._table.extend(self._table.active(originator, now_ns=now_ns), ends_ns=least_ns)
        if request.destination == self._port.node:
            self._answer(request, now_ns=now_ns)
            return
        route = self._table.active(NodeId(request.destination), now_ns=now_ns)
        if route is not None and self._may_answer_for(route, request):
            if route.next_hop != previous:  # otherwise the node that asks is the next hop and knows better
                self._answer_for(route, request, now_ns=now_ns)
        elif ttl > 1:
            self._pass_on(request, hops=hops, ttl=ttl - 1, now_ns=now_ns)

    def _pass_on(self, request: RouteRequest, *, hops: int, ttl: int, now_ns: int) -> None:
        known = self._table.entry(NodeId(request.destination), now_ns=now_ns)
        flags, seq = request.flags, request.destination_seq
        if known is not None and known.seq_valid:
            seq = known.seq if flags & UNKNOWN_SEQUENCE else later(known.seq, seq)
            flags &= ~UNKNOWN_SEQUENCE
        onward = request._replace(flags=flags, hop_count=hops, destination_seq=seq)
        self._broadcast(RREQ, onward.encode(), ttl=ttl, now_ns=now_ns)

    def _may_answer_for(self, route: AodvRoute, request: RouteRequest) -> bool:
        """True if a route is at least as new as the request asks, so that an intermediate node may answer (6.6)."""
        if request.flags & DESTINATION_ONLY or not route.seq_valid:
            return False
        return bool(request.flags & UNKNOWN_SEQUENCE) or not newer(request.destination_seq, route.seq)

    def _answer(self, request: RouteRequest, *, now_ns: int) -> None:
        """Answer as the destination (6.6.1)."""
        if not request.flags & UNKNOWN_SEQUENCE:
            self._seq = later(request.destination_seq, self._seq)
        reply = RouteReply(0, self._port.node, self._seq, request.originator, p.MY_ROUTE_TIMEOUT_NS // MS)
        self._send_reply(reply, NodeId(request.originator), now_ns=now_ns)

    def _answer_for(self, route: AodvRoute, request: RouteRequest, *, now_ns: int) -> None:
        """Answer as a node that has a route (6.6.2), and tell the destination of the originator (6.6.3)."""
        reverse = self._table.active(NodeId(request.originator), now_ns=now_ns)
        if reverse is None:
            return  # the reverse route has expired at once, which only hostile hop counts bring about
        route.precursors[reverse.next_hop] = None
        reverse.precursors[route.next_hop] = None
        left_ms = (route.ends_ns - now_ns) // MS
        reply = RouteReply(min(route.hops, 254), route.destination, route.seq, request.originator, left_ms)
        self._send_reply(reply, reverse.destination, now_ns=now_ns)
        if request.flags & GRATUITOUS:
            left_ms = (reverse.ends_ns - now_ns) // MS
            hops = min(reverse.hops, 254)
            gratuitous = RouteReply(hops, request.originator, request.originator_seq, request.destination, left_ms)
            self._send_reply(gratuitous, route.destination, now_ns=now_ns)

    def _send_reply(self, reply: RouteReply, towards: NodeId, *, now_ns: int, ttl: int = p.NET_DIAMETER) -> None:
        route = self._table.active(towards, now_ns=now_ns)
        if route is not None:
            self._keep(towards, route.next_hop, now_ns=now_ns)
            self._send_control(
                RREP, reply.encode(), start_ns=now_ns + self._lead_ns, now_ns=now_ns, to=route.next_hop, ttl=ttl
            )

    def _on_reply(self, reply: RouteReply, ttl: int, previous: NodeId, *, now_ns: int) -> None:
        """Handle a RREP (6.7): set up the forward route, and pass the reply on towards the originator."""
        self._neighbor(previous, now_ns=now_ns)
        if reply.destination == self._port.node:
            return  # a gratuitous reply about this node itself is forged
        hops, destination = reply.hop_count + 1, NodeId(reply.destination)
        ends_ns = now_ns + reply.lifetime_ms * MS
        self._table.offer(
            destination, seq=reply.destination_seq, hops=hops, next_hop=previous, ends_ns=ends_ns, now_ns=now_ns
        )
        originator = NodeId(reply.originator)
        forward = self._table.active(destination, now_ns=now_ns)
        if originator == self._port.node or forward is None or ttl <= 1:
            return
        reverse = self._table.active(originator, now_ns=now_ns)
        if reverse is None:
            return
        forward.precursors[reverse.next_hop] = None
        near = self._table.active(forward.next_hop, now_ns=now_ns)
        if near is not None:
            near.precursors[reverse.next_hop] = None
        self._send_reply(reply._replace(hop_count=hops), originator, now_ns=now_ns, ttl=ttl - 1)

    def _on_control_failure(self, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        if outcome is TxOutcome.RETRY_LIMIT:
            self._blacklist[next_hop] = now_ns + p.BLACKLIST_TIMEOUT_NS
            self._link_broke(next_hop, now_ns=now_ns)

    # --- hellos ---------------------------------------------------------------------------------------------------

    def _on_hello(self, reply: RouteReply, previous: NodeId, *, now_ns: int) -> None:
        if reply.destination != previous:
            raise MalformedFrameError(f"hello of {reply.destination} from {previous}")
        ends_ns = now_ns + p.NEIGHBOR_LIFETIME_NS
        self._table.learn_neighbor(previous, ends_ns=ends_ns, now_ns=now_ns, seq=reply.destination_seq)
        self._hellos.on_hello(previous, now_ns=now_ns)

    def _send_hello(self, now_ns: int) -> None:
        """Send a hello (6.9): only when part of an active route, and only without another broadcast meanwhile."""
        assert self._hello_ns is not None, "only a node that was started says hello"
        self._hello_ns = max(now_ns, self._hello_ns) + p.HELLO_INTERVAL_NS
        if self._broadcast_ns + p.HELLO_INTERVAL_NS > now_ns:
            self._hello_ns = self._broadcast_ns + p.HELLO_INTERVAL_NS
        elif self._in_use_until_ns > now_ns:
            node = self._port.node
            hello = RouteReply(0, node, self._seq, node, p.NEIGHBOR_LIFETIME_NS // MS)
            self._broadcast(RREP, hello.encode(), ttl=1, now_ns=now_ns)

    # --- broken links ---------------------------------------------------------------------------------------------

    def _link_broke(self, neighbor: NodeId, *, now_ns: int) -> None:
        """End every active route over this neighbor, and tell the nodes that used them (6.11, case i)."""
        self._hellos.forget(neighbor)
        broken = self._table.over(neighbor, now_ns=now_ns)
        for route in broken:
            self._table.invalidate(route, now_ns=now_ns)
        self._report_broken(broken, now_ns=now_ns)

    def _report_no_route(self, destination: NodeId, asker: NodeId, *, now_ns: int) -> None:
        """Report a missing route to the neighbor that has sent data for it, and which is the precursor (6.11, ii)."""
        known = self._table.entry(destination, now_ns=now_ns)
        seq = 0
        if known is not None:
            self._table.invalidate(known, now_ns=now_ns)
            seq = known.seq
        self._send_error([Unreachable(destination, seq)], asker, now_ns=now_ns)

    def _on_error(self, error: RouteError, previous: NodeId, *, now_ns: int) -> None:
        """Handle a RERR (6.11, case iii): end the routes over a neighbor that it has lost."""
        broken = []
        for destination, seq in error.unreachable:
            route = self._table.active(NodeId(destination), now_ns=now_ns)
            if route is not None and route.next_hop == previous:
                self._table.invalidate(route, now_ns=now_ns, seq=seq)
                broken.append(route)
        self._report_broken(broken, now_ns=now_ns)

    def _report_broken(self, broken: list[AodvRoute], *, now_ns: int) -> None:
        """Send a RERR about the routes that have precursors: unicast to a single precursor, else broadcast (6.11)."""
        reported = [route for route in broken if route.precursors]
        precursors = sorted({node for route in reported for node in route.precursors})
        if reported:
            to = precursors[0] if len(precursors) == 1 else BROADCAST
            self._send_error([Unreachable(route.destination, route.seq) for route in reported], to, now_ns=now_ns)

    def _send_error(self, unreachable: list[Unreachable], to: NodeId, *, now_ns: int) -> None:
        if self._rerr_limit.free_ns(now_ns) > now_ns:
            return
        self._rerr_limit.count(now_ns)
        body = RouteError(tuple(unreachable[: self._most_unreachable])).encode()
        if to == BROADCAST:
            self._broadcast(RERR, body, ttl=1, now_ns=now_ns)
        else:
            self._send_control(RERR, body, start_ns=now_ns + self._lead_ns, now_ns=now_ns, to=to)

    def _broadcast(self, number: int, body: bytes, *, ttl: int, now_ns: int) -> None:
        """Send a broadcast after a jitter, because neighbors that received the same must not answer at once."""
        self._broadcast_ns = now_ns
        self._send_control(number, body, start_ns=self._jittered(now_ns, self._jitter_ns), now_ns=now_ns, ttl=ttl)

    # --- time -----------------------------------------------------------------------------------------------------

    def _due_ns(self) -> int | None:
        return earliest(self._hello_ns, self._discovery.next_ns(), self._hellos.next_ns(), self._room.next_end_ns())

    def _on_wake(self, now_ns: int) -> None:
        self._room.expire(now_ns=now_ns)
        for neighbor in self._hellos.lost(now_ns):
            self._link_broke(neighbor, now_ns=now_ns)
        self._release(now_ns)
        for search in self._discovery.due(now_ns):
            self._repeat(search, now_ns=now_ns)
        if self._hello_ns is not None and now_ns >= self._hello_ns:
            self._send_hello(now_ns)

    # --- reporting ------------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        return {"control_sent": self.control_sent, "waiting": self.waiting(), "sequence": self._seq}
