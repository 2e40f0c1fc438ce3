"""Plans a swarm with claimed slots before take-off: which turns each node will have, and whether its load fits them.

    positions -> adjacency -> the protocol's own claims, run without losses -> slots, superframes, turns won by lot
              -> the protocol's own rule of relaying                        -> the load of each node

A relay transmits its own packets and those of all others, any other node only its own; every second hello takes a turn,
too. A turn that no node within two hops claims goes, on average, to each node that draws lots in proportion to its
lots. The plan is feasible if the load of each node fits the turns that it claims and wins. This is a statement about
rates: the end-to-end delay of packets that queue has no bound. A packet that meets no queue takes at most hops x
hop_ns.

The claims that nodes make in flight depend on when they start, but the lengths and numbers of claims hardly do.
"""

from collections.abc import Mapping, Sequence
from math import ceil, inf
from typing import Final, NamedTuple

from fanet_mw.bounds import TurnServer
from fanet_mw.graph.connected_dominating_set import dominates
from fanet_mw.graph.topology import Adjacency, two_hop
from fanet_mw.routing.clustered.claimed.own_turns import Share
from fanet_mw.routing.clustered.claimed.slot_acquisition import IDLE, LISTEN_HELLOS, geometry, longest_superframe
from fanet_mw.routing.clustered.claimed.slot_claims import SlotClaims
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, S, seconds_to_ns
from fanet_mw.wire.hello.claims import MOST_LOTS
from sim.planner.demand import TrafficClass

_ROUNDS: Final = 60
"""The number of hello intervals in which claims converge; 2 d + 6 are needed, with d the length of the longest chain of
rivals."""
_HELLOS_IN_TURNS: Final = 0.5
_NARROW: Final = 0.001


class NodeTurns(NamedTuple):
    """The turns of one node in a period; those that it wins by lot are an expectation."""

    node: NodeId
    relays: bool
    slot: int | None
    """The slot that the node claims; None if no slot is free for it."""
    superframe: int
    claimed: int
    won: float
    load: float
    """The number of turns that the node's packets and hellos need."""
    hop_ns: int | None
    """The longest time that a packet waits at this node if no other packet does."""

    @property
    def utilization(self) -> float:
        turns = self.claimed + self.won
        return self.load / turns if turns else inf


class ClaimedPlan(NamedTuple):
    """The plan of a swarm with claimed slots."""

    turns: Turns
    nodes: tuple[NodeTurns, ...]
    hops: int
    """The number of hops of the longest flood over relays."""
    least_interval_ns: int | None = None
    """The interval of the application's traffic at which the busiest node has no turn to spare."""

    @property
    def hop_ns(self) -> int | None:
        """The greatest `hop_ns` of all nodes; None if some node has no turn."""
        own = [node.hop_ns for node in self.nodes]
        return None if None in own else max(hop_ns for hop_ns in own if hop_ns is not None)

    @property
    def lone_ns(self) -> int | None:
        """The time within which a packet that meets no queue reaches all nodes."""
        hop_ns = self.hop_ns
        return None if hop_ns is None else self.hops * hop_ns

    @property
    def fullest(self) -> NodeTurns:
        return max(self.nodes, key=lambda node: (node.utilization, -node.node))


