"""Nodes on a bench: real nodes and protocols, a radio of links instead of a medium, instants moved by hand.

A frame takes 1 ms. Broadcasts reach every linked node, unicasts the one they are for; without a link a unicast ends
with RETRY_LIMIT after 5 ms. Nothing collides. The test says which links stand, and may speak for absent nodes.
"""

import heapq
from typing import Any, NamedTuple

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId

AIRTIME_NS = 1 * MS
GIVE_UP_NS = 5 * MS


class Sent(NamedTuple):
    """A frame that went on the air."""

    t_ns: int
    node: int
    dst: int
    frame: bytes

    @property
    def header(self) -> wire.Header:
        return wire.decode_header(self.frame)


class Bench:
    """A few nodes and their links."""

    def __init__(self, scenario: Scenario, nodes: list[int], links: list[tuple[int, int]]) -> None:
        self.now_ns = 0
        self.nodes = {
            node: Node(NodeId(node), scenario, make_protocol, position=Enu(200.0 * node, 0.0, 50.0)) for node in nodes
        }
        self.links: set[tuple[int, int]] = set()
        for a, b in links:
            self.connect(a, b)
        self.sent: list[Sent] = []
        self.deliveries: list[tuple[int, int, int, int]] = []
        """(node, origin, seq, hops so far)."""
        self._events: list[tuple[int, int, int, Any]] = []
        self._order = 0
        self._forged_seq = 0x8001_0000
        for node in self.nodes.values():
            node.start(0)
        self._collect()

    # --- links ----------------------------------------------------------------------------------------------------

    def connect(self, a: int, b: int) -> None:
        self.links |= {(a, b), (b, a)}

    def cut(self, a: int, b: int) -> None:
        self.links -= {(a, b), (b, a)}

    def protocol(self, node: int) -> Any:
        return self.nodes[node]._protocol

    # --- what a test does -----------------------------------------------------------------------------------------

    def send(self, origin: int, destination: int = BROADCAST) -> int:
        """An application packet; returns its sequence number."""
        seq = self.nodes[origin].send(
            wire.filler(40), destination=NodeId(destination), priority=3, app="traffic",
            born_ns=self.now_ns, now_ns=self.now_ns,
        )  # fmt: skip
        self._collect()
        return seq

    def say(self, node: int, kind: int, body: bytes, *, to: int, ttl: int = 1, hops: int = 0, origin: int = 0) -> None:
        """Speak for a node that is not on the bench: a control message arrives at `to` now."""
        self._forged_seq += 1
        origin = origin or node
        hops = max(hops, int(origin != node))  # it has come by way of the node that speaks
        header = wire.Header(
            self.now_ns // US, self._forged_seq, origin, BROADCAST, node, wire.Kind.ROUTING, ttl, hops, 0, 0
        )
        self.hear(to, header.encode() + control.encode(kind, body, node=node), src=node)

    def hear(self, node: int, frame: bytes, *, src: int) -> None:
        """Bytes arrive at a node now."""
        self.nodes[node].hear(Reception(frame, NodeId(src), self.now_ns, -60.0), now_ns=self.now_ns)
        self._collect()

    def advance(self, by_ns: int) -> None:
        """Let time pass."""
        end_ns = self.now_ns + by_ns
        while True:
            wakes = [(t_ns, node) for node in self.nodes if (t_ns := self.nodes[node].next_wake_ns()) is not None]
            wake_ns, waker = min(wakes, default=(end_ns + 1, 0))
            event_ns = self._events[0][0] if self._events else end_ns + 1
            if min(wake_ns, event_ns) > end_ns:
                break
            if event_ns <= wake_ns:
                self.now_ns, _, node, message = heapq.heappop(self._events)
                self._happen(node, message)
            else:
                self.now_ns = max(self.now_ns, wake_ns)
                self.nodes[waker].wake(self.now_ns)
            self._collect()
        self.now_ns = end_ns

    def controls(self, number: int, *, node: int | None = None, since_ns: int = 0) -> list[tuple[Sent, bytes]]:
        """The control messages of one number that were on the air, with their bodies."""
        found = []
        for sent in self.sent:
            if sent.header.kind == wire.Kind.ROUTING and sent.t_ns >= since_ns and node in (None, sent.node):
                kind, body = control.decode(sent.frame)
                if kind & 0xF == number:
                    found.append((sent, body))
        return found

    def data(self, seq: int, origin: int) -> list[Sent]:
        """The transmissions of one data packet."""
        name = origin, seq
        return [s for s in self.sent if s.header.kind == wire.Kind.DATA and (s.header.origin, s.header.seq) == name]

    # --- the radio ------------------------------------------------------------------------------------------------

    def _collect(self) -> None:
        for node in sorted(self.nodes):
            core = self.nodes[node]
            for delivery in core.deliveries:
                self.deliveries.append((node, delivery.header.origin, delivery.header.seq, delivery.header.hops + 1))
            core.deliveries.clear()
            requests, core.requests[:] = list(core.requests), []
            for request in requests:
                assert request.start_ns >= self.now_ns, "nobody announces the past"
                self._push(request.start_ns, node, request)

    def _push(self, t_ns: int, node: int, message: Any) -> None:
        self._order += 1
        heapq.heappush(self._events, (t_ns, self._order, node, message))

    def _happen(self, node: int, message: Any) -> None:
        if isinstance(message, TxRequest):
            self._transmit(node, message)
        elif isinstance(message, Reception):
            self.nodes[node].hear(message, now_ns=self.now_ns)
        else:
            self.nodes[node].on_status(message, now_ns=self.now_ns)

    def _transmit(self, node: int, request: TxRequest) -> None:
        self.sent.append(Sent(self.now_ns, node, request.dst, request.frame))
        end_ns = self.now_ns + AIRTIME_NS
        heard = [b for b in sorted(self.nodes) if (node, b) in self.links and request.dst in (b, BROADCAST)]
        for other in heard:
            self._push(end_ns, other, Reception(request.frame, NodeId(node), end_ns, -60.0))
        if request.wants_status:
            linked = bool(heard) or (node, request.dst) in self.links
            outcome = TxOutcome.ACKED if linked else TxOutcome.RETRY_LIMIT
            ended_ns = end_ns if linked else self.now_ns + GIVE_UP_NS
            self._push(ended_ns, node, TxStatus(request.seq, outcome, ended_ns, 1 if linked else 7))
