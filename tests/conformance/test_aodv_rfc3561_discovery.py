"""AODV against RFC 3561, 6.1 to 6.7: how routes are found. Each test is a rule, on a bench of nodes."""

from collections.abc import Callable

import pytest
from aodv_bench import ANSWER, ASK, LINE, MakeBench, active, answer, ask, benches, replies, requests, route
from rival_bench import Bench

from fanet_mw.routing.aodv import parameters as p
from fanet_mw.routing.aodv.messages import DESTINATION_ONLY, RREQ, UNKNOWN_SEQUENCE, RouteReply
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, S


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    return benches(make_scenario)


# --- the whole --------------------------------------------------------------------------------------------------------


def test_a_packet_finds_its_way_over_four_hops_and_the_next_one_needs_no_request(bench: MakeBench) -> None:
    found = bench()
    first = found.send(1, 5)
    found.advance(3 * S)
    asked = len(requests(found))
    second = found.send(1, 5)
    found.advance(1 * S)
    assert found.deliveries == [(5, 1, first, 4), (5, 1, second, 4)]
    assert len(requests(found)) == asked
    assert [sent.dst for sent in found.data(second, 1)] == [2, 3, 4, 5], "acknowledged unicast, hop by hop"


# --- broadcast data ---------------------------------------------------------------------------------------------------


def test_a_broadcast_is_flooded_once_by_every_node(bench: MakeBench) -> None:
    found = bench(5, links=[*LINE, (1, 3), (2, 4)])
    seq = found.send(1)
    found.advance(1 * S)
    assert sorted(node for node, *_ in found.deliveries) == [2, 3, 4, 5]
    assert sorted(sent.node for sent in found.data(seq, 1)) == [1, 2, 3, 4, 5]


# --- 6.1 sequence numbers ---------------------------------------------------------------------------------------------


def test_6_1_a_node_increments_its_own_number_before_each_request(bench: MakeBench) -> None:
    found = bench(1)
    found.send(1, 5)
    found.advance(1 * S)
    numbers = [request.originator_seq for _, request in requests(found)]
    assert len(numbers) >= 3
    assert numbers == list(range(1, len(numbers) + 1))


def test_6_1_the_destination_answers_with_the_larger_of_its_own_and_the_requested_number(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(destination=1, flags=0, destination_seq=41), to=1)
    found.say(2, ASK, ask(destination=1, flags=0, destination_seq=30, rreq_id=2), to=1)
    found.advance(10 * MS)
    assert [reply.destination_seq for _, reply in replies(found)] == [41, 41]


def test_6_1_numbers_are_compared_as_signed_so_that_they_may_wrap(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(destination_seq=0xFFFF_FFFE), to=1)
    found.say(3, ANSWER, answer(destination_seq=3, hop_count=6), to=1)
    assert active(found, 1, 9) == (3, 7), "3 comes after 0xFFFFFFFE"
    found.say(2, ANSWER, answer(destination_seq=0xFFFF_FFFF), to=1)
    assert active(found, 1, 9) == (3, 7)


# --- 6.2 the table ----------------------------------------------------------------------------------------------------


def test_6_2_at_the_same_number_only_fewer_hops_replace_a_route(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(hop_count=4), to=1)
    found.say(3, ANSWER, answer(hop_count=4), to=1)
    assert active(found, 1, 9) == (2, 5)
    found.say(3, ANSWER, answer(hop_count=3), to=1)
    assert active(found, 1, 9) == (3, 4)


def test_6_2_a_newer_number_replaces_a_shorter_route_and_an_older_one_never_does(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(), to=1)
    found.say(3, ANSWER, answer(destination_seq=21, hop_count=9), to=1)
    assert active(found, 1, 9) == (3, 10)
    found.say(2, ANSWER, answer(), to=1)
    assert active(found, 1, 9) == (3, 10)


def test_6_2_data_keeps_a_route_and_its_silence_lets_it_expire(bench: MakeBench) -> None:
    found = bench(3)
    found.send(1, 3)
    found.advance(1 * S)
    asked = len(requests(found))
    for _ in range(15):
        found.send(1, 3)
        found.advance(1 * S)
    assert len(requests(found)) == asked, "kept beyond the lifetime it was given"
    assert active(found, 2, 3) == (3, 1)
    assert active(found, 3, 1) == (2, 2)
    found.advance(p.ACTIVE_ROUTE_TIMEOUT_NS + p.MY_ROUTE_TIMEOUT_NS)
    for node, destination in ((1, 3), (2, 3), (2, 1), (3, 1)):
        assert active(found, node, destination) is None


