"""OLSR against RFC 3626: each test is a rule, on a bench of nodes whose links the test makes and cuts."""

from collections.abc import Callable
from itertools import combinations, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rival_bench import Bench

from fanet_mw.routing.control import Family, type_of
from fanet_mw.routing.olsr import parameters as p
from fanet_mw.routing.olsr.choice import multipoint_relays, routing_table
from fanet_mw.routing.olsr.messages import (
    HELLO,
    TC,
    Heard,
    Hello,
    Link,
    Neighborhood,
    TopologyControl,
    decode_time,
    encode_time,
)
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S

HELLO_TYPE, TC_TYPE = type_of(Family.OLSR, HELLO), type_of(Family.OLSR, TC)
LINE = [(1, 2), (2, 3), (3, 4), (4, 5)]
SIX_S, FIFTEEN_S = encode_time(6 * S), encode_time(15 * S)

MakeBench = Callable[..., Bench]


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    def make(nodes: int = 5, links: list[tuple[int, int]] | None = None) -> Bench:
        scenario = make_scenario(
            **{"routing.protocol": "olsr", "nodes.count": 100, "radio.lead_ms": 0, "traffic.arrivals": "none"}
        )
        wanted = LINE if links is None else links
        return Bench(scenario, list(range(1, nodes + 1)), [link for link in wanted if max(link) <= nodes])

    return make


def hello(*heard: tuple[Link, Neighborhood, int], willingness: int = 3, vtime: int = SIX_S) -> bytes:
    return Hello(vtime, encode_time(2 * S), willingness, tuple(Heard(*entry) for entry in heard)).encode()


SEES_US = (Link.SYM, Neighborhood.SYM, 1)
CHOSE_US = (Link.SYM, Neighborhood.MPR, 1)
HEARS_US = (Link.ASYM, Neighborhood.NOT, 1)


def with_neighbors(*nodes: int) -> list[tuple[Link, Neighborhood, int]]:
    return [(Link.SYM, Neighborhood.SYM, node) for node in nodes]


def own_hellos(found: Bench, node: int = 1, since_ns: int = 0) -> list[tuple[int, Hello]]:
    return [(s.t_ns, Hello.decode(body)) for s, body in found.controls(HELLO, node=node, since_ns=since_ns)]


def tcs(found: Bench, node: int, origin: int, since_ns: int = 0) -> list[TopologyControl]:
    sent = found.controls(TC, node=node, since_ns=since_ns)
    return [TopologyControl.decode(body) for frame, body in sent if frame.header.origin == origin]


def link(found: Bench, node: int) -> Link | None:
    return found.protocol(1)._state.link_of(node, now_ns=found.now_ns)


def hops(found: Bench, node: int, destination: int) -> tuple[int, int] | None:
    route = found.protocol(node)._route(NodeId(destination), now_ns=found.now_ns)
    return None if route is None else (route.next_hop, route.hops)


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


# --- 18.3 times -------------------------------------------------------------------------------------------------------


@given(st.integers(S // 16, 3968 * S))
def test_18_3_a_time_survives_its_byte_rounded_up_by_less_than_a_sixteenth(duration_ns: int) -> None:
    code = encode_time(duration_ns)
    assert 0 <= code <= 255
    assert duration_ns <= decode_time(code) <= duration_ns * 17 / 16 + 1


def test_18_3_the_holding_times_have_the_codes_of_the_rfc() -> None:
    assert (encode_time(2 * S), encode_time(6 * S), encode_time(15 * S)) == (0x05, 0x86, 0xE7)


# --- 6, 7 hellos and links --------------------------------------------------------------------------------------------


def test_6_2_hellos_go_every_two_seconds_shortened_by_a_jitter_of_up_to_a_quarter(bench: MakeBench) -> None:
    found = bench(1)
    found.advance(60 * S)
    times = [t_ns for t_ns, _ in own_hellos(found)]
    gaps = [late - early for early, late in pairwise(times)]
    assert all(1500 * MS < gap <= 2 * S for gap in gaps)
    assert max(gaps) - min(gaps) > 200 * MS


def test_6_2_a_neighbor_that_is_only_heard_is_told_as_asymmetric(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(), to=1)
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].heard == (Heard(*HEARS_US)._replace(node=2),)


def test_7_1_a_link_is_symmetric_once_the_neighbor_says_that_it_hears_us(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(), to=1)
    assert link(found, 2) is Link.ASYM
    found.say(2, HELLO_TYPE, hello(HEARS_US), to=1)
    assert link(found, 2) is Link.SYM
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].heard[0][:2] == (Link.SYM, Neighborhood.SYM)


def test_7_1_a_neighbor_that_has_lost_us_is_not_symmetric(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.say(2, HELLO_TYPE, hello((Link.LOST, Neighborhood.NOT, 1)), to=1)
    assert link(found, 2) is Link.ASYM


def test_7_1_a_silent_neighbor_is_lost_after_its_holding_time_and_told_so_for_as_long(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.advance(6 * S)
    assert link(found, 2) is Link.SYM
    found.advance(10 * MS)
    assert link(found, 2) is Link.LOST
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].heard == (Heard(Link.LOST, Neighborhood.NOT, 2),)
    found.advance(p.NEIGHB_HOLD_TIME_NS)
    assert link(found, 2) is None
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].heard == ()


