"""Floods in claimed slots: whoever joins, leaves or is not heard, slots end up free of clashes and packets come once.

The nodes are real, protocol and wire format included; only the air is a graph.
"""

from collections import Counter
from typing import Any

import pytest
from claims_radio import GraphRadio
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from kit import examples
from test_slots_with_reuse import longest_chain

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.graph.topology import components, two_hop
from fanet_mw.routing.clustered.claimed.claimed_access import ClaimedAccess
from fanet_mw.routing.clustered.claimed.slot_acquisition import SlotAcquisition
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.scenario import config
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, Kind
from fanet_mw.wire.hello.beacon import Beacon
from fanet_mw.wire.hello.claims import Claims, HeardNeighbor, SlotStatus


def scenario_of(*, aggregate: bool = False, **clusters: Any) -> Any:
    tree = {
        "routing": {"aggregate": aggregate},
        "nodes": {"count": 60},
        "clusters": {"relay": "claimed", "flooding_period_s": 0.5, **clusters},
        "radio": {"lead_ms": 0, "cw_min": 7},
    }
    return config.build(tree)


def claiming(radio: GraphRadio, node: int) -> SlotAcquisition:
    found = radio.nodes[NodeId(node)]._protocol
    assert isinstance(found, Clustered)
    assert isinstance(found.parts.access, ClaimedAccess)
    return found.parts.access._claiming


def settle_s(radio: GraphRadio) -> int:
    """The law of `slot_claims` in hellos: listening 3, lifetime 3.5, sizes 4; each hello may wait for a window."""
    return 2 + 3 + 4 + 2 * longest_chain(radio.adjacency) + 1 + 4


def meetings(radio: GraphRadio) -> list[tuple[int, int]]:
    """Pairs within two hops that hold a common turn."""
    rivals = two_hop(radio.adjacency)
    own = {n: claiming(radio, n)._claims.own for n in rivals}
    return [(a, b) for a in sorted(rivals) for b in rivals[a] if a < b and own[a].meets(own[b])]


def together(radio: GraphRadio, since_ns: int) -> list[tuple[int, int, int]]:
    """Data that two nodes within two hops sent at the same instant."""
    rivals = two_hop(radio.adjacency)
    at: dict[int, list[NodeId]] = {}
    for t_ns, node, header in radio.sent:
        if t_ns >= since_ns and header.kind == Kind.DATA and header.flags & FLAG_FLOOD and node in rivals:
            at.setdefault(t_ns, []).append(node)
    return [(t, a, b) for t, nodes in at.items() for a in nodes for b in nodes if a < b and b in rivals[a]]


class Swarm(RuleBasedStateMachine):
    """Joins, leaves, links that come and go, losses, packets; and calm times, after which all must be in order."""

    aggregate = False

    def __init__(self) -> None:
        super().__init__()
        self.radio = GraphRadio(scenario_of(aggregate=self.aggregate))
        self.next_id = 1
        self.radio.join(self._id())

    def _id(self) -> int:
        self.next_id += 7
        return self.next_id * 13 % 53 + 1

    @precondition(lambda self: len(self.radio.nodes) < 9)
    @rule(data=st.data())
    def join(self, data: st.DataObject) -> None:
        there = sorted(self.radio.nodes)
        friends = data.draw(st.lists(st.sampled_from(there), max_size=3, unique=True)) if there else []
        node = self._id()
        if node not in self.radio.nodes:
            self.radio.join(node, *friends)

    @precondition(lambda self: self.radio.nodes)
    @rule(data=st.data())
    def leave(self, data: st.DataObject) -> None:
        self.radio.leave(data.draw(st.sampled_from(sorted(self.radio.nodes))))

    @precondition(lambda self: len(self.radio.nodes) > 1)
    @rule(data=st.data(), there=st.booleans())
    def move(self, data: st.DataObject, there: bool) -> None:
        a, b = data.draw(st.lists(st.sampled_from(sorted(self.radio.nodes)), min_size=2, max_size=2, unique=True))
        self.radio.link(a, b) if there else self.radio.cut(a, b)

    @rule(seconds=st.integers(1, 6), loss=st.sampled_from([0.0, 0.2, 0.6]))
    def fly(self, seconds: int, loss: float) -> None:
        self.radio.loss = loss
        self.radio.run(seconds * S)
        self.radio.loss = 0.0

    @precondition(lambda self: self.radio.nodes)
    @rule(data=st.data(), packets=st.integers(1, 5))
    def send(self, data: st.DataObject, packets: int) -> None:
        for _ in range(packets):
            self.radio.send(data.draw(st.sampled_from(sorted(self.radio.nodes))))
            self.radio.run(5 * MS)

    @precondition(lambda self: self.radio.nodes)
    @rule()
    def calm(self) -> None:
        """After the stated number of hellos without a loss nobody clashes, and a packet of anyone reaches its part."""
        radio = self.radio
        radio.run(settle_s(radio) * S)
        assert not meetings(radio)
        assert all(claiming(radio, n).own.share is not None for n in radio.nodes)
        began_ns = radio.now_ns
        packets = {node: radio.send(node) for node in sorted(radio.nodes)}
        radio.run(6 * S)
        assert not together(radio, began_ns)
        for part in components(radio.adjacency):
            for source in part:
                got = {n for n in part if radio.delivered[n, source, packets[source]]}
                assert got == set(part) - {source}

    @invariant()
    def nothing_is_delivered_or_relayed_twice(self) -> None:
        assert all(times == 1 for times in self.radio.delivered.values())
        floods = Counter(
            (node, header.origin, header.seq)
            for _, node, header in self.radio.sent
            if header.kind == Kind.DATA and header.flags & FLAG_FLOOD
        )
        assert all(times == 1 for times in floods.values())


