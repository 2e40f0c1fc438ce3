"""Real nodes over the smallest radio that can be: a graph of who hears whom, and a loss per link. Deterministic.

A frame takes 1 ms; it reaches each neighbor with the link's probability. Unicasts are acknowledged when they arrive.
Not modelled: contention, collisions, airtime. What the swarm does over time is checked from the outside: no packet is
delivered twice anywhere, and none is relayed twice by one node in its flooding phase.
"""

import heapq
from collections import Counter
from collections.abc import Iterable
from itertools import count

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.node.node import Node
from fanet_mw.rng import stream
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.roles.assigned_roles import AssignedRoles
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S

_FLIGHT_NS = 1 * MS
_HELLO_NS = 1 * S


class Swarm:
    """Nodes, links and an event heap."""

    def __init__(self, scenario: Scenario, places: Iterable[Enu]) -> None:
        self.scenario = scenario
        self.now_ns = 0
        self.nodes: dict[NodeId, Node] = {}
        self.places = dict(zip(map(NodeId, scenario.node_ids), places, strict=True))
        self.loss = 0.0
        self.walls: set[frozenset[NodeId]] = set()
        """Pairs of nodes that do not hear each other although they are near."""
        self.relayed: Counter[tuple[int, int, int]] = Counter()
        self.delivered: Counter[tuple[int, int, int]] = Counter()
        """Times, by incarnation of a node (it starts again without memory), origin and sequence number."""
        self._boots: dict[NodeId, int] = {}
        self._random = stream(scenario.seed, "radio", 0).random
        self._order = count()
        self._heap: list[tuple[int, int, NodeId, Node, object]] = []
        """(instant, order, node, the incarnation it is for, what: a reception, a status, or None for a hello)."""

    # --- what happens to it ---------------------------------------------------------------------------------------

    def start(self, node: int) -> None:
        """Switch a node on, for the first time or again, without memory."""
        name = NodeId(node)
        fresh = Node(name, self.scenario, make_protocol, position=self.places[name])
        self.nodes[name] = fresh
        self._boots[name] = next(self._order)
        fresh.start(self.now_ns)
        self._push(self.now_ns + int(self._random() * _HELLO_NS), name, fresh, None)
        self._drain(name)

    def kill(self, node: int) -> None:
        del self.nodes[NodeId(node)]

    def move(self, node: int, place: Enu) -> None:
        self.places[NodeId(node)] = place
        if node in self.nodes:
            self.nodes[NodeId(node)].moved(place, Enu(0.0, 0.0, 0.0))

    def send(self, node: int) -> None:
        """A packet of the node's application, to everyone."""
        self.nodes[NodeId(node)].send(
            wire.filler(40, node=node), destination=BROADCAST, priority=wire.PRIORITY_BULK, app="traffic",
            born_ns=self.now_ns, now_ns=self.now_ns,
        )  # fmt: skip
        self._drain(NodeId(node))

    def advance(self, duration_ns: int) -> None:
        until_ns = self.now_ns + duration_ns
        while (t_ns := self._next_ns()) <= until_ns:
            self.now_ns = max(self.now_ns, t_ns)
            if self._heap and self._heap[0][0] <= t_ns:
                self._happen()
            for name in sorted(self.nodes):
                wake_ns = self.nodes[name].next_wake_ns() if name in self.nodes else None
                if wake_ns is not None and wake_ns <= self.now_ns:
                    self.nodes[name].wake(self.now_ns)
                    self._drain(name)
        self.now_ns = until_ns

    def _next_ns(self) -> int:
        wakes = [wake for node in self.nodes.values() if (wake := node.next_wake_ns()) is not None]
        events = [self._heap[0][0]] if self._heap else []
        return min(wakes + events, default=1 << 62)

    # --- the radio ------------------------------------------------------------------------------------------------

    def hear_each_other(self, a: NodeId, b: NodeId) -> bool:
        near = self.places[a].minus(self.places[b]).norm() <= self.scenario.radio.range_m
        return a != b and near and frozenset((a, b)) not in self.walls

    def neighbors(self, node: NodeId) -> list[NodeId]:
        return [other for other in sorted(self.nodes) if self.hear_each_other(node, other)]

    def _push(self, at_ns: int, name: NodeId, node: Node, what: object) -> None:
        heapq.heappush(self._heap, (at_ns, next(self._order), name, node, what))

    def _happen(self) -> None:
        t_ns, _, name, node, what = heapq.heappop(self._heap)
        if self.nodes.get(name) is not node:
            return  # it died meanwhile
        if isinstance(what, TxRequest):
            self._transmit(name, node, what)
        elif isinstance(what, Reception):
            node.hear(what, now_ns=t_ns)
        elif isinstance(what, TxStatus):
            node.on_status(what, now_ns=t_ns)
        else:
            node.say_hello(b"", start_ns=t_ns, now_ns=t_ns)
            self._push(t_ns + int(_HELLO_NS * (0.9 + 0.2 * self._random())), name, node, None)
        self._drain(name)

    def _drain(self, name: NodeId) -> None:
        node = self.nodes[name]
        requests = list(node.requests)
        node.requests.clear()
        for request in requests:
            self._push(max(self.now_ns, request.start_ns), name, node, request)
        for delivery in node.deliveries:
            self.delivered[self._boots[name], delivery.header.origin, delivery.header.seq] += 1
        node.deliveries.clear()
        node.records.clear()

    def _transmit(self, name: NodeId, node: Node, request: TxRequest) -> None:
        header, end_ns = wire.decode_header(request.frame), self.now_ns + _FLIGHT_NS
        if header.flags & wire.FLAG_FLOOD and header.kind != wire.Kind.SCHEDULE:
            self.relayed[self._boots[name], header.origin, header.seq] += 1
        reached = [n for n in self.neighbors(name) if request.dst in (BROADCAST, n) and self._random() >= self.loss]
        for other in reached:
            self._push(end_ns, other, self.nodes[other], Reception(request.frame, name, end_ns, -60.0))
        if request.wants_status:
            outcome = TxOutcome.ACKED if reached else TxOutcome.RETRY_LIMIT
            self._push(end_ns, name, node, TxStatus(request.seq, outcome, end_ns, 1))

    # --- what it should be ----------------------------------------------------------------------------------------

    def parts(self) -> list[list[NodeId]]:
        """The connected parts."""
        left, found = sorted(self.nodes), []
        while left:
            part, frontier = {left[0]}, [left[0]]
            while frontier:
                frontier = [n for at in frontier for n in self.neighbors(at) if n not in part and not part.add(n)]
            found.append(sorted(part))
            left = [node for node in left if node not in part]
        return found

    def protocol(self, node: NodeId) -> Clustered:
        protocol = self.nodes[node]._protocol
        assert isinstance(protocol, Clustered)
        return protocol

    def membership(self, node: NodeId) -> Membership:
        roles = self.protocol(node).parts.roles
        assert isinstance(roles, AssignedRoles)
        return roles.parts.membership

    def never_twice(self) -> None:
        """Whatever happens: nothing is delivered or relayed twice by one node."""
        assert max(self.delivered.values(), default=0) <= 1, "delivered twice"
        assert max(self.relayed.values(), default=0) <= 1, "relayed twice"

    def settled(self) -> list[str]:
        """What is not yet as it should be, in words."""
        wrong = []
        for part in self.parts():
            reports = {node: self.protocol(node).report() for node in part}
            leaders = sorted({(r["term"], r["leader"], r["epoch"]) for r in reports.values()})
            if len(leaders) > 1:
                wrong.append(f"{part} follow {leaders}")
            elif leaders[0][1] not in part:
                wrong.append(f"{part} follow {leaders[0][1]}, who is not among them")
            heads = [node for node in part if reports[node]["role"] == "head"]
            owned = Counter(reports[node]["cluster"] for node in heads)
            wrong += [f"{times} heads of slot {slot} in {part}" for slot, times in owned.items() if times > 1]
            for node in part:
                route = self.protocol(node).parts.gradient.route(now_ns=self.now_ns)
                if len(part) > 1 and node not in heads and (route is None or route.head not in heads):
                    wrong.append(f"{node} of {part} has no live head: {route}")
        return wrong