def test_7_1_the_validity_is_what_the_neighbor_says(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US, vtime=encode_time(1 * S)), to=1)
    found.advance(1 * S)
    assert link(found, 2) is Link.SYM
    found.advance(1 * MS)
    assert link(found, 2) is Link.LOST


# --- 8.2 two hops -----------------------------------------------------------------------------------------------------


def two_hop(found: Bench, neighbor: int) -> list[int]:
    return found.protocol(1)._state.two_hop(NodeId(neighbor), now_ns=found.now_ns)


def test_8_2_the_symmetric_neighbors_of_a_symmetric_neighbor_are_two_hops_away(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(*with_neighbors(7, 8)), to=1)
    assert two_hop(found, 2) == [], "it does not hear us yet"
    found.say(2, HELLO_TYPE, hello(SEES_US, *with_neighbors(7), (Link.SYM, Neighborhood.MPR, 8)), to=1)
    assert two_hop(found, 2) == [7, 8], "and we ourselves are not"


def test_8_2_a_neighbor_that_says_it_has_lost_another_takes_it_away(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US, *with_neighbors(7, 8)), to=1)
    found.say(2, HELLO_TYPE, hello(SEES_US, (Link.LOST, Neighborhood.NOT, 7), *with_neighbors(8)), to=1)
    assert two_hop(found, 2) == [8]


def test_8_5_a_lost_neighbor_takes_its_two_hop_neighbors_and_its_choice_along(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(CHOSE_US, *with_neighbors(7)), to=1)
    assert found.protocol(1)._state.selectors(now_ns=found.now_ns) == [2]
    assert hops(found, 1, 7) == (2, 2)
    found.say(2, HELLO_TYPE, hello((Link.LOST, Neighborhood.NOT, 1)), to=1)
    assert found.protocol(1)._state.selectors(now_ns=found.now_ns) == []
    assert hops(found, 1, 7) is None


# --- 8.3 multipoint relays --------------------------------------------------------------------------------------------


def relays(neighbors: dict[int, set[int]], **willing: int) -> list[int]:
    willingness = {NodeId(n): willing.get(f"n{n}", p.WILL_DEFAULT) for n in neighbors}
    known = {NodeId(n): frozenset(NodeId(far) for far in reach) for n, reach in neighbors.items()}
    return [int(n) for n in multipoint_relays(NodeId(1), known, willingness)]


def test_8_3_1_the_only_way_to_a_node_is_a_relay_and_what_it_covers_needs_no_other() -> None:
    assert relays({2: {10, 11}, 3: {11}, 4: {11}}) == [2]


def test_8_3_1_the_only_ways_are_chosen_before_the_neighbor_that_reaches_most() -> None:
    assert relays({2: {10, 11, 12, 13}, 3: {10, 11, 14}, 4: {12, 13, 15}}) == [3, 4]


def test_8_3_1_the_neighbor_that_reaches_most_is_preferred() -> None:
    assert relays({2: {10, 11}, 3: {10, 11, 12}, 4: {12}}) == [3]


def test_8_3_1_willingness_goes_before_reach() -> None:
    assert relays({2: {10, 11}, 3: {10, 11, 12}, 4: {12, 10}}, n4=p.WILL_HIGH) == [3, 4]


def test_8_3_1_who_is_never_willing_is_never_a_relay_and_who_always_is_always_one() -> None:
    assert relays({2: {10}, 3: {10}}, n2=p.WILL_NEVER) == [3]
    assert relays({2: {10}}, n2=p.WILL_NEVER) == []
    assert relays({2: {10}, 3: set()}, n3=p.WILL_ALWAYS) == [2, 3]


def test_8_3_1_neighbors_and_we_ourselves_need_no_relay() -> None:
    assert relays({2: {1, 3}, 3: {1, 2}}) == []


graphs = st.dictionaries(st.integers(2, 9), st.frozensets(st.integers(1, 20), max_size=8), max_size=8)


@given(graphs)
def test_8_3_1_relays_together_reach_every_node_two_hops_away(neighbors: dict[int, set[int]]) -> None:
    far = set().union(*neighbors.values()) - set(neighbors) - {1}
    chosen = relays(neighbors)
    assert set(chosen) <= set(neighbors)
    assert far <= set().union(*(neighbors[n] for n in chosen))


def test_8_3_a_chosen_relay_is_told_in_the_next_hello(bench: MakeBench) -> None:
    found = bench(3)
    found.advance(10 * S)
    assert {h.node: h.neighborhood for h in own_hellos(found, 1)[-1][1].heard} == {2: Neighborhood.MPR}
    assert {h.neighborhood for h in own_hellos(found, 2)[-1][1].heard} == {Neighborhood.SYM}


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


def test_the_number_of_pairs_a_hello_names_does_not_depend_on_one_frame(bench: MakeBench) -> None:
    """A neighborhood larger than a frame is told in several hellos (6.2 allows it)."""
    found = bench(1)
    found.protocol(1)._room = 40
    for node in range(2, 60):
        found.say(node, HELLO_TYPE, hello(), to=1)
    found.advance(4 * S)
    last_ns = own_hellos(found)[-1][0]
    told = [h.node for t_ns, said in own_hellos(found) if t_ns == last_ns for h in said.heard]
    assert sorted(told) == list(range(2, 60))
    assert all(a != b for a, b in combinations(told, 2))