class AggregatingSwarm(Swarm):
    """The same, with several packets in a frame."""

    aggregate = True


TestAggregatingSwarm = AggregatingSwarm.TestCase
TestAggregatingSwarm.settings = examples(10, stateful_step_count=15)
TestSwarm = Swarm.TestCase
TestSwarm.settings = examples(15, stateful_step_count=20)


@pytest.fixture
def line() -> GraphRadio:
    """Five nodes in a row, settled."""
    radio = GraphRadio(scenario_of())
    for node in range(1, 6):
        radio.join(node, *([node - 1] if node > 1 else []))
    radio.run(20 * S)
    return radio


def test_a_row_of_five_reuses_slots_and_a_packet_crosses_it_in_few_superframes(line: GraphRadio) -> None:
    reports = [line.nodes[NodeId(n)].report() for n in range(1, 6)]
    assert {report["superframe"] for report in reports} == {8}, "five within two hops of the middle"
    assert len({report["slot"] for report in reports}) < 5
    began_ns = line.now_ns
    seq = line.send(1)
    line.run(S)
    assert line.delivered[5, 1, seq] == 1
    relays = [(t, n) for t, n, header in line.sent if t >= began_ns and header.kind == Kind.DATA]
    assert [n for _, n in relays] == [1, 2, 3, 4], "the end of the row need not relay"
    hop_ms = max(line.nodes[NodeId(n)].report()["hop_ms"] for n in range(1, 6))
    assert (relays[-1][0] - began_ns) / MS <= 4 * hop_ms


