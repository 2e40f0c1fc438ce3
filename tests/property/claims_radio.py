"""Real nodes over a radio that is a graph: what one sends, its neighbors hear, unless lost by lot. No MAC.

Hellos come once a second at a phase of each node's own; frames arrive as long after their start as they are long.
"""

import heapq
from collections import Counter
from collections.abc import Callable
from itertools import count

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.graph.topology import symmetric
from fanet_mw.node.node import Node
from fanet_mw.rng import stream
from fanet_mw.routing import make_protocol
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S

AIRTIME_NS = 900 * US


class GraphRadio:
    """A swarm, and time."""

    def __init__(self, scenario: Scenario, *, seed: int = 1) -> None:
        self.scenario = scenario
        self.now_ns = 0
        self.loss = 0.0
        self.nodes: dict[NodeId, Node] = {}
        self.links: dict[NodeId, set[NodeId]] = {}
        self.frames = 0
        self.sent: list[tuple[int, NodeId, wire.Header]] = []
        self.delivered: Counter[tuple[int, int, int]] = Counter()
        self._random = stream(seed, "graph_radio").random
        self._heap: list[tuple[int, int, Callable[[], None]]] = []
        self._order = count()

    @property
    def adjacency(self) -> dict[NodeId, tuple[NodeId, ...]]:
        return symmetric(self.links)

    def join(self, node: int, *neighbors: int) -> Node:
        made = Node(NodeId(node), self.scenario, make_protocol, position=Enu(0, 0, 50))
        self.nodes[made.node] = made
        self.links[made.node] = set()
        for other in neighbors:
            self.link(node, other)
        made.start(self.now_ns)
        self._at(self.now_ns + int(self._random() * S), lambda: self._hello(made))
        return made

    def leave(self, node: int) -> None:
        del self.nodes[NodeId(node)]
        del self.links[NodeId(node)]
        for neighbors in self.links.values():
            neighbors.discard(NodeId(node))

    def link(self, a: int, b: int) -> None:
        self.links[NodeId(a)].add(NodeId(b))
        self.links[NodeId(b)].add(NodeId(a))

    def cut(self, a: int, b: int) -> None:
        self.links[NodeId(a)].discard(NodeId(b))
        self.links[NodeId(b)].discard(NodeId(a))

    def send(self, node: int, *, priority: int = wire.PRIORITY_BULK, size: int = 100) -> int:
        sender = self.nodes[NodeId(node)]
        seq = sender.send(
            wire.filler(size), destination=BROADCAST, priority=priority, app="traffic",
            born_ns=self.now_ns, now_ns=self.now_ns,
        )  # fmt: skip
        self._drain(sender)
        return seq

    def run(self, duration_ns: int) -> None:
        end_ns = self.now_ns + duration_ns
        while True:
            wakes = [(t, n) for n, node in self.nodes.items() if (t := node.next_wake_ns()) is not None]
            wake_ns, who = min(wakes, default=(end_ns + 1, NodeId(0)))
            if min(wake_ns, self._heap[0][0] if self._heap else wake_ns) > end_ns:
                break
            if self._heap and self._heap[0][0] <= wake_ns:
                self.now_ns, _, action = heapq.heappop(self._heap)
                action()
            else:
                self.now_ns = max(self.now_ns, wake_ns)
                self.nodes[who].wake(self.now_ns)
                self._drain(self.nodes[who])
        self.now_ns = end_ns

    def _at(self, t_ns: int, action: Callable[[], None]) -> None:
        heapq.heappush(self._heap, (t_ns, next(self._order), action))

    def _hello(self, node: Node) -> None:
        if self.nodes.get(node.node) is node:
            node.say_hello(b"", start_ns=self.now_ns, now_ns=self.now_ns)
            self._drain(node)
            self._at(self.now_ns + S, lambda: self._hello(node))

    def _drain(self, node: Node) -> None:
        for request in node.requests:
            self._at(max(self.now_ns, request.start_ns), lambda request=request: self._start(node, request))
        node.requests.clear()
        for record in node.records:
            if isinstance(record, Delivered):
                self.delivered[record.node, record.origin, record.seq] += 1
        node.records.clear()
        node.deliveries.clear()

    def _start(self, node: Node, request: TxRequest) -> None:
        self.frames += 1
        assert len(request.frame) <= self.scenario.radio.max_frame_bytes
        for packet in wire.unbundle(request.frame):
            self.sent.append((self.now_ns, node.node, wire.decode_header(packet)))
        heard = [
            other
            for other in sorted(self.links.get(node.node, ()))
            if request.dst in (BROADCAST, other) and self._random() >= self.loss
        ]
        end_ns = self.now_ns + AIRTIME_NS
        self._at(end_ns, lambda: self._end(node, request, heard, end_ns))

    def _end(self, node: Node, request: TxRequest, heard: list[NodeId], end_ns: int) -> None:
        for other in heard:
            if other in self.nodes:
                self.nodes[other].hear(Reception(request.frame, node.node, end_ns, -60.0), now_ns=self.now_ns)
                self._drain(self.nodes[other])
        if request.wants_status and self.nodes.get(node.node) is node:
            outcome = TxOutcome.ACKED if heard else TxOutcome.RETRY_LIMIT
            node.on_status(TxStatus(request.seq, outcome, end_ns, 1), now_ns=self.now_ns)
            self._drain(node)


__all__ = ["AIRTIME_NS", "MS", "GraphRadio"]