def test_6_1_an_expired_route_keeps_its_number_until_it_is_deleted(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(lifetime_ms=1000), to=1)
    found.advance(1500 * MS)
    known = route(found, 1, 9)
    assert known is not None
    assert (known.active, known.seq) == (False, 20)
    found.advance(p.DELETE_PERIOD_NS)
    assert route(found, 1, 9) is None


# --- 6.3 requests -----------------------------------------------------------------------------------------------------


def test_6_3_a_request_for_an_unknown_destination_says_so_and_one_for_a_known_carries_the_last_number(
    bench: MakeBench,
) -> None:
    found = bench(1)
    found.send(1, 9)
    found.advance(20 * MS)
    assert requests(found)[0][1].flags & UNKNOWN_SEQUENCE
    found.say(2, ANSWER, answer(lifetime_ms=500), to=1)
    found.advance(2 * S)
    found.send(1, 9)
    found.advance(20 * MS)
    last = requests(found)[-1][1]
    assert not last.flags & UNKNOWN_SEQUENCE
    assert last.destination_seq >= 20


def test_6_3_packets_wait_for_the_route_and_go_in_their_order(bench: MakeBench) -> None:
    found = bench(3)
    wanted = [found.send(1, 3) for _ in range(5)]
    found.advance(2 * S)
    assert [seq for _, _, seq, _ in found.deliveries] == wanted


def test_6_3_after_the_last_retry_at_full_width_the_waiting_packets_are_dropped(bench: MakeBench) -> None:
    found = bench(1)
    found.send(1, 9)
    found.send(1, 9)
    found.advance(20 * S)
    assert [ttl for ttl, _ in requests(found)] == [1, 3, 5, 7, 35, 35]
    assert found.nodes[1].dropped == {"no_route": 2}
    assert found.protocol(1).waiting() == 0


def test_6_3_the_waiting_time_at_full_width_doubles(bench: MakeBench) -> None:
    found = bench(1)
    found.send(1, 9)
    found.advance(3 * S)
    found.advance(1 * S)
    times = [sent.t_ns for sent, _ in found.controls(RREQ)]
    assert len(times) == 5
    while not found.nodes[1].dropped:
        found.advance(10 * MS)
    times = [sent.t_ns for sent, _ in found.controls(RREQ)]
    assert times[5] - times[4] == pytest.approx(p.NET_TRAVERSAL_TIME_NS, abs=11 * MS)
    assert found.now_ns - times[5] == pytest.approx(2 * p.NET_TRAVERSAL_TIME_NS, abs=21 * MS)


def test_6_3_no_more_than_ten_requests_a_second(bench: MakeBench) -> None:
    found = bench(1)
    for destination in range(10, 60):
        found.send(1, destination)
    found.advance(8 * S)
    times = [sent.t_ns for sent, _ in found.controls(RREQ)]
    assert len(times) > 60
    assert all(late - early > 985 * MS for early, late in zip(times, times[10:], strict=False)), "10 ms is jitter"


def test_the_buffer_is_bounded_and_drops_its_oldest(bench: MakeBench) -> None:
    found = bench(1, **{"routing.queue_frames": 3})
    for _ in range(5):
        found.send(1, 9)
    assert found.nodes[1].dropped == {"queue_full": 2}
    assert found.protocol(1).waiting() == 3


# --- 6.4 expanding ring -----------------------------------------------------------------------------------------------


def test_6_4_each_ring_waits_for_its_traversal_time(bench: MakeBench) -> None:
    found = bench(1)
    found.send(1, 9)
    found.advance(3 * S)
    times = [sent.t_ns for sent, _ in found.controls(RREQ)]
    for ttl, early, late in zip((1, 3, 5, 7), times, times[1:], strict=False):
        assert late - early == pytest.approx(2 * p.NODE_TRAVERSAL_TIME_NS * (ttl + p.TIMEOUT_BUFFER), abs=11 * MS)


