"""What one node passes on, as timelines: urgent packets in turns, bulk where a neighbor is not known to have it."""

import math
import random
from collections.abc import Iterable, Mapping

import pytest

from fanet_mw import wire
from fanet_mw.node.duplicates import key_of, key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.routing.rounds.spreading import Spreading
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire import Header, Kind
from tests.benchmarks.growth import entries

ROUND = 100 * MS
CAPACITY = 8
NEAR = {2: (1, 5), 3: (1,)}
"""The neighbors of this node (1), and whom they hear."""


def nodes(numbers: Iterable[int]) -> int:
    return sum(1 << (number - 1) for number in numbers)


def packet(seq: int, *, priority: int = wire.PRIORITY_REPORT, origin_us: int = 0) -> Packet:
    header = Header(
        origin_us=origin_us, seq=seq, origin=NodeId(7), destination=BROADCAST, prev_hop=NodeId(7), kind=Kind.DATA,
        hop_limit=8, hops=0, priority=priority, flags=wire.FLAG_FLOOD,
    )  # fmt: skip
    return Packet(header, header.encode())


def spreading(*, repeats: int = 3, lossy: bool = False, near: Mapping[int, Iterable[int]] = NEAR) -> Spreading:
    links = [nodes({1: near.keys() - {1}, **near}.get(node, ())) for node in range(9)]
    return Spreading(NodeId(1), capacity=CAPACITY, repeats=repeats, patience_ns=ROUND, links=links, lossy=lossy)


def sent_in_turn(made: Spreading, turn: int, *, neighbors: tuple[int, ...] = (2, 3)) -> list[int]:
    packets = made.wanted(nodes(neighbors), start_ns=turn * ROUND)
    for each in packets:
        made.sent(each, start_ns=turn * ROUND)
    return [each.header.seq for each in packets]


def test_an_urgent_packet_goes_in_the_next_turn_and_once_if_all_neighbors_pass_it_on() -> None:
    made = spreading()
    made.push(packet(1), src=2, now_ns=0)
    assert sent_in_turn(made, 1) == [1]
    made.on_copy(key_of_packet(packet(1)), 3, neighbors=nodes((2, 3)), now_ns=ROUND + 10)
    assert [sent_in_turn(made, turn) for turn in range(2, 6)] == [[], [], [], []]
    assert key_of_packet(packet(1)) not in made


def test_the_most_urgent_packet_goes_first_and_else_the_oldest_whichever_came_first() -> None:
    made = spreading()
    for seq, priority in ((1, wire.PRIORITY_REPORT), (2, wire.PRIORITY_SAFETY), (3, wire.PRIORITY_REPORT)):
        made.push(packet(seq, priority=priority, origin_us=9 - seq), src=None, now_ns=0)
    assert sent_in_turn(made, 1) == [2, 3, 1]


def test_a_neighbor_that_does_not_pass_it_on_gets_it_again_but_not_for_ever() -> None:
    made = spreading(repeats=2)
    made.push(packet(1), src=2, now_ns=0)
    assert [sent_in_turn(made, turn) for turn in range(1, 8)] == [[1], [1], [1], [], [], [], []]


def vainly(made: Spreading, *, neighbors: tuple[int, ...] = (3,)) -> int:
    """How often of 40 times a packet that node 2 has passed on is sent again for the neighbors."""
    again = 0
    for seq in range(40):
        made.push(packet(100 + seq, priority=wire.PRIORITY_BULK), src=2, now_ns=seq * S, bulk_from_ns=seq * S)
        for turn in range(6):
            found = made.next_bulk(nodes(neighbors), start_ns=seq * S + turn * ROUND)
            if found is not None:
                again += made.sent(found, start_ns=seq * S + turn * ROUND) > 1
                made.look_again(found, from_ns=seq * S + (turn + 1) * ROUND)
    return again


def test_a_neighbor_that_shows_by_nothing_that_it_hears_is_sent_nothing_again() -> None:
    assert vainly(spreading(near={})) < 20
    assert vainly(spreading(near={1: (3,), 3: (1,)})) > 60, "it has a link, so it hears"


