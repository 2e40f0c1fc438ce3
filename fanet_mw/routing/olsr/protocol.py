"""OLSR at one node (RFC 3626): each node always knows the topology, and only chosen relays pass it on.

    HELLO (2 s, one hop)  -> links, 2-hop neighbors -> this node's multipoint relays, and the nodes that it relays for
    TC (5 s, flooded)     -> the links between relays and the nodes that chose them -> shortest paths to all nodes
    data                  -> the next hop of the routing table; without one it is dropped

Broadcast data is relayed by the nodes that the transmitter has chosen as MPRs, as TCs are (3.4.1). Not modeled: several
interfaces (MID), gateways (HNA), link hysteresis (14), TC redundancy (15), MPR coverage (16), link-layer notification
(13), all optional and off in ns-3 too. The node's duplicate set, by number instead of for DUP_HOLD_TIME, also stops
data that returns to a node.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar, Final, NamedTuple

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.graph.topology import Adjacency
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, is_used_up
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.hop_by_hop import HopByHop
from fanet_mw.routing.olsr import parameters as p
from fanet_mw.routing.olsr.messages import (
    HELLO,
    HELLO_HEAD,
    PER_NODE,
    TC,
    TC_HEAD,
    Hello,
    HelloNeighbor,
    LinkType,
    NeighborType,
    TopologyControl,
    encode_time,
)
from fanet_mw.routing.olsr.parameters import WILL_ALWAYS, WILL_DEFAULT, WILL_NEVER
from fanet_mw.routing.olsr.state import Repositories
from fanet_mw.routing.rival_control_messages import Family
from fanet_mw.serial_number import following
from fanet_mw.units import BROADCAST, NodeId, earliest


def multipoint_relays(node: NodeId, adjacency: Adjacency, *, willingness: Mapping[NodeId, int]) -> tuple[NodeId, ...]:
    """The relays of `node`, of which `adjacency` must hold it and its neighbors. As in the RFC: always willing ones;
    those that alone reach some node; then by willingness, nodes added, degree, lower id. Redundant ones are not
    dropped, an optional step.
    """
    will = {n: willingness.get(n, WILL_DEFAULT) for n in adjacency[node]}
    near = frozenset(adjacency[node])
    reach = {
        n: frozenset(m for m in adjacency[n] if m != node and m not in near)
        for n in adjacency[node]
        if will[n] != WILL_NEVER
    }
    relays = {n for n in reach if will[n] == WILL_ALWAYS}
    relays |= _only_ones(reach)
    missing = set().union(*reach.values()) if reach else set()
    for n in relays:
        missing -= reach[n]
    while missing:
        # The degree D(y) counts the neighbors of y other than `node` and its neighbors, which is the whole of `reach`.
        best = max(
            (n for n in reach if n not in relays and reach[n] & missing),
            key=lambda n: (will[n], len(reach[n] & missing), len(reach[n]), -n),
        )
        relays.add(best)
        missing -= reach[best]
    return tuple(sorted(relays))


def _only_ones(reach: Mapping[NodeId, frozenset[NodeId]]) -> set[NodeId]:
    through: dict[NodeId, list[NodeId]] = {}
    for n in reach:
        for far in sorted(reach[n]):
            through.setdefault(far, []).append(n)
    return {ways[0] for ways in through.values() if len(ways) == 1}


_HELLO_VTIME: Final = encode_time(p.NEIGHB_HOLD_TIME_NS)
_HELLO_HTIME: Final = encode_time(p.HELLO_INTERVAL_NS)
_TC_VTIME: Final = encode_time(p.TOP_HOLD_TIME_NS)


class _OlsrRoute(NamedTuple):
    """An entry of the routing table."""

    next_hop: NodeId
    hops: int


def routing_table(
    node: NodeId,
    neighbors: Mapping[NodeId, Sequence[NodeId]],
    willingness: Mapping[NodeId, int],
    topology: Sequence[tuple[NodeId, NodeId]],
) -> dict[NodeId, _OlsrRoute]:
    """The shortest known routes (10), `topology` by pairs (last hop, destination); ties by the lowest last hop."""
    routes = {neighbor: _OlsrRoute(neighbor, 1) for neighbor in sorted(neighbors)}
    for neighbor in sorted(neighbors):
        if willingness[neighbor] != p.WILL_NEVER:
            for far in neighbors[neighbor]:
                if far != node and far not in routes:
                    routes[far] = _OlsrRoute(neighbor, 2)
    onward: dict[NodeId, list[NodeId]] = {}
    for last, destination in topology:
        onward.setdefault(last, []).append(destination)
    ring, hops = [far for far in routes if routes[far].hops == 2], 2
    while ring:
        hops += 1
        wider: list[NodeId] = []
        for last in sorted(ring):
            for destination in onward.get(last, ()):
                if destination != node and destination not in routes:
                    routes[destination] = _OlsrRoute(routes[last].next_hop, hops)
                    wider.append(destination)
        ring = wider
    return routes


class Olsr(HopByHop):
    """Optimized link state routing."""

    family: ClassVar[Family] = Family.OLSR
    willingness: ClassVar[int] = p.WILL_DEFAULT

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._state = Repositories(port.node)
        self._capacity = control.capacity(port.scenario.radio.max_frame_bytes)
        self._hello_ns: int | None = None
        self._tc_ns: int | None = None
        self._ansn = 0
        self._advertised: list[NodeId] = []
        self._tc_until_ns = -1
        """A node whose last selector is gone advertises that until this instant, for TOP_HOLD_TIME (9.3)."""
        self._routes: dict[NodeId, _OlsrRoute] = {}
        self._routes_version = -1
        self._routes_end_ns = -1

    def start(self, now_ns: int) -> None:
        self._hello_ns = now_ns + int(self._random() * p.HELLO_INTERVAL_NS)
        self._tc_ns = now_ns + int(self._random() * p.TC_INTERVAL_NS)

    # --- data -------------------------------------------------------------------------------------------------------

    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        route = self._route(NodeId(packet.header.destination), now_ns=now_ns)
        if route is None:
            self._port.drop(DropReason.NO_ROUTE, packet, now_ns=now_ns)
        else:
            self._send(packet, route.next_hop, start_ns=start_ns, now_ns=now_ns)

    def _relays(self, packet: Packet, reception: Reception, *, now_ns: int) -> bool:
        return self.willingness != p.WILL_NEVER and self._state.is_selector(reception.src, now_ns=now_ns)

    def _route(self, destination: NodeId, *, now_ns: int) -> _OlsrRoute | None:
        """The entry of the routing table, which is computed anew when its inputs have changed (10)."""
        state = self._state
        if self._routes_version != state.version or now_ns > self._routes_end_ns:
            neighbors = {n: state.two_hop(n, now_ns=now_ns) for n in state.symmetric(now_ns=now_ns)}
            willingness = {n: state.willingness(n) for n in neighbors}
            self._routes = routing_table(self._port.node, neighbors, willingness, state.topology(now_ns=now_ns))
            self._routes_version = state.version
            self._routes_end_ns = state.next_change_ns(now_ns)
        return self._routes.get(destination)

    # --- control ----------------------------------------------------------------------------------------------------

    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        origin, sender = packet.origin, reception.src
        if origin == self._port.node:
            return  # the message is this node's own, from before a restart
        if number == HELLO:
            if origin != sender:
                raise MalformedFrameError(f"hello of {origin} from {sender}")
            self._state.on_hello(sender, Hello.decode(body), now_ns=now_ns)
        elif number == TC:
            self._topology(TopologyControl.decode(body), packet, sender, now_ns=now_ns)
        else:
            raise MalformedFrameError(f"OLSR message {number}")

    def _topology(self, tc: TopologyControl, packet: Packet, sender: NodeId, *, now_ns: int) -> None:
        """Handle a TC (9.5), then forward it by the default forwarding algorithm (3.4.1)."""
        if not self._state.is_symmetric(sender, now_ns=now_ns):
            self._port.forget(packet)  # this copy does not count as received: a symmetric neighbor may still bring one
            return
        self._state.on_tc(packet.origin, tc, now_ns=now_ns)
        if not is_used_up(packet.header) and self._state.is_selector(sender, now_ns=now_ns):
            self.control_sent += 1
            frame = self._port.forwarded(packet, flags=0)
            self._port.transmit(frame, BROADCAST, start_ns=self._jittered(now_ns, p.MAXJITTER_NS))

    def _multipoint_relays(self, now_ns: int) -> tuple[NodeId, ...]:
        """The multipoint relays of this node (8.3.1), without the optional step that drops redundant ones."""
        state, node = self._state, self._port.node
        neighbors = {n: tuple(state.two_hop(n, now_ns=now_ns)) for n in state.symmetric(now_ns=now_ns)}
        willingness = {n: state.willingness(n) for n in neighbors}
        return multipoint_relays(node, {**neighbors, node: tuple(neighbors)}, willingness=willingness)

    def _send_hello(self, now_ns: int) -> None:
        """Send hellos with every link (6.2), in as many messages as that takes."""
        state = self._state
        relays = frozenset(self._multipoint_relays(now_ns))
        neighbors = []
        for node in state.linked(now_ns=now_ns):
            link_type = state.link_of(node, now_ns=now_ns)
            assert link_type is not None, "linked nodes have a link"
            neighbor_type = (
                NeighborType.NOT if link_type is not LinkType.SYM
                else NeighborType.MPR if node in relays
                else NeighborType.SYM
            )  # fmt: skip
            neighbors.append(HelloNeighbor(link_type, neighbor_type, node))
        most = min(255, (self._capacity - HELLO_HEAD) // PER_NODE)
        for at in range(0, max(1, len(neighbors)), most):
            hello = Hello(_HELLO_VTIME, _HELLO_HTIME, self.willingness, tuple(neighbors[at : at + most]))
            self._send_control(HELLO, hello.encode(), start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def _send_topology(self, now_ns: int) -> None:
        """Send TCs with the nodes that have chosen this node as MPR (9.2, 9.3); a changed set has a new ANSN."""
        advertised = self._state.selectors(now_ns=now_ns)
        if advertised != self._advertised:
            self._ansn = following(self._ansn, bits=16)
            self._advertised = advertised
        if advertised:
            self._tc_until_ns = now_ns + p.TOP_HOLD_TIME_NS
        elif now_ns > self._tc_until_ns:
            return
        most = (self._capacity - TC_HEAD) // PER_NODE
        for at in range(0, max(1, len(advertised)), most):
            tc = TopologyControl(_TC_VTIME, self._ansn, tuple(advertised[at : at + most]))
            self._send_control(TC, tc.encode(), start_ns=now_ns + self._lead_ns, now_ns=now_ns, ttl=255)

    # --- time -------------------------------------------------------------------------------------------------------

    def _due_ns(self) -> int | None:
        return earliest(self._hello_ns, self._tc_ns)

    def _on_wake(self, now_ns: int) -> None:
        if self._hello_ns is not None and now_ns >= self._hello_ns:
            self._state.tidy(now_ns)
            self._send_hello(now_ns)
            self._hello_ns = self._next(now_ns, p.HELLO_INTERVAL_NS)
        if self._tc_ns is not None and now_ns >= self._tc_ns:
            self._send_topology(now_ns)
            self._tc_ns = self._next(now_ns, p.TC_INTERVAL_NS)

    def _next(self, now_ns: int, interval_ns: int) -> int:
        """The end of an interval, shortened by a jitter so that neighbors do not synchronize (18.1)."""
        return now_ns + interval_ns - int(self._random() * p.MAXJITTER_NS)

    # --- reporting --------------------------------------------------------------------------------------------------

    def report(self) -> Mapping[str, object]:
        return {"control_sent": self.control_sent, "waiting": self.waiting(), "routes": len(self._routes)}