def test_6_4_a_request_goes_no_further_than_its_ring(bench: MakeBench) -> None:
    found = bench()
    found.send(1, 9)
    found.advance(200 * MS)
    assert {sent.node for sent, _ in found.controls(RREQ)} == {1}, "TTL 1: heard by 2, passed on by nobody"
    found.advance(300 * MS)
    assert {sent.node for sent, _ in found.controls(RREQ)} == {1, 2, 3}, "TTL 3"


def test_6_4_a_former_route_starts_the_ring_beyond_its_hop_count(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(hop_count=2, lifetime_ms=500), to=1)
    found.advance(1 * S)
    found.send(1, 9)
    found.advance(20 * MS)
    assert [ttl for ttl, _ in requests(found)] == [3 + p.TTL_INCREMENT]


# --- 6.5 processing a request -----------------------------------------------------------------------------------------


def test_6_5_a_request_is_passed_on_once_whoever_brings_it_again(bench: MakeBench) -> None:
    found = bench(1)
    for previous in (2, 3, 2):
        found.say(previous, ASK, ask(), to=1, ttl=5)
    found.advance(1 * S)
    assert len(requests(found)) == 1


def test_6_5_the_same_request_id_is_new_again_after_path_discovery_time(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.advance(p.PATH_DISCOVERY_TIME_NS - 1 * MS)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.advance(2 * MS)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.advance(1 * S)
    assert len(requests(found)) == 2


def test_6_5_a_request_makes_the_reverse_route_and_one_to_the_previous_hop_without_a_number(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(hop_count=3), to=1, ttl=5)
    assert active(found, 1, 8) == (2, 4)
    near, far = route(found, 1, 2), route(found, 1, 8)
    assert near is not None
    assert far is not None
    assert (near.hops, near.seq_valid) == (1, False)
    assert (far.seq, far.seq_valid) == (5, True)
    assert far.ends_ns == 2 * p.NET_TRAVERSAL_TIME_NS - 2 * 4 * p.NODE_TRAVERSAL_TIME_NS, "MinimalLifetime"


def test_6_5_a_request_passed_on_has_one_hop_more_one_ttl_less_and_the_newest_number_known(bench: MakeBench) -> None:
    found = bench(1)
    found.say(3, ANSWER, answer(destination_seq=20, lifetime_ms=100), to=1)
    found.advance(200 * MS)
    found.say(2, ASK, ask(hop_count=3, flags=0, destination_seq=7), to=1, ttl=5)
    found.say(2, ASK, ask(rreq_id=2, flags=0, destination_seq=90), to=1, ttl=5)
    found.say(2, ASK, ask(rreq_id=3), to=1, ttl=5)
    found.advance(20 * MS)
    passed = {request.rreq_id: (ttl, request) for ttl, request in requests(found)}
    assert (passed[1][0], passed[1][1].hop_count) == (4, 4)
    assert [passed[i][1].destination_seq for i in (1, 2, 3)] == [20, 90, 20]
    assert not passed[3][1].flags & UNKNOWN_SEQUENCE


def test_6_5_a_request_is_passed_on_after_a_jitter(bench: MakeBench) -> None:
    waits = []
    for _ in range(20):
        found = bench(1)
        found.protocol(1)._random = iter([len(waits) / 20] * 9).__next__
        found.say(2, ASK, ask(), to=1, ttl=5)
        found.advance(1 * S)
        waits.append(found.controls(RREQ)[0][0].t_ns)
    assert waits == sorted(waits)
    assert waits[-1] - waits[0] == pytest.approx(9.5 * MS, rel=0.01)


def test_6_5_our_own_request_coming_back_does_nothing(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(originator=1, rreq_id=77), to=1, ttl=5)
    found.advance(1 * S)
    assert not requests(found)
    assert route(found, 1, 1) is None


# --- 6.6 replies ------------------------------------------------------------------------------------------------------


def test_6_6_1_the_destination_answers_with_no_hops_and_its_own_lifetime_by_unicast(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(destination=1, hop_count=3), to=1, ttl=1)
    found.advance(10 * MS)
    ((dst, reply),) = replies(found)
    assert dst == 2
    assert (reply.hop_count, reply.destination, reply.originator) == (0, 1, 8)
    assert reply.lifetime_ms * MS == p.MY_ROUTE_TIMEOUT_NS


def intermediate(found: Bench, **change: int) -> list[tuple[int, RouteReply]]:
    """Node 1 has a route to 9 over 3 with number 20, four hops; 2 asks on behalf of 8."""
    found.say(3, ANSWER, answer(hop_count=3), to=1)
    found.say(2, ASK, ask(**change), to=1, ttl=5)
    found.advance(10 * MS)
    return replies(found)


def test_6_6_2_a_node_with_a_fresh_route_answers_with_what_is_left_of_it(bench: MakeBench) -> None:
    found = bench(1)
    ((dst, reply),) = intermediate(found, flags=0, destination_seq=20)
    assert dst == 2
    assert (reply.hop_count, reply.destination_seq, reply.lifetime_ms) == (4, 20, 5000)
    assert not requests(found), "an answered request goes no further"


def test_6_6_2_the_two_neighbors_of_an_answer_become_precursors(bench: MakeBench) -> None:
    found = bench(1)
    intermediate(found)
    forward, reverse = route(found, 1, 9), route(found, 1, 8)
    assert forward is not None
    assert reverse is not None
    assert list(forward.precursors) == [2]
    assert list(reverse.precursors) == [3]


def test_6_6_a_route_older_than_asked_for_is_no_answer(bench: MakeBench) -> None:
    found = bench(1)
    assert not intermediate(found, flags=0, destination_seq=21)
    assert len(requests(found)) == 1


def test_6_6_destination_only_is_answered_by_nobody_else(bench: MakeBench) -> None:
    found = bench(1)
    assert not intermediate(found, flags=DESTINATION_ONLY | UNKNOWN_SEQUENCE)
    assert [request.flags & DESTINATION_ONLY for _, request in requests(found)] == [DESTINATION_ONLY]


def test_6_6_3_a_gratuitous_reply_tells_the_destination_of_the_asker(bench: MakeBench) -> None:
    found = bench(1)
    answers = intermediate(found, flags=UNKNOWN_SEQUENCE | 1, hop_count=2)
    ((dst, gratuitous),) = [(dst, reply) for dst, reply in answers if reply.destination == 8]
    assert dst == 3
    assert (gratuitous.originator, gratuitous.hop_count, gratuitous.destination_seq) == (9, 3, 5)


def test_a_node_whose_way_leads_back_to_the_asker_does_not_answer(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ANSWER, answer(hop_count=3), to=1)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.advance(10 * MS)
    assert not replies(found)


# --- 6.7 processing a reply -------------------------------------------------------------------------------------------


def test_6_7_a_reply_is_passed_on_along_the_reverse_route_with_one_hop_more(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.say(3, ANSWER, answer(originator=8, hop_count=1), to=1, ttl=35)
    found.advance(20 * MS)
    ((dst, reply),) = replies(found)
    assert dst == 2
    assert (reply.hop_count, reply.destination, reply.originator) == (2, 9, 8)
    forward, near = route(found, 1, 9), route(found, 1, 3)
    assert forward is not None
    assert near is not None
    assert list(forward.precursors) == [2]
    assert list(near.precursors) == [2]


def test_6_7_a_reply_without_a_reverse_route_ends_here(bench: MakeBench) -> None:
    found = bench(1)
    found.say(3, ANSWER, answer(originator=8), to=1, ttl=35)
    found.advance(20 * MS)
    assert not replies(found)
    assert active(found, 1, 9) == (3, 1)


@pytest.mark.parametrize("kept", [8, 2])
def test_6_7_a_late_reply_keeps_the_way_back_to_the_originator_as_long_as_data_would(
    bench: MakeBench, kept: int
) -> None:
    found = bench(2)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.advance(4 * S)
    known = route(found, 1, 8)
    assert known is not None
    assert known.active
    assert known.ends_ns - found.now_ns < p.ACTIVE_ROUTE_TIMEOUT_NS - S
    found.say(3, ANSWER, answer(originator=8, hop_count=3), to=1, ttl=5)
    found.advance(10 * MS)
    assert (2, 8) in [(dst, reply.originator) for dst, reply in replies(found, node=1)]
    way = route(found, 1, kept)
    assert way is not None
    assert way.active
    assert way.ends_ns - found.now_ns >= p.ACTIVE_ROUTE_TIMEOUT_NS - 20 * MS