def test_a_deaf_neighbor_that_holds_what_others_sent_hears_again() -> None:
    made = spreading(near={})
    vainly(made)
    made.on_copy(key_of(3, 5), 3, neighbors=nodes((3,)), now_ns=40 * S)
    assert vainly(made) == 0, "what it makes itself it need not have heard"
    made.on_held([key_of_packet(packet(100))], 3)
    assert vainly(made) > 10
    made.push(packet(300), src=3, now_ns=80 * S)
    assert vainly(made) > 10, "it has passed on what somebody else made"


def test_urgent_packets_are_not_sent_again_for_a_deaf_neighbor_either() -> None:
    made = spreading(near={})
    vainly(made)
    made.push(packet(1), src=2, now_ns=50 * S)
    assert [len(made.wanted(nodes((3,)), start_ns=50 * S + turn * ROUND)) for turn in range(1, 2)] == [1]
    made.sent(packet(1), start_ns=50 * S + ROUND)
    assert [made.wanted(nodes((3,)), start_ns=50 * S + turn * ROUND) for turn in range(2, 6)] == [[]] * 4


def test_a_neighbor_that_seems_deaf_is_sent_what_is_new_once() -> None:
    """Who cannot answer may hear all the same."""
    made = spreading(near={})
    vainly(made)
    made.push(packet(1), src=2, now_ns=50 * S)
    assert made.spared(nodes((2, 3))) == []
    assert [one.header.seq for one in made.wanted(nodes((2, 3)), start_ns=51 * S)] == [1]


def test_what_was_sent_again_while_a_neighbor_had_a_link_does_not_make_it_deaf() -> None:
    """It hears, and flies away."""
    links = [0] * 9
    links[1], links[3] = nodes((3,)), nodes((1,))
    made = Spreading(NodeId(1), capacity=8, repeats=3, patience_ns=ROUND, links=links)
    vainly(made)
    links[1] = links[3] = 0
    assert vainly(made) > 10