class Claimants:
    """The slots, relays and routes of claimed slots, which follow from positions alone."""

    def __init__(self, scenario: Scenario, adjacency: Adjacency) -> None:
        self.turns = geometry(scenario)
        self._near = two_hop(adjacency)
        self._shares = converged_slots(scenario, adjacency, self.turns)
        self.relays = {node: dominates(node, adjacency) for node in adjacency}
        self._hops = max((_depth(adjacency, root, self.relays) for root in adjacency), default=0)
        self._free = {node: self._unclaimed(node) for node in adjacency}
        self._hops_ns: dict[int, int | None] = {}
        self._ahead_ns = scenario.radio.lead_ns + scenario.radio.handover_ns

    def _unclaimed(self, node: NodeId) -> int:
        known = (self._shares[n] for n in (node, *self._near[node]))
        taken = {share for share in known if share is not None}
        return sum(1 for turn in range(self.turns.per_superframe) if not any(share.has(turn) for share in taken))

    def judge(self, scenario: Scenario, classes: Sequence[TrafficClass]) -> ClaimedPlan:
        """Judge all nodes under a load."""
        claimed = {node: _turns(share, self.turns) for node, share in self._shares.items()}
        loads = self._loads(scenario, classes)
        announced, drawn = self._lots(scenario, loads, claimed)
        nodes = []
        for node in sorted(loads):
            lots = drawn[node] + sum(announced[n] for n in self._near[node])
            share = self._shares[node]
            nodes.append(
                NodeTurns(
                    node=node,
                    relays=self.relays[node],
                    slot=None if share is None else share.slot,
                    superframe=0 if share is None else share.length,
                    claimed=len(claimed[node]),
                    won=self._free[node] * drawn[node] / lots if drawn[node] else 0.0,
                    load=loads[node] + self._hellos(scenario),
                    hop_ns=None if share is None else self._hop_ns(share.length),
                )
            )
        return ClaimedPlan(self.turns, tuple(nodes), self._hops)

    def _loads(self, scenario: Scenario, classes: Sequence[TrafficClass]) -> dict[NodeId, float]:
        """The number of turns per period that each node's packets need. With aggregation several
        packets share a turn.
        """
        period_ns = self.turns.period_ns
        most = scenario.claimed_turn_bytes
        each = [
            period_ns / c.interval_ns / (max(1, most // c.payload_bytes) if scenario.routing.aggregate else 1)
            for c in classes
        ]
        everything = sum(one * len(c.sources) for one, c in zip(each, classes, strict=True))
        loads = {}
        for node in self._near:
            own = sum(one for one, c in zip(each, classes, strict=True) if node in c.sources)
            loads[node] = everything if self.relays[node] else own
        return loads

    def _hellos(self, scenario: Scenario) -> float:
        hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        return _HELLOS_IN_TURNS * self.turns.period_ns / hello_ns if hello_ns else 0.0

    def _lots(
        self, scenario: Scenario, loads: Mapping[NodeId, float], claimed: Mapping[NodeId, Sequence[int]]
    ) -> tuple[dict[NodeId, float], dict[NodeId, int]]:
        """The number of lots that each node states on average, and the number with which it draws.

        A node draws with the least number that it stated in its latest hellos (`claiming.ClaimedLoad`). The number of
        packets in a hello interval varies by one, and a node that states lots only sometimes costs the others turns.
        """
        periods = seconds_to_ns(scenario.routing.hello_interval_s) / self.turns.period_ns
        announced, drawn = {}, {}
        for node, load in loads.items():
            turns = len(claimed[node]) * periods
            least, more = divmod(load * periods, 1)
            drawn[node] = _lots(least, turns)
            announced[node] = (1 - more) * drawn[node] + more * _lots(least + 1, turns)
        return announced, drawn

    def _hop_ns(self, length: int) -> int | None:
        """The hop time that a node will report for the worst slot of its superframe; one turn may go to a hello."""
        if length not in self._hops_ns:
            turns, found = self.turns, []
            for slot in range(min(length, turns.per_superframe)):
                starts = tuple(
                    turns.start_ns(turn, superframe_start_ns=0) for turn in _turns(Share(slot, length), turns)
                )
                found.append(TurnServer(turns.turn_ns, turns.period_ns, starts, self._ahead_ns).completion_ns(2))
            self._hops_ns[length] = max(found, default=None) if length <= turns.per_superframe else None
        return self._hops_ns[length]

    def least_interval_ns(self, scenario: Scenario, classes: Sequence[TrafficClass]) -> int | None:
        """The shortest interval of the application at which the load fits, to a thousandth; None if none does."""
        if not any(c.name == "application" for c in classes):
            return None

        def fits(interval_ns: int) -> bool:
            changed = [c._replace(interval_ns=interval_ns) if c.name == "application" else c for c in classes]
            return self.judge(scenario, changed).fullest.utilization <= 1

        low, high = 1, 1000 * S
        if not fits(high):
            return None
        while high - low > max(1, _NARROW * high):
            middle = (low + high) // 2
            low, high = (low, middle) if fits(middle) else (middle, high)
        return high


def converged_slots(scenario: Scenario, adjacency: Adjacency, turns: Turns) -> dict[NodeId, Share | None]:
    """The slots of all nodes after the protocol's claims have converged, if hellos are sent one after another and none
    is lost.
    """
    slots = scenario.clusters.slots
    sized = None if slots else longest_superframe(turns)
    claims = {
        node: SlotClaims(node, now_ns=0, listen_ns=LISTEN_HELLOS, lifetime_ns=2, slots=slots or None, sized_to=sized)
        for node in sorted(adjacency)
    }
    before: Mapping[NodeId, object] = {}
    for now in range(_ROUNDS):
        for node, own in claims.items():
            hello = own.step(now)
            for neighbor in adjacency[node]:
                claims[neighbor].on_hello(hello, now_ns=now)
        claimed = {node: (own.own.slot, own.own.length) for node, own in claims.items()}
        if now > 4 * LISTEN_HELLOS and claimed == before:
            break
        before = claimed
    return {
        node: None if own.slot is None else Share(own.slot, slots or own.own.length) for node, own in claims.items()
    }


def _turns(share: Share | None, turns: Turns) -> tuple[int, ...]:
    return () if share is None else tuple(range(share.slot, turns.per_superframe, share.length))


def _lots(packets: float, turns: float) -> int:
    """The rule of `claiming.ClaimedLoad`, for the packets and the turns of a hello interval when no packets wait."""
    wanted = packets / turns if turns else 0.0
    return 0 if wanted < IDLE else min(MOST_LOTS, ceil(2 * wanted))


def _depth(adjacency: Adjacency, root: NodeId, relays: Mapping[NodeId, bool]) -> int:
    """The number of successive transmissions after which a flood over these relays has reached all nodes that it can
    reach.
    """
    hops = {root: 0}
    frontier = [root]
    while frontier:
        following = []
        for node in frontier:
            for neighbor in adjacency[node] if node == root or relays[node] else ():
                if neighbor not in hops:
                    hops[neighbor] = hops[node] + 1
                    following.append(neighbor)
        frontier = following
    return max(hops.values())
