"""AODV against RFC 3561, 6.8 to 6.11: how routes are kept and lost. Each test is a rule, on a bench of nodes."""

from collections.abc import Callable

import pytest
from aodv_bench import ANSWER, ASK, ERROR, MakeBench, active, answer, ask, benches, errors, hellos, replies, route
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.routing.aodv import parameters as p
from fanet_mw.routing.aodv.messages import RouteError, RouteReply, Unreachable
from fanet_mw.routing.aodv.protocol import HelloNeighbors
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, S


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    return benches(make_scenario)


# --- 6.8 unidirectional links -----------------------------------------------------------------------------------------


def test_6_8_a_neighbor_that_replies_do_not_reach_is_blacklisted_for_a_while(bench: MakeBench) -> None:
    found = bench(2, links=[])
    found.say(7, ASK, ask(destination=1, originator=7), to=1, ttl=1)
    found.advance(100 * MS)
    assert len(replies(found, node=1)) == 1, "7 is not on the bench: its acknowledgment never comes"
    found.say(7, ASK, ask(destination=1, originator=7, rreq_id=2), to=1, ttl=1)
    found.advance(100 * MS)
    assert len(replies(found, node=1)) == 1
    found.advance(p.BLACKLIST_TIMEOUT_NS)
    found.say(7, ASK, ask(destination=1, originator=7, rreq_id=3), to=1, ttl=1)
    found.advance(100 * MS)
    assert len(replies(found, node=1)) == 2


# --- 6.9 hellos -------------------------------------------------------------------------------------------------------


def test_6_9_only_a_node_on_an_active_route_says_hello(bench: MakeBench) -> None:
    found = bench(4, links=[(1, 2), (2, 3)])
    found.advance(5 * S)
    assert not any(hellos(found, node) for node in (1, 2, 3, 4))
    for _ in range(10):
        found.send(1, 3)
        found.advance(1 * S)
    assert all(8 <= len(hellos(found, node, 5 * S)) <= 11 for node in (2, 3))
    assert not hellos(found, 4)


def test_6_9_a_broadcast_stands_in_for_a_hello(bench: MakeBench) -> None:
    found = bench(1)
    found.protocol(1)._in_use_until_ns = 100 * S
    for i in range(20):
        found.say(2, ASK, ask(rreq_id=i), to=1, ttl=5)
        found.advance(500 * MS)
    assert not hellos(found, 1, 1 * S)
    found.advance(5 * S)
    assert len(hellos(found, 1, 10 * S)) in (4, 5)


def test_6_9_a_hello_makes_a_route_to_its_sender_with_its_number(bench: MakeBench) -> None:
    found = bench(1)
    found.say(7, ANSWER, RouteReply(0, 7, 33, 7, 2000).encode(), to=1)
    known = route(found, 1, 7)
    assert known is not None
    assert (known.next_hop, known.hops, known.seq, known.seq_valid) == (7, 1, 33, True)
    assert known.ends_ns == p.ALLOWED_HELLO_LOSS * p.HELLO_INTERVAL_NS


def test_6_9_a_neighbor_whose_hellos_stop_is_lost_after_the_allowed_loss(bench: MakeBench) -> None:
    found = bench(1)
    found.say(7, ANSWER, RouteReply(0, 7, 33, 7, 2000).encode(), to=1)
    found.say(7, ANSWER, answer(hop_count=2, lifetime_ms=60_000), to=1)
    found.advance(1900 * MS)
    assert active(found, 1, 9) == (7, 3)
    found.say(7, ASK, ask(), to=1)  # any packet of a neighbor counts
    found.advance(1900 * MS)
    assert active(found, 1, 9) == (7, 3)
    found.advance(200 * MS)
    assert active(found, 1, 9) is None


@given(
    st.lists(
        st.tuples(st.sampled_from(["hello", "packet", "forget", "look"]), st.integers(1, 2), st.integers(0, 3)),
        min_size=20,
    )
)
def test_6_9_only_hellos_make_neighbors_and_silence_ends_them(events: list[tuple[str, int, int]]) -> None:
    """As by looking at all of them at each instant; `next_ns` never lets a loss pass."""
    known, ends_ns, now_ns = HelloNeighbors(), dict[int, int](), 0
    for event, node, steps in events:
        now_ns += steps * p.NEIGHBOR_LIFETIME_NS // 4
        gone = {node for node, end_ns in ends_ns.items() if end_ns <= now_ns}
        due_ns = known.next_ns()
        assert not gone or (due_ns is not None and due_ns <= now_ns)
        assert known.lost(now_ns) == sorted(gone)
        ends_ns = {node: end_ns for node, end_ns in ends_ns.items() if node not in gone}
        match event:
            case "hello":
                known.on_hello(node, now_ns=now_ns)
                ends_ns[node] = now_ns + p.NEIGHBOR_LIFETIME_NS
            case "packet":
                known.on_packet(node, now_ns=now_ns)
                if node in ends_ns:
                    ends_ns[node] = now_ns + p.NEIGHBOR_LIFETIME_NS
            case "forget":
                known.forget(node)
                ends_ns.pop(node, None)
        due_ns = known.next_ns()
        assert due_ns is None or due_ns > now_ns, "all that were due have been looked at"