def test_nobody_repeats_what_another_node_has_just_sent() -> None:
    made = spreading()
    made.push(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.on_copy(key_of_packet(packet(1)), 2, neighbors=nodes((2, 3, 5)), now_ns=ROUND + 60 * MS)  # 5 may have heard 2
    assert sent_in_turn(made, 2) == []
    assert sent_in_turn(made, 3) == [1]


def test_a_copy_that_nobody_who_lacks_the_packet_can_have_heard_delays_nothing() -> None:
    """Node 2 hears this node and 5 only, and repeats what it does not know this node to have; 3 still lacks it."""
    made = spreading()
    made.push(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.on_copy(key_of_packet(packet(1)), 2, neighbors=nodes((2, 3)), now_ns=ROUND + 60 * MS)
    assert sent_in_turn(made, 2) == [1]


def test_a_neighbor_that_says_it_holds_the_packet_needs_no_repeat() -> None:
    made = spreading()
    made.push(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.on_held([key_of_packet(packet(1))], 3)
    assert sent_in_turn(made, 2) == []


def test_who_sends_again_what_this_node_has_sent_is_told_that_it_is_here() -> None:
    made = spreading()
    key = key_of_packet(packet(1))
    made.push(packet(1), src=2, now_ns=0)
    sent_in_turn(made, 1)
    assert not made.on_copy(key, 3, neighbors=nodes((2, 3)), now_ns=ROUND + 1)
    assert made.on_copy(key, 3, neighbors=nodes((2, 3)), now_ns=2 * ROUND)


def bulk(seq: int) -> Packet:
    return packet(seq, priority=wire.PRIORITY_BULK)


def bulk_sent(made: Spreading, at_ns: int, *, neighbors: tuple[int, ...] = (2, 3)) -> list[int]:
    sent = []
    while (each := made.next_bulk(nodes(neighbors), start_ns=at_ns)) is not None:
        made.sent(each, start_ns=at_ns)
        made.look_again(each, from_ns=at_ns + 2 * ROUND)
        sent.append(each.header.seq)
    return sent


def test_bulk_is_not_sent_where_those_who_sent_it_reach_every_neighbor() -> None:
    made = spreading()
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    assert bulk_sent(made, 10 * MS, neighbors=(2, 5)) == []
    assert bulk_sent(made, ROUND * 3, neighbors=(2, 5)) == [1], "5 was never heard to have it"


def test_bulk_that_all_are_known_to_have_is_forgotten() -> None:
    made = spreading()
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    assert bulk_sent(made, 10 * MS) == [1]
    made.on_held([key_of_packet(bulk(1))], 3)
    assert bulk_sent(made, 5 * ROUND) == []
    assert made.bulk_due_ns(nodes((2, 3))) is None


def test_new_bulk_goes_before_what_is_sent_again() -> None:
    made = spreading()
    made.push(bulk(1), src=None, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 0) == [1]
    made.push(bulk(2), src=None, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 3 * ROUND) == [2, 1]


def test_what_others_send_first_asks_for_no_more_slots() -> None:
    made = spreading()
    made.push(bulk(1), src=None, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 0) == [1]
    made.push(bulk(2), src=None, now_ns=0, bulk_from_ns=0)
    made.push(bulk(3), src=None, now_ns=0, bulk_from_ns=0)
    made.push(bulk(4), src=3, now_ns=0, bulk_from_ns=0, spare=True)
    first = made.next_bulk(nodes((2, 3)), start_ns=3 * ROUND)
    assert first is not None
    assert first.header.seq == 2
    assert made.has_due_bulk(2), "3, and 1, which is sent again"
    assert not made.has_due_bulk(3), "others send 4 first"
    made.look_again(first, from_ns=3 * ROUND)
    assert bulk_sent(made, 3 * ROUND) == [2, 3, 4, 1]


def test_the_least_important_packet_is_evicted_when_too_many_are_kept() -> None:
    made = spreading()
    for seq in range(8):
        assert made.push(packet(seq), src=None, now_ns=0) is None
    evicted = made.push(bulk(5000), src=None, now_ns=0, bulk_from_ns=0)
    assert evicted is not None
    assert evicted.header.seq == 5000


def test_what_a_neighbor_holds_counts_also_if_it_said_so_first() -> None:
    made = spreading()
    made.on_held([key_of_packet(bulk(1))], 3)
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    assert bulk_sent(made, 10 * MS) == []


def test_who_sends_bulk_a_second_time_does_not_know_that_this_node_has_it() -> None:
    made = spreading()
    key = key_of_packet(bulk(1))
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=10 * MS)
    made.on_held([key], 3)
    assert bulk_sent(made, 10 * MS) == [], "all have it"
    assert not made.on_copy(key, 3, neighbors=nodes((2, 3)), now_ns=ROUND), "3 sends it for the first time"
    assert made.on_copy(key, 3, neighbors=nodes((2, 3)), now_ns=2 * ROUND)


def test_who_comes_near_has_got_elsewhere_what_is_old() -> None:
    made = spreading()
    for seq, taken_ns in ((1, 0), (2, 5 * ROUND)):
        made.push(bulk(seq), src=None, now_ns=taken_ns, bulk_from_ns=taken_ns)
    assert bulk_sent(made, 5 * ROUND, neighbors=(2,)) == [1, 2]
    for seq in (1, 2):
        made.on_held([key_of_packet(bulk(seq))], 2)
    made.assume(3, until_ns=ROUND)
    assert bulk_sent(made, 8 * ROUND) == [2]


def test_an_own_packet_of_a_node_that_hears_nobody_is_kept_until_somebody_comes() -> None:
    made = spreading()
    made.push(packet(1, priority=wire.PRIORITY_BULK), src=None, now_ns=0, bulk_from_ns=0)
    assert made.next_bulk(0, start_ns=0) is not None
    made.look_again(bulk(1), from_ns=ROUND)
    assert bulk_sent(made, 3 * ROUND, neighbors=(2,)) == [1]


def test_the_origin_of_a_packet_is_known_to_have_it() -> None:
    made = spreading()
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 0, neighbors=(2, 7)) == []


def test_a_neighbor_that_is_gone_is_sent_nothing_that_was_left_to_others() -> None:
    made = spreading()
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=0)
    assert bulk_sent(made, 0, neighbors=(2, 5)) == [], "2 reaches 5"
    assert made.next_bulk(nodes((2, 5)), start_ns=3 * ROUND, gone=nodes((5,))) is None
    assert bulk_sent(made, 6 * ROUND, neighbors=(2, 5)) == [1], "5 is back"