def test_a_joiner_listens_and_meanwhile_brings_its_packets_to_a_neighbor_that_holds_a_slot(line: GraphRadio) -> None:
    line.join(6, 5)
    line.run(2 * S)
    assert line.nodes[NodeId(6)].report()["slot"] is None
    seq = line.send(6)
    line.run(S // 2)
    phases = [h.flags for _, n, h in line.sent if n == 6 and h.kind == Kind.DATA]
    assert phases == [FLAG_TO_HEAD]
    line.run(2 * S)
    assert all(line.delivered[n, 6, seq] == 1 for n in range(1, 6))
    line.run(3 * S)
    assert line.nodes[NodeId(6)].report()["slot"] is not None


def test_a_fixed_superframe_that_is_full_leaves_some_without_a_slot_and_they_still_get_through() -> None:
    radio = GraphRadio(scenario_of(slots=3))
    for node in range(1, 6):
        radio.join(node, *range(1, node))  # everyone hears everyone
    radio.run(20 * S)
    slots = {n: radio.nodes[NodeId(n)].report()["slot"] for n in range(1, 6)}
    assert sorted(slot for slot in slots.values() if slot is not None) == [0, 1, 2]
    without = next(n for n, slot in slots.items() if slot is None)
    seq = radio.send(without)
    radio.run(2 * S)
    assert all(radio.delivered[n, without, seq] == 1 for n in range(1, 6) if n != without)


def test_who_has_more_to_send_than_its_claim_holds_draws_lots_and_sends_it(line: GraphRadio) -> None:
    """Every 8th of 1.3 ms turns is 90 a second; 160 a second come."""
    began_ns = line.now_ns
    for _ in range(1600):
        line.send(3)
        line.run(S // 160)
    line.run(8 * S)
    assert line.nodes[NodeId(3)].report()["waiting"] == 0
    assert sum(1 for t, n, h in line.sent if n == 3 and t >= began_ns and h.kind == Kind.DATA) == 1600
    assert not together(line, began_ns)


def test_urgent_packets_overtake_bulk_at_every_hop(line: GraphRadio) -> None:
    bulk = [line.send(2) for _ in range(20)]
    urgent = line.send(2, priority=wire.PRIORITY_SAFETY)
    line.run(60 * MS)
    assert line.delivered[3, 2, urgent] == 1
    assert sum(line.delivered[3, 2, seq] for seq in bulk) < 10


def test_a_warning_that_could_not_go_within_its_second_is_dropped_and_a_report_is_not(line: GraphRadio) -> None:
    line.leave(4)
    line.join(6)  # alone: it has no slot yet, and nobody to bring anything to
    warning = line.send(6, priority=wire.PRIORITY_SAFETY)
    report = line.send(6, priority=wire.PRIORITY_REPORT)
    line.run(S)
    line.link(6, 3)
    line.run(8 * S)
    assert line.delivered[3, 6, report] == 1
    assert line.delivered[3, 6, warning] == 0
    assert "expired" in {**dict(line.nodes[NodeId(3)].report()["dropped"]), **line.nodes[NodeId(6)].report()["dropped"]}


def test_small_packets_that_wait_together_share_a_frame_at_every_hop_and_are_delivered_once_each() -> None:
    radio = GraphRadio(scenario_of(aggregate=True))
    for node in range(1, 6):
        radio.join(node, *([node - 1] if node > 1 else []))
    radio.run(20 * S)
    before = radio.frames
    packets = [(1, radio.send(1)) for _ in range(10)] + [(5, radio.send(5)) for _ in range(10)]
    radio.run(S // 2)
    for source, seq in packets:
        assert [radio.delivered[n, source, seq] for n in range(1, 6) if n != source] == [1] * 4
    hellos = sum(1 for _, _, header in radio.sent[-60:] if header.kind == Kind.HELLO)
    assert radio.frames - before - hellos <= 16, "20 packets of 4 transmissions each: 80 one by one"


def test_a_bundle_of_which_a_part_is_known_brings_only_the_rest() -> None:
    radio = GraphRadio(scenario_of(aggregate=True))
    listener = radio.join(1)

    def packet(seq: int, flags: int = FLAG_FLOOD) -> bytes:
        header = wire.Header(0, seq, 9, 0xFFFF, 9, Kind.DATA, 32, 0, wire.PRIORITY_BULK, flags)
        return header.encode() + wire.filler(40)

    listener.hear(Reception(packet(1), NodeId(9), 5, -60.0), now_ns=5)
    listener.hear(Reception(wire.bundle([packet(0), packet(1), packet(2)]), NodeId(9), 9, -60.0), now_ns=9)
    assert [delivery.header.seq for delivery in listener.deliveries] == [1, 0, 2]
    assert listener.receptions == 2
    assert listener.report()["dropped"] == {"duplicate": 1}
    broken = wire.bundle([packet(3), packet(4)])[:-5]
    listener.hear(Reception(broken, NodeId(9), 12, -60.0), now_ns=12)
    assert listener.report()["dropped"] == {"duplicate": 1, "malformed": 1}
    assert len(listener.deliveries) == 3


@pytest.mark.parametrize("length", [3, 254, 255])
def test_a_stranger_s_impossible_claim_neither_stops_us_nor_what_our_neighbors_say(
    line: GraphRadio, length: int
) -> None:
    stranger = Claims(
        NodeId(40), SlotStatus(0, length, 5), (HeardNeighbor(NodeId(3), SlotStatus(1, length), hears_us=True),)
    )
    for node in (2, 3):
        hello = wire.Header(0, 1, 40, 0xFFFF, 40, Kind.HELLO, 1, 0, 0, 0).encode()
        beacon = Beacon(40, 0, 0, 0, 0, 0, 0, 255).encode_frame(40)
        frame = hello + beacon + stranger.encode_frames()
        line.nodes[NodeId(node)].hear(Reception(frame, NodeId(40), line.now_ns, -60.0), now_ns=line.now_ns)
    before = {n: line.nodes[NodeId(n)].report()["slot"] for n in range(1, 6)}
    line.run(3 * S)
    assert {n: line.nodes[NodeId(n)].report()["slot"] for n in range(1, 6)} == before
    assert not meetings(line)
    seq = line.send(1)
    line.run(S)
    assert line.delivered[5, 1, seq] == 1
