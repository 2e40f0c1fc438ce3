"""One node that floods in rounds: what it sends in its turns and in its bulk slots, and what it tells its neighbors."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest
from kit import MakeScenario

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxRequest
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.rounds.delay_law import DelayLaw
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import (
    FLAG_FLOOD,
    PRIORITY_BULK,
    PRIORITY_CONTROL,
    PRIORITY_REPORT,
    PRIORITY_SAFETY,
    Header,
    Kind,
    filler,
)
from fanet_mw.wire.aggregation import unbundle
from fanet_mw.wire.hello.digest import Digest
from fanet_mw.wire.rounds import HeardNodes, HeldPacket, decode_heard, decode_held, encode_heard

OURS, NEAR, NEW = NodeId(2), NodeId(3), NodeId(4)
MakeNode = Callable[..., Node]


@pytest.fixture
def make_node(make_scenario: MakeScenario) -> MakeNode:
    def make(**keys: object) -> Node:
        keys = {"nodes.count": 10, "routing.protocol": "rounds", "radio.lead_ms": 0, **keys}
        node = Node(OURS, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
        node.start(0)
        return node

    return make


def hear(
    node: Node,
    seq: int,
    *,
    src: NodeId,
    at_ns: int,
    kind: Kind = Kind.DATA,
    priority: int = PRIORITY_BULK,
    origin: NodeId | None = None,
    made_ns: int | None = None,
    hop_limit: int = 8,
) -> None:
    made_us, hops = (at_ns if made_ns is None else made_ns) // 1000, 0 if origin is None else 2
    header = Header(made_us, seq, origin or src, BROADCAST, src, kind, hop_limit, hops, priority, FLAG_FLOOD)
    node.hear(Reception(header.encode() + filler(40), src, at_ns, -60.0), at_ns)


def run(node: Node, until_ns: int, *, from_ns: int = 0) -> list[TxRequest]:
    """Wake the node whenever it asks for it; returns what it sent."""
    sent = []
    while (wake_ns := node.next_wake_ns()) is not None and wake_ns < until_ns:
        node.wake(max(wake_ns, from_ns))
        sent += node.requests
        node.requests.clear()
    return sent


def held_in(sent: list[TxRequest]) -> list[HeldPacket]:
    return [held for each in sent for packet in unbundle(each.frame) for held in decode_held(packet)]


def test_bulk_goes_in_a_slot_and_is_told_in_the_turn(make_node: MakeNode) -> None:
    node = make_node()
    timing = RoundTiming.of(node.scenario)
    run(node, 1 * S)
    hear(node, 7, src=NEAR, at_ns=1 * S)
    sent = run(node, 1500 * MS, from_ns=1 * S)
    assert held_in(sent)[0] == HeldPacket(7, NEAR)
    hear(node, 8, src=NEW, at_ns=1500 * MS)
    slots = [each for each in run(node, 2 * S, from_ns=1500 * MS) if wire.decode_header(each.frame).kind == Kind.DATA]
    assert slots, "the neighbor 3 was not heard to have packet 8"
    assert all(each.start_ns == timing.slot_start_ns(timing.slot_from(each.start_ns)) for each in slots)


def test_an_urgent_packet_goes_in_the_bulk_slot_before_the_turn_and_in_the_turn(make_node: MakeNode) -> None:
    node = make_node()
    timing = RoundTiming.of(node.scenario)
    run(node, 1 * S)
    hear(node, 7, src=NEAR, at_ns=1 * S)
    run(node, 2 * S, from_ns=1 * S)
    born_ns = timing.turn_start_ns(OURS, from_ns=2 * S) + 1 * MS
    hear(node, 9, src=NEAR, at_ns=born_ns, priority=PRIORITY_REPORT)
    hear(node, 4, src=NEW, at_ns=born_ns, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    turn_ns = timing.turn_start_ns(OURS, from_ns=born_ns)
    starts = [
        each.start_ns
        for each in run(node, turn_ns + 1, from_ns=born_ns)
        if any(wire.decode_header(packet).seq == 9 for packet in unbundle(each.frame))
    ]
    assert starts[-1] == turn_ns, "the neighbor 4 was not heard to have it"
    assert any(born_ns < start_ns < turn_ns for start_ns in starts)


def test_an_urgent_packet_that_all_neighbors_sent_is_told_of_and_not_sent(make_node: MakeNode) -> None:
    for others, sends in (((), True), ((NEW,), False)):
        node = make_node()
        run(node, 1 * S)
        for seq, src in ((1, NEAR), (2, NEW)):
            hear(node, seq, src=src, at_ns=1 * S, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
        for src in (NEAR, *others):
            hear(node, 9, src=src, at_ns=1 * S, priority=PRIORITY_REPORT, origin=None if src == NEAR else NEAR)
        sent = run(node, 1 * S + RoundTiming.of(node.scenario).period_ns, from_ns=1 * S)
        frames = [packet for each in sent for packet in unbundle(each.frame)]
        assert any(wire.decode_header(packet).seq == 9 for packet in frames) == sends
        assert (HeldPacket(9, NEAR) in held_in(sent)) != sends


def states(node: int, heard: Sequence[int], *, epoch: int) -> bytes:
    """What a node says about whom it hears."""
    bits = sum(1 << (one - 1) for one in heard)
    return encode_heard([HeardNodes(NodeId(node), epoch % 256, bits)], NEAR, count=10)


def hear_of_links(node: Node, told: bytes, *, at_ns: int) -> None:
    header = Header(
        at_ns // 1000, at_ns % 10_000, NEAR, BROADCAST, NEAR, Kind.ROUND, 1, 0, PRIORITY_CONTROL, FLAG_FLOOD
    )
    node.hear(Reception(header.encode() + told, NEAR, at_ns, -60.0), at_ns)


def stated_in(sent: Sequence[TxRequest], node: int) -> list[tuple[int, HeardNodes]]:
    """When a frame told what about whom a node hears."""
    frames = [(each.start_ns, packet) for each in sent for packet in unbundle(each.frame)]
    return [(at_ns, one) for at_ns, packet in frames for one in decode_heard(packet) if one.node == node]


def test_a_node_with_nothing_new_to_say_is_heard_often_enough_not_to_be_missed(make_node: MakeNode) -> None:
    node = make_node(**{"routing.hello_interval_s": 2})
    starts = list[int]()
    for step in range(50):
        at_ns = 1 * S + step * 100 * MS
        hear(node, step, src=NEAR, at_ns=at_ns, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
        starts += [each.start_ns for each in run(node, at_ns + 100 * MS, from_ns=at_ns)]
    silent_ns = DelayLaw(RoundTiming.of(node.scenario), node.scenario).silent_ns
    assert max(later - before for before, later in pairwise(starts)) <= silent_ns // 2


def test_a_neighbor_that_is_silent_for_five_rounds_is_none_before_its_next_hello_would_be_missed(
    make_node: MakeNode,
) -> None:
    node = make_node()
    hear(node, 1, src=NEAR, at_ns=1 * S, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    told = stated_in(run(node, 3 * S, from_ns=1 * S), OURS)
    drops_ns = next(at_ns for at_ns, one in told[1:] if not one.heard)
    assert 1700 * MS < drops_ns < 2300 * MS


def test_a_change_of_links_goes_in_a_bulk_slot_before_the_turn_and_in_the_turn_and_what_is_as_before_in_the_turn(
    make_node: MakeNode,
) -> None:
    node = make_node()
    timing = RoundTiming.of(node.scenario)
    ahead = {True: 0, False: 0}
    for epoch in range(5, 25):
        changes = epoch % 2 == 0
        at_ns = timing.turn_start_ns(OURS, from_ns=epoch * S // 4 + 100 * MS) + MS
        run(node, at_ns)
        hear_of_links(node, states(9, (3, 7) if epoch % 4 < 2 else (3,), epoch=epoch), at_ns=at_ns)
        turn_ns = timing.turn_start_ns(OURS, from_ns=at_ns)
        starts = [start_ns for start_ns, _ in stated_in(run(node, turn_ns + 1, from_ns=at_ns), 9)]
        assert starts[-1] == turn_ns
        ahead[changes] += starts[0] < turn_ns
    assert ahead[True], "some slots come before the turn"
    assert not ahead[False]


@pytest.mark.parametrize(("every", "goes_ahead"), [(4, False), (9, True)])
def test_a_statement_after_two_that_were_missed_goes_ahead_though_it_says_the_same(
    make_node: MakeNode, every: int, *, goes_ahead: bool
) -> None:
    node = make_node()
    timing, ahead = RoundTiming.of(node.scenario), 0
    for epoch in range(5, 5 + 20 * every):
        at_ns = timing.turn_start_ns(OURS, from_ns=epoch * S // 4 + 100 * MS) + MS
        run(node, at_ns)
        hear(node, epoch, src=NEAR, at_ns=at_ns, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
        if (epoch - 5) % every:
            continue
        hear_of_links(node, states(9, (3, 7), epoch=epoch), at_ns=at_ns)
        turn_ns = timing.turn_start_ns(OURS, from_ns=at_ns)
        starts = [start_ns for start_ns, _ in stated_in(run(node, turn_ns + 1, from_ns=at_ns), 9)]
        ahead += epoch > 5 and starts[0] < turn_ns
    assert bool(ahead) == goes_ahead


def test_who_comes_from_another_part_is_told_what_all_have_stated_and_who_was_in_this_part_is_not(
    make_node: MakeNode,
) -> None:
    node = make_node()
    hear_of_links(node, states(NEAR, (OURS, 9), epoch=4), at_ns=1 * S)
    hear_of_links(node, states(9, (NEAR,), epoch=4), at_ns=1 * S)
    assert stated_in(run(node, 1300 * MS, from_ns=1 * S), 9)
    hear_of_links(node, states(NEAR, (OURS, 9), epoch=5), at_ns=1300 * MS)
    hear(node, 5, src=NodeId(9), at_ns=1300 * MS, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    assert not stated_in(run(node, 1500 * MS, from_ns=1300 * MS), 9)
    hear(node, 6, src=NEW, at_ns=1500 * MS, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    assert stated_in(run(node, 1700 * MS, from_ns=1500 * MS), 9)


def test_a_link_to_another_part_is_stated_at_once_but_nothing_else_twice_in_an_epoch(make_node: MakeNode) -> None:
    node = make_node()
    told = list[tuple[int, HeardNodes]]()
    for at_ms, src in ((1_010, NEAR), (1_610, NEAR), (2_210, NEAR), (2_560, NEW), (2_570, NodeId(9))):
        told += stated_in(run(node, at_ms * MS, from_ns=1 * S), OURS)
        hear(node, at_ms, src=src, at_ns=at_ms * MS, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    told += stated_in(run(node, 2_850 * MS, from_ns=2_570 * MS), OURS)
    firsts = {one.heard.bit_count(): at_ns for at_ns, one in reversed(told)}
    assert firsts[1] >= 1_250 * MS, "it has heard nobody yet: all meet at the start"
    assert firsts[2] < 2_560 * MS + 50 * MS
    assert firsts[3] >= 2_750 * MS, (
        "it has stated another link in this epoch, and two statements of one are taken for one"
    )


def test_who_comes_near_is_told_of_recent_bulk(make_node: MakeNode) -> None:
    node = make_node()
    run(node, 1 * S)
    hear(node, 7, src=NEAR, at_ns=1 * S)
    assert HeldPacket(7, NEAR) in held_in(run(node, 1080 * MS, from_ns=1 * S))
    assert not held_in(run(node, 1130 * MS)), "once is enough"
    hear(node, 1, src=NEW, at_ns=1130 * MS, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    assert HeldPacket(7, NEAR) in held_in(run(node, 1200 * MS, from_ns=1130 * MS))


@pytest.mark.parametrize(
    "kind", [Kind.ROUND, Kind.DATA, "a copy"], ids=["what a node tells", "a first packet", "a copy"]
)
def test_who_is_heard_by_frames_that_somebody_repeats_long_after_is_not_near(
    make_node: MakeNode, kind: Kind | str
) -> None:
    """A station in the middle repeated frames of others 10 s later: 3 % of the packets were lost."""
    node = make_node()
    run(node, 1 * S)
    hear(node, 6, src=NEAR, at_ns=1 * S)
    run(node, 11 * S, from_ns=1 * S)
    hear(node, 7, src=NEAR, at_ns=11 * S)
    assert HeldPacket(7, NEAR) in held_in(run(node, 11_080 * MS, from_ns=11 * S))
    assert not held_in(run(node, 11_130 * MS)), "once is enough"
    if isinstance(kind, Kind):
        hear(node, 1, src=NEW, at_ns=11_130 * MS, kind=kind, made_ns=2 * S)
    else:
        hear(node, 6, src=NEW, at_ns=11_130 * MS, origin=NEAR, made_ns=1 * S)
    assert HeldPacket(7, NEAR) not in held_in(run(node, 11_200 * MS, from_ns=11_130 * MS))


def test_a_warning_goes_at_once_and_in_the_turn(make_node: MakeNode) -> None:
    node = make_node()
    timing = RoundTiming.of(node.scenario)
    run(node, 1 * S)
    hear(node, 4, src=NEW, at_ns=1 * S, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    born_ns = timing.slot_start_ns(timing.slot_from(1 * S)) + 1
    hear(node, 9, src=NEAR, at_ns=born_ns, priority=PRIORITY_SAFETY)
    assert [each.start_ns - born_ns < timing.slot_ns for each in node.requests] == [True]
    turns = [each.start_ns for each in run(node, born_ns + timing.period_ns, from_ns=born_ns)]
    assert timing.turn_start_ns(OURS, from_ns=born_ns) in turns


def test_warnings_that_wait_for_the_end_of_the_turns_do_not_all_start_there(make_node: MakeNode) -> None:
    """Bulk starts at that instant, too: what starts with it is lost at every neighbor that hears both."""
    node = make_node()
    timing = RoundTiming.of(node.scenario)
    run(node, 1 * S)
    round_ns = timing.turn_start_ns(1, from_ns=1 * S)
    for seq in range(9, 29):
        hear(node, seq, src=NEAR, at_ns=round_ns + 1, priority=PRIORITY_SAFETY)
    slots_ns = round_ns + timing.nodes * timing.turn_ns
    after_ns = [each.start_ns - slots_ns for each in node.requests]
    assert len(set(after_ns)) == 20
    assert 0 < max(after_ns) - min(after_ns) < timing.slot_ns


def test_a_packet_that_may_go_one_hop_is_sent_again_by_its_origin_alone(make_node: MakeNode) -> None:
    node = make_node(**{"routing.hop_limit": 1})
    run(node, 1 * S)
    node.send(filler(40), destination=BROADCAST, priority=PRIORITY_REPORT, app="a", born_ns=1 * S, now_ns=1 * S)
    hear(node, 7, src=NEAR, at_ns=1 * S, priority=PRIORITY_REPORT, hop_limit=1)
    run(node, 8 * S, from_ns=1 * S)
    nothing = Digest((), complete=True).encode_frames(NEW)
    header = Header(8_000_000, 1, NEW, BROADCAST, NEW, Kind.HELLO, 1, 0, PRIORITY_CONTROL, 0)
    node.hear(Reception(header.encode() + nothing, NEW, 8 * S, -60.0), 8 * S)
    packets = [
        wire.decode_header(packet) for each in run(node, 10 * S, from_ns=8 * S) for packet in unbundle(each.frame)
    ]
    assert {header.origin for header in packets if header.kind == Kind.DATA} == {OURS}


def test_what_comes_before_a_late_wake_up_does_not_cost_the_turn_that_was_asked_for(make_node: MakeNode) -> None:
    """A process is woken up to its slack late, together with the next message (`Actor.slack_ns`)."""
    node = make_node(**{"radio.lead_ms": 100})
    run(node, 1 * S)
    hear(node, 7, src=NEAR, at_ns=1 * S, priority=PRIORITY_REPORT)
    turn_ns = RoundTiming.of(node.scenario).turn_start_ns(OURS, from_ns=1 * S + 100 * MS)
    run(node, turn_ns - 100 * MS)
    hear(node, 8, src=NEAR, at_ns=turn_ns - 90 * MS, priority=PRIORITY_REPORT)
    assert turn_ns in [each.start_ns for each in run(node, turn_ns - 80 * MS, from_ns=turn_ns - 90 * MS)]


@pytest.mark.parametrize(("made_ns", "counts"), [(None, False), (1 * S, True)], ids=["fresh", "repeated later"])
def test_who_sends_in_another_ones_turn_is_no_link_but_a_frame_that_somebody_repeats_shows_nothing(
    make_node: MakeNode, made_ns: int | None, *, counts: bool
) -> None:
    node = make_node(**{"clock.sync": "beacons", "clock.drift_ppm": 10})
    timing = RoundTiming.of(node.scenario)

    def in_turn_of(other: NodeId, seq: int, *, from_ns: int, made_ns: int | None = None) -> int:
        at_ns = timing.turn_start_ns(other, from_ns=from_ns) + timing.turn_ns // 2
        hear(node, seq, src=NEAR, at_ns=at_ns, kind=Kind.ROUND, priority=PRIORITY_CONTROL, made_ns=made_ns)
        return at_ns

    run(node, 5 * S)
    at_ns = in_turn_of(NEAR, 1, from_ns=5 * S)
    run(node, at_ns + S // 2, from_ns=at_ns)
    at_ns = in_turn_of(NEAR, 2, from_ns=at_ns + S // 2)
    at_ns = in_turn_of(NEW, 3, from_ns=at_ns, made_ns=made_ns)
    sent = run(node, at_ns + S // 2, from_ns=at_ns)
    told = [one for each in sent for packet in unbundle(each.frame) for one in decode_heard(packet) if one.node == OURS]
    assert bool(told[-1].heard >> (NEAR - 1) & 1) == counts


@pytest.mark.parametrize(("sinks_m_s", "counts"), [(11.0, True), (15.0, False)])
def test_who_falls_says_that_it_has_no_links_so_that_others_exclude_it_before_its_radio_ends(
    make_node: MakeNode, sinks_m_s: float, *, counts: bool
) -> None:
    node = make_node()
    hear(node, 1, src=NEAR, at_ns=5 * S, kind=Kind.ROUND, priority=PRIORITY_CONTROL)
    node.moved(Enu(0.0, 0.0, 50.0), Enu(0.0, 0.0, -sinks_m_s))
    sent = run(node, 5500 * MS, from_ns=5 * S)
    told = [one for each in sent for packet in unbundle(each.frame) for one in decode_heard(packet) if one.node == OURS]
    assert bool(told and told[-1].heard >> (NEAR - 1) & 1) == counts