def test_a_spare_node_sends_nothing_for_a_neighbor_that_is_gone() -> None:
    made = spreading(near={})
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=2 * ROUND, spare=True)
    assert made.next_bulk(nodes((2, 3)), start_ns=2 * ROUND, gone=nodes((3,))) is None
    assert bulk_sent(made, 4 * ROUND) == [1], "3 is back"


def test_a_spare_node_sends_nothing_if_its_neighbors_hold_it_or_are_reached() -> None:
    made = spreading(near={2: (5,)})
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=2 * ROUND, spare=True)
    made.on_held([key_of_packet(bulk(1))], 3)
    assert bulk_sent(made, 2 * ROUND, neighbors=(2, 3, 5)) == []


def test_a_spare_node_leaves_out_who_had_it_elsewhere() -> None:
    made = spreading(near={})
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=2 * ROUND, spare=True)
    made.assume(3, until_ns=ROUND)
    assert bulk_sent(made, 2 * ROUND) == []


def test_bulk_that_was_sent_is_evicted_before_bulk_that_was_not() -> None:
    made = spreading()
    for seq in range(8):
        made.push(bulk(seq), src=None, now_ns=0, bulk_from_ns=seq)
    assert bulk_sent(made, 0) == [0]
    assert made.push(bulk(9), src=None, now_ns=1, bulk_from_ns=1) is None
    assert key_of_packet(bulk(0)) not in made
    assert key_of_packet(bulk(7)) in made


@pytest.mark.parametrize("seed", range(10))
def test_of_all_packets_the_one_is_evicted_that_is_missed_least(seed: int) -> None:
    draw = random.Random(seed)
    made, kept = spreading(), dict[int, tuple[int, bool, int]]()
    # of each packet kept: its priority, whether it was sent, and its birth
    for seq in range(300):
        what, origin_us = draw.choice(("report", "bulk", "send")), draw.randrange(20)
        if what == "send":
            wanted = made.wanted(nodes((2, 3)), start_ns=0)
            for sent in draw.sample(wanted, min(1, len(wanted))):
                priority, _, birth_us = kept[key_of_packet(sent)]
                kept[key_of_packet(sent)] = priority, True, birth_us
                made.sent(sent, start_ns=ROUND)
            continue
        priority = wire.PRIORITY_BULK if what == "bulk" else wire.PRIORITY_REPORT
        new = packet(seq, priority=priority, origin_us=origin_us)
        kept[key_of_packet(new)] = priority, False, origin_us
        least = max(kept, key=lambda key: (kept[key][0], kept[key][1], -kept[key][2] if kept[key][1] else kept[key][2]))
        evicted = made.push(new, src=None, now_ns=0, bulk_from_ns=0 if what == "bulk" else None)
        if len(kept) > CAPACITY:
            _, was_sent, _ = kept.pop(least)
            assert least not in made
            assert (evicted is None) == was_sent
        assert all(key in made for key in kept)


def test_what_is_sent_once_is_not_repeated_though_somebody_may_lack_it() -> None:
    made = spreading(repeats=3)
    made.push(packet(1), src=None, now_ns=0, once=True)
    assert [sent_in_turn(made, turn) for turn in range(1, 6)] == [[1], [], [], [], []]


def test_new_urgent_packets_go_before_those_that_are_sent_again() -> None:
    made = spreading()
    made.push(packet(1), src=None, now_ns=0)
    assert sent_in_turn(made, 1) == [1]
    made.push(packet(2), src=None, now_ns=ROUND)
    assert sent_in_turn(made, 3) == [2, 1]


def test_where_frames_are_lost_a_packet_is_sent_again_at_growing_intervals() -> None:
    made = spreading(lossy=True, near={3: (1,)})
    made.push(packet(1), src=2, now_ns=0)
    assert [turn for turn in range(1, 16) if sent_in_turn(made, turn)] == [1, 2, 4, 8]