# --- 6.11 errors ------------------------------------------------------------------------------------------------------


def test_6_11_i_a_unicast_that_is_not_acknowledged_breaks_the_routes_over_that_neighbor(bench: MakeBench) -> None:
    found = bench()
    found.send(1, 5)
    found.advance(2 * S)
    before = route(found, 3, 5)
    assert before is not None
    number = before.seq
    found.cut(3, 4)
    found.send(1, 5)
    found.advance(100 * MS)
    broken = route(found, 3, 5)
    assert broken is not None
    assert (broken.active, broken.seq) == (False, number + 1)
    assert found.nodes[3].dropped["retry_limit"] == 1
    ((dst, error),) = errors(found, 3)
    assert dst == 2, "one precursor: unicast"
    assert Unreachable(5, number + 1) in error.unreachable
    assert active(found, 1, 5) is None, "and it went on to the source"


def test_6_11_a_source_that_is_told_searches_again_and_finds_another_way(bench: MakeBench) -> None:
    found = bench(6, links=[(1, 2), (2, 3), (3, 5), (1, 6)])
    found.send(1, 5)
    found.advance(2 * S)
    found.cut(3, 5)
    found.connect(6, 4)
    found.connect(4, 5)
    found.send(1, 5)
    found.advance(1 * S)
    last = found.send(1, 5)
    found.advance(2 * S)
    assert found.deliveries[-1][:3] == (5, 1, last)
    assert [sent.node for sent in found.data(last, 1)] == [1, 6, 4]


@pytest.mark.parametrize("known", [True, False])
def test_6_11_ii_data_without_a_route_is_dropped_and_its_sender_told_the_newest_number(
    bench: MakeBench, known: bool
) -> None:
    found = bench(3)
    found.send(1, 3)
    found.advance(2 * S)
    table = found.protocol(2)._table
    stale = table.active(3, now_ns=found.now_ns)
    assert stale is not None
    table.invalidate(stale, now_ns=found.now_ns)
    number = stale.seq + 1 if known else 0
    if not known:
        del table._routes[3]
    found.send(1, 3)
    found.advance(100 * MS)
    assert found.nodes[2].dropped["no_route"] == 1
    assert errors(found, 2) == [(1, RouteError((Unreachable(3, number),)))]
    assert active(found, 1, 3) is None


def test_6_11_iii_an_error_counts_only_from_the_next_hop_and_is_passed_on_to_precursors(bench: MakeBench) -> None:
    found = bench(1)
    for neighbor in (2, 3, 4):
        found.connect(1, neighbor)
    found.say(3, ANSWER, answer(hop_count=3), to=1)
    found.say(2, ASK, ask(), to=1, ttl=5)
    error = RouteError((Unreachable(9, 25), Unreachable(77, 1))).encode()
    found.say(5, ERROR, error, to=1)
    assert active(found, 1, 9) == (3, 4)
    found.say(3, ERROR, error, to=1)
    known = route(found, 1, 9)
    assert known is not None
    assert (known.active, known.seq) == (False, 25)
    found.advance(100 * MS)
    assert errors(found) == [(2, RouteError((Unreachable(9, 25),)))]


def test_6_11_an_error_for_several_precursors_is_broadcast(bench: MakeBench) -> None:
    found = bench(1)
    for neighbor in (2, 3, 4):
        found.connect(1, neighbor)
    found.say(3, ANSWER, answer(hop_count=3), to=1)
    found.say(2, ASK, ask(), to=1, ttl=5)
    found.say(4, ASK, ask(originator=6), to=1, ttl=5)
    found.say(3, ERROR, RouteError((Unreachable(9, 25),)).encode(), to=1)
    found.advance(100 * MS)
    assert [dst for dst, _ in errors(found)] == [BROADCAST]


def test_6_11_no_more_than_ten_errors_a_second(bench: MakeBench) -> None:
    found = bench(1)
    found.say(3, ANSWER, answer(lifetime_ms=60_000), to=1)
    for i in range(30):
        found.say(2, ASK, ask(rreq_id=i, destination=9), to=1, ttl=5)
        found.say(3, ERROR, RouteError((Unreachable(9, 25 + 2 * i),)).encode(), to=1)
        found.say(3, ANSWER, answer(destination_seq=26 + 2 * i), to=1)
    found.advance(500 * MS)
    assert len(errors(found)) == p.RERR_RATELIMIT
