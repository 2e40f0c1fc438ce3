"""OLSR against RFC 3626, 3.4, 9 and 10: topology, forwarding and routes. Each test is a rule, on a bench of nodes."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from olsr_bench import CHOSE_US, FIFTEEN_S, HELLO_TYPE, SEES_US, TC_TYPE, MakeBench, benches, hello, hops
from rival_bench import Bench

from fanet_mw.routing.olsr import parameters as p
from fanet_mw.routing.olsr.messages import TC, TopologyControl, decode_time
from fanet_mw.routing.olsr.protocol import routing_table
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    return benches(make_scenario)


def tcs(found: Bench, node: int, origin: int, since_ns: int = 0) -> list[TopologyControl]:
    sent = found.controls(TC, node=node, since_ns=since_ns)
    return [TopologyControl.decode(body) for frame, body in sent if frame.header.origin == origin]


# --- the whole --------------------------------------------------------------------------------------------------------


def test_a_line_of_five_learns_its_topology_and_carries_data(bench: MakeBench) -> None:
    found = bench()
    found.advance(25 * S)
    assert [hops(found, 1, node) for node in (2, 3, 4, 5)] == [(2, 1), (2, 2), (2, 3), (2, 4)]
    seq = found.send(1, 5)
    found.advance(1 * S)
    assert found.deliveries == [(5, 1, seq, 4)]
    assert [sent.dst for sent in found.data(seq, 1)] == [2, 3, 4, 5]


def test_data_for_whom_nothing_is_known_is_dropped_at_once(bench: MakeBench) -> None:
    found = bench()
    found.send(1, 5)
    assert found.nodes[1].dropped == {"no_route": 1}
    assert found.protocol(1).waiting() == 0


# --- 9 topology control -----------------------------------------------------------------------------------------------


def test_9_2_only_a_node_that_was_chosen_sends_topology_and_advertises_who_chose_it(bench: MakeBench) -> None:
    found = bench(3)
    found.advance(30 * S)
    assert not tcs(found, 1, 1)
    assert tcs(found, 2, 2)[-1].advertised == (1, 3)
    assert 4 <= len(tcs(found, 2, 2)) <= 8


def test_9_2_another_set_of_selectors_is_another_number(bench: MakeBench) -> None:
    found = bench(4, links=[(1, 2), (2, 3)])
    found.advance(30 * S)
    before = tcs(found, 2, 2)[-1]
    assert tcs(found, 2, 2)[-2].ansn == before.ansn
    found.connect(2, 4)
    found.advance(20 * S)
    after = tcs(found, 2, 2)[-1]
    assert set(after.advertised) == {1, 3, 4}
    assert after.ansn > before.ansn


def test_9_3_a_node_whose_selectors_have_gone_says_so_for_the_holding_time(bench: MakeBench) -> None:
    found = bench(3)
    found.advance(30 * S)
    cut_ns = found.now_ns
    found.cut(1, 2)
    found.cut(2, 3)
    found.advance(40 * S)
    empty = [s.t_ns for s, body in found.controls(TC, node=2) if not TopologyControl.decode(body).advertised]
    assert 2 <= len(empty) <= 5
    assert max(empty) <= cut_ns + p.NEIGHB_HOLD_TIME_NS + 2 * p.TC_INTERVAL_NS + p.TOP_HOLD_TIME_NS


def tc(ansn: int, *advertised: int) -> bytes:
    return TopologyControl(FIFTEEN_S, ansn, advertised).encode()


def topology(found: Bench) -> list[tuple[int, int]]:
    return found.protocol(1)._state.topology(now_ns=found.now_ns)


def test_9_5_topology_counts_only_from_a_symmetric_neighbor_and_may_come_again_from_one(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.say(3, TC_TYPE, tc(1, 8), to=1, origin=9, ttl=5)
    assert topology(found) == []
    found._forged_seq -= 1  # the same message, over another neighbor
    found.say(2, TC_TYPE, tc(1, 8), to=1, origin=9, ttl=5)
    assert topology(found) == [(9, 8)]


def test_9_5_a_newer_number_replaces_what_its_sender_said_and_an_older_one_is_ignored(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    for ansn, advertised in ((0xFFFF, [7, 8]), (0, [8]), (0xFFFE, [5])):
        found.say(2, TC_TYPE, tc(ansn, *advertised), to=1, origin=9, ttl=5)
    assert topology(found) == [(9, 8)], "0 comes after 0xFFFF"
    found.say(2, TC_TYPE, tc(0, 6), to=1, origin=9, ttl=5)
    assert topology(found) == [(9, 6), (9, 8)], "the same number: another part"


def test_9_5_topology_ends_with_its_validity(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US, vtime=0x0F), to=1)
    found.say(2, TC_TYPE, tc(1, 8), to=1, origin=9, ttl=5)
    found.advance(decode_time(FIFTEEN_S))
    assert topology(found) == [(9, 8)]
    found.advance(1 * MS)
    assert topology(found) == []


# --- 3.4 forwarding ---------------------------------------------------------------------------------------------------


def relayed(found: Bench) -> int:
    return len([sent for sent, _ in found.controls(TC, node=1) if sent.header.origin == 9])


def test_3_4_1_a_message_is_relayed_only_for_whom_we_are_a_relay_of(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.say(3, HELLO_TYPE, hello(CHOSE_US), to=1)
    found.say(2, TC_TYPE, tc(1, 8), to=1, origin=9, ttl=5)
    found.advance(1 * S)
    assert relayed(found) == 0
    found.say(3, TC_TYPE, tc(2, 8), to=1, origin=9, ttl=5)
    found.advance(1 * S)
    assert relayed(found) == 1


def test_3_4_1_a_relayed_message_keeps_its_bytes_and_has_one_hop_more_and_one_ttl_less(bench: MakeBench) -> None:
    found = bench(1)
    found.say(3, HELLO_TYPE, hello(CHOSE_US), to=1)
    found.say(3, TC_TYPE, tc(2, 8), to=1, origin=9, ttl=5, hops=2)
    heard_ns = found.now_ns
    found.advance(1 * S)
    ((sent, body),) = [entry for entry in found.controls(TC, node=1) if entry[0].header.origin == 9]
    assert body == tc(2, 8)
    assert (sent.header.hop_limit, sent.header.hops) == (4, 3)
    assert 0 <= sent.t_ns - heard_ns <= p.MAXJITTER_NS


def test_3_4_a_message_is_handled_once_and_one_whose_time_to_live_is_over_goes_no_further(bench: MakeBench) -> None:
    found = bench(1)
    found.say(3, HELLO_TYPE, hello(CHOSE_US), to=1)
    found.say(3, TC_TYPE, tc(2, 8), to=1, origin=9, ttl=5)
    found._forged_seq -= 1
    found.say(3, TC_TYPE, tc(2, 8), to=1, origin=9, ttl=5)
    found.say(3, TC_TYPE, tc(3, 8), to=1, origin=9, ttl=1)
    found.advance(1 * S)
    assert relayed(found) == 1
    assert topology(found) == [(9, 8)]


def test_broadcast_data_is_relayed_by_relays_only_and_reaches_everyone(bench: MakeBench) -> None:
    """Five around one: in the middle stands the only relay that anyone needs."""
    found = bench(6, links=[(1, other) for other in range(2, 7)] + [(2, 3), (3, 4), (4, 5), (5, 6)])
    found.advance(20 * S)
    seq = found.send(2)
    found.advance(1 * S)
    assert sorted(node for node, *_ in found.deliveries) == [1, 3, 4, 5, 6]
    senders = {sent.node for sent in found.data(seq, 2)}
    assert {1, 2} <= senders
    assert len(senders) <= 4


# --- 10 routing table -------------------------------------------------------------------------------------------------


def table(neighbors: dict[int, list[int]], links: list[tuple[int, int]], **willing: int) -> dict[int, tuple[int, int]]:
    known = {NodeId(n): [NodeId(far) for far in reach] for n, reach in neighbors.items()}
    willingness = {NodeId(n): willing.get(f"n{n}", p.WILL_DEFAULT) for n in neighbors}
    topology = sorted((NodeId(a), NodeId(b)) for a, b in links)
    routes = routing_table(NodeId(1), known, willingness, topology)
    return {int(n): (int(route.next_hop), route.hops) for n, route in routes.items()}


def test_10_neighbors_then_two_hops_then_topology() -> None:
    found = table({2: [1, 3]}, [(3, 4), (4, 5), (9, 8)])
    assert found == {2: (2, 1), 3: (2, 2), 4: (2, 3), 5: (2, 4)}, "9 is a last hop that nobody reaches"


def test_10_the_shortest_way_wins() -> None:
    found = table({2: [3], 6: [7]}, [(3, 4), (4, 5), (7, 5), (5, 4)])
    assert found[5] == (6, 3)
    assert found[4] == (2, 3)


def test_10_no_two_hop_route_leads_over_a_neighbor_that_is_never_willing() -> None:
    found = table({2: [9], 3: [9]}, [], n2=p.WILL_NEVER)
    assert found == {2: (2, 1), 3: (3, 1), 9: (3, 2)}


@given(st.sets(st.tuples(st.integers(1, 8), st.integers(1, 8)).filter(lambda e: e[0] != e[1]), max_size=20))
def test_10_with_the_whole_topology_known_every_route_has_the_fewest_hops(edges: set[tuple[int, int]]) -> None:
    linked = edges | {(b, a) for a, b in edges}
    near = {n: sorted(b for a, b in linked if a == n) for n in range(1, 9)}
    found = table({n: near[n] for n in near[1]}, sorted(linked))
    fewest = {1: 0}
    for depth in range(8):
        for node in [n for n, d in fewest.items() if d == depth]:
            for other in near[node]:
                fewest.setdefault(other, depth + 1)
    assert {n: h for n, (_, h) in found.items()} == {n: d for n, d in fewest.items() if n != 1}


def test_10_a_route_ends_with_the_link_it_starts_on(bench: MakeBench) -> None:
    found = bench(3)
    found.advance(20 * S)
    assert hops(found, 1, 3) == (2, 2)
    found.cut(1, 2)
    found.advance(6 * S + 10 * MS)
    assert hops(found, 1, 3) is None