def test_where_frames_are_lost_it_is_enough_that_two_are_heard_that_reach_a_neighbor() -> None:
    for others, again in (((2,), True), ((2, 4), False)):
        made = spreading(lossy=True, near={2: (1, 3), 4: (1, 3), 3: (1, 2, 4)})
        made.push(packet(1), src=others[0], now_ns=0)
        sent_in_turn(made, 1, neighbors=(2, 3, 4))
        for other in others[1:]:
            made.on_copy(key_of_packet(packet(1)), other, neighbors=nodes((2, 3, 4)), now_ns=ROUND + 10)
        assert any(sent_in_turn(made, turn, neighbors=(2, 3, 4)) for turn in range(2, 6)) is again


def test_a_neighbor_that_is_seldom_heard_is_left_to_those_that_hear_it() -> None:
    for near, again in (({3: (1,)}, True), ({3: (1, 5)}, False)):
        made = spreading(lossy=True, near=near)
        for seq in range(1, 60):
            made.push(packet(seq), src=2, now_ns=0)
            for turn in range(10 * seq, 10 * seq + 9):
                found = sent_in_turn(made, turn)
        made.push(packet(60), src=2, now_ns=0)
        found = [sent_in_turn(made, turn) for turn in range(600, 604)]
        assert (len([one for one in found if 60 in one]) > 1) is again


def bulk_turns(made: Spreading, turns: Iterable[int], *, neighbors: tuple[int, ...] = (2, 3)) -> list[int]:
    """The rounds in which bulk is sent, by a host that looks again a round after each."""
    found = []
    for turn in turns:
        chosen = made.next_bulk(nodes(neighbors), start_ns=turn * ROUND)
        if chosen is not None:
            made.sent(chosen, start_ns=turn * ROUND)
            made.look_again(chosen, from_ns=(turn + 1) * ROUND)
            found.append(turn)
    return found


def test_bulk_that_a_neighbor_lacks_is_sent_once_and_repeated_as_often_as_was_asked_for() -> None:
    for repeats in (0, 1, 3):
        made = spreading(repeats=repeats)
        made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=ROUND)
        assert bulk_turns(made, range(1, 12)) == list(range(1, 2 + repeats))
        assert key_of_packet(bulk(1)) not in made, "then it is forgotten"


def test_bulk_has_its_instant_and_the_host_is_told_of_it() -> None:
    made = spreading()
    assert made.bulk_due_ns(nodes((2, 3))) is None
    made.push(bulk(1), src=2, now_ns=0, bulk_from_ns=5 * ROUND)
    assert made.bulk_due_ns(nodes((2, 3))) == 5 * ROUND
    assert made.next_bulk(nodes((2, 3)), start_ns=5 * ROUND - 1) is None
    assert made.next_bulk(nodes((2, 3)), start_ns=5 * ROUND) == bulk(1)


def test_what_waits_is_what_was_never_sent() -> None:
    made = spreading()
    made.push(packet(1), src=2, now_ns=0)
    made.push(bulk(2), src=2, now_ns=0, bulk_from_ns=ROUND)
    made.push(bulk(3), src=2, now_ns=0, bulk_from_ns=90 * ROUND)
    assert made.waiting() == 3
    assert sent_in_turn(made, 1) == [1]
    assert made.waiting() == 2
    assert bulk_turns(made, [1]) == [1]
    assert (made.waiting(), made.repeated) == (1, 0)
    assert bulk_turns(made, [2]) == [2]
    assert (made.waiting(), made.repeated) == (1, 1)


