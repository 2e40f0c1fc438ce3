"""What one node passes on, as timelines: urgent packets in turns, bulk where a neighbor is not known to have it."""

from fanet_mw import wire
from fanet_mw.node.duplicates import key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.routing.rounds.spreading import Spreading
from fanet_mw.units import BROADCAST, MS, NodeId
from fanet_mw.wire import Header, Kind

ROUND = 100 * MS
NEAR: dict[int, set[int]] = {2: {1, 5}, 3: {1}}
"""The neighbors of this node (1), and whom they hear."""


def packet(seq: int, *, priority: int = wire.PRIORITY_REPORT) -> Packet:
    header = Header(
        origin_us=0, seq=seq, origin=NodeId(7), destination=BROADCAST, prev_hop=NodeId(7), kind=Kind.DATA,
        hop_limit=8, hops=0, priority=priority, flags=wire.FLAG_FLOOD,
    )  # fmt: skip
    return Packet(header, header.encode())


def spreading(*, repeats: int = 3) -> Spreading:
    return Spreading(capacity=8, repeats=repeats, patience_ns=ROUND, neighbors_of=lambda node, _: NEAR.get(node, set()))


def sent_in_turn(made: Spreading, turn: int, *, neighbors: tuple[int, ...] = (2, 3)) -> list[int]:
    packets = made.wanted(neighbors, start_ns=turn * ROUND)
    for each in packets:
        made.sent(each, start_ns=turn * ROUND)
    return [each.header.seq for each in packets]


def test_an_urgent_packet_goes_in_the_next_turn_and_once_if_all_neighbors_pass_it_on() -> None:
    made = spreading()
    made.take(packet(1), src=2, now_ns=0)
    assert sent_in_turn(made, 1) == [1]
    made.on_copy(key_of_packet(packet(1)), 3, now_ns=ROUND + 10)
    assert [sent_in_turn(made, turn) for turn in range(2, 6)] == [[], [], [], []]
    assert key_of_packet(packet(1)) not in made


def test_the_most_urgent_packet_goes_first_and_else_the_one_that_came_first() -> None:
    made = spreading()
    for seq, priority in ((1, wire.PRIORITY_REPORT), (2, wire.PRIORITY_SAFETY), (3, wire.PRIORITY_REPORT)):
        made.take(packet(seq, priority=priority), src=None, now_ns=0)
    assert sent_in_turn(made, 1) == [2, 1, 3]


def test_a_neighbor_that_does_not_pass_it_on_gets_it_again_but_not_for_ever() -> None:
    made = spreading(repeats=2)
    made.take(packet(1), src=2, now_ns=0)
    assert [sent_in_turn(made, turn) for turn in range(1, 8)] == [[1], [1], [1], [], [], [], []]


def test_nobody_repeats_what_another_node_has_just_sent() -> None:
    made = spreading()
    made.take(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.on_copy(key_of_packet(packet(1)), 2, now_ns=ROUND + 60 * MS)
    assert sent_in_turn(made, 2) == []
    assert sent_in_turn(made, 3) == [1]


def test_a_neighbor_that_says_it_holds_the_packet_needs_no_repeat() -> None:
    made = spreading()
    made.take(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.on_held(key_of_packet(packet(1)), 3)
    assert sent_in_turn(made, 2) == []


def test_who_sends_again_what_this_node_has_sent_is_told_that_it_is_here() -> None:
    made = spreading()
    key = key_of_packet(packet(1))
    made.take(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    assert not made.on_copy(key, 3, now_ns=ROUND + 1)
    assert made.on_copy(key, 3, now_ns=2 * ROUND)


def bulk(seq: int) -> Packet:
    return packet(seq, priority=wire.PRIORITY_BULK)


def bulk_sent(made: Spreading, at_ns: int, *, neighbors: tuple[int, ...] = (2, 3)) -> list[int]:
    chosen, later = made.bulk_wanted(neighbors, start_ns=at_ns)
    for each in later:
        made.look_again(each.packet, from_ns=each.from_ns)
    for each in chosen:
        made.sent(each.packet, start_ns=at_ns)
        made.look_again(each.packet, from_ns=at_ns + 2 * ROUND)
    return [each.packet.header.seq for each in chosen]


def test_bulk_is_not_sent_where_those_who_sent_it_reach_every_neighbor() -> None:
    made = spreading()
    made.take(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    assert bulk_sent(made, 10 * MS, neighbors=(2, 5)) == []
    assert bulk_sent(made, ROUND * 3, neighbors=(2, 5)) == [1], "5 was never heard to have it"


def test_bulk_that_all_are_known_to_have_is_forgotten() -> None:
    made = spreading()
    made.take(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    assert bulk_sent(made, 10 * MS) == [1]
    made.on_held(key_of_packet(bulk(1)), 3)
    assert bulk_sent(made, 5 * ROUND) == []
    assert made.bulk_due_ns() is None


def test_new_bulk_goes_before_what_is_sent_again() -> None:
    made = spreading()
    made.take(bulk(1), src=None, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 0) == [1]
    made.take(bulk(2), src=None, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 3 * ROUND) == [2, 1]


def test_the_least_important_packet_is_evicted_when_too_many_are_kept() -> None:
    made = spreading()
    for seq in range(8):
        assert made.take(packet(seq), src=None, now_ns=0) is None
    evicted = made.take(bulk(5000), src=None, now_ns=0, bulk_from_ns=0)
    assert evicted is not None
    assert evicted.header.seq == 5000