def test_in_a_bulk_slot_go_the_urgent_packets_that_fit_and_they_go_in_the_turn_as_well() -> None:
    made = spreading()
    for seq, priority in ((1, wire.PRIORITY_REPORT), (2, wire.PRIORITY_SAFETY), (3, wire.PRIORITY_REPORT)):
        made.push(packet(seq, priority=priority, origin_us=seq), src=None, now_ns=0)
    size = len(packet(1).frame)
    assert [one.header.seq for one in made.take_hasty(2 * size, nodes((2, 3)))] == [2, 1]
    assert made.bulk_due_ns(nodes((2, 3))) == 0
    assert [one.header.seq for one in made.take_hasty(size - 1, nodes((2, 3)))] == []
    assert [one.header.seq for one in made.take_hasty(size, nodes((2, 3)))] == [3]
    assert made.take_hasty(10 * size, nodes((2, 3))) == []
    assert made.bulk_due_ns(nodes((2, 3))) is None
    assert sent_in_turn(made, 1) == [2, 1, 3]
    made.push(packet(4), src=None, now_ns=0)
    made.went_ahead(packet(4))
    assert made.take_hasty(10 * size, nodes((2, 3))) == []
    assert sent_in_turn(made, 2, neighbors=(2,)) == [2, 4, 1, 3], "new before again, if as urgent"


def test_a_packet_that_expires_is_forgotten_and_it_is_said_whether_it_was_ever_sent() -> None:
    made = spreading()
    for seq in (1, 2):
        made.push(packet(seq), src=2, now_ns=0)
    sent_in_turn(made, 1)
    made.push(packet(3), src=2, now_ns=0)
    assert [made.forget(packet(seq)) for seq in (1, 3)] == [False, True]
    assert [key_of_packet(packet(seq)) in made for seq in (1, 2, 3)] == [False, True, False]
    assert made.waiting() == 0


def test_what_was_taken_lately_is_told_whether_it_is_kept_or_done() -> None:
    made = spreading()
    made.push(packet(1), src=2, now_ns=5 * MS)
    made.push(packet(2), src=2, now_ns=6 * MS)
    made.on_copy(key_of_packet(packet(1)), 3, neighbors=nodes((2, 3)), now_ns=7 * MS)
    sent_in_turn(made, 1)
    sent_in_turn(made, 2)
    keys = [key_of_packet(packet(seq)) for seq in (1, 2)]
    assert [key in made for key in keys] == [False, True]
    assert sorted(made.recent(4 * MS)) == sorted(keys)
    assert made.recent(5 * MS) == [keys[1]]
    assert made.recent(6 * MS) == []
    old = packet(9, origin_us=7)
    made.push(old, src=2, now_ns=0)
    assert made.made_ns(key_of_packet(old)) == 7000
    assert made.made_ns(keys[0]) == 0
    assert made.made_ns(12345) == -math.inf


def test_an_urgent_packet_that_every_neighbor_has_before_the_turn_is_not_sent_but_told_of() -> None:
    made, key = spreading(), key_of_packet(packet(1))
    made.push(packet(1), src=2, now_ns=0)
    assert made.spared(nodes((2, 3))) == [], "3 lacks it, as far as this node knows"
    made.on_copy(key, 3, neighbors=nodes((2, 3)), now_ns=10)
    assert made.take_hasty(1000, nodes((2, 3))) == []
    assert made.spared(nodes((2, 3))) == [key]
    assert sent_in_turn(made, 1) == []
    made.push(packet(2), src=None, now_ns=20)
    assert made.spared(0) == [], "whoever comes near may lack it"


def test_where_frames_are_lost_at_random_each_node_sends_once_so_that_all_see_whom_they_hear() -> None:
    made = spreading(lossy=True)
    made.push(packet(1), src=2, now_ns=0)
    made.on_copy(key_of_packet(packet(1)), 3, neighbors=nodes((2, 3)), now_ns=10)
    assert made.spared(nodes((2, 3))) == []
    assert sent_in_turn(made, 1) == [1]


def test_a_node_whose_queue_was_full_once_keeps_no_more_for_each_later_packet() -> None:
    made = spreading()
    for seq in range(2 * CAPACITY):
        made.push(packet(seq), src=None, now_ns=0)
    for seq in range(2 * CAPACITY, 1000):
        for sent in made.wanted(nodes((2, 3)), start_ns=0):
            made.sent(sent, start_ns=0)
            made.forget(sent)
        made.push(packet(seq), src=None, now_ns=0)
    assert entries([made]).total() < 10 * CAPACITY
