"""OLSR against RFC 3626, 6 to 8 and 18.3: hellos, links and relays. Each test is a rule, on a bench of nodes."""

from collections.abc import Callable
from itertools import combinations, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from olsr_bench import (
    CHOSE_US,
    HEARS_US,
    HELLO_TYPE,
    SEES_US,
    MakeBench,
    benches,
    hello,
    hops,
    own_hellos,
    with_neighbors,
)
from rival_bench import Bench

from fanet_mw.routing.olsr import parameters as p
from fanet_mw.routing.olsr.messages import HelloNeighbor, LinkType, NeighborType, decode_time, encode_time
from fanet_mw.routing.olsr.protocol import multipoint_relays
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    return benches(make_scenario)


def link(found: Bench, node: int) -> LinkType | None:
    return found.protocol(1)._state.link_of(node, now_ns=found.now_ns)


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
    assert own_hellos(found)[-1][1].neighbors == (HelloNeighbor(*HEARS_US)._replace(node=2),)


def test_7_1_a_link_is_symmetric_once_the_neighbor_says_that_it_hears_us(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(), to=1)
    assert link(found, 2) is LinkType.ASYM
    found.say(2, HELLO_TYPE, hello(HEARS_US), to=1)
    assert link(found, 2) is LinkType.SYM
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].neighbors[0][:2] == (LinkType.SYM, NeighborType.SYM)


def test_7_1_a_neighbor_that_has_lost_us_is_not_symmetric(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.say(2, HELLO_TYPE, hello((LinkType.LOST, NeighborType.NOT, 1)), to=1)
    assert link(found, 2) is LinkType.ASYM


def test_7_1_a_silent_neighbor_is_lost_after_its_holding_time_and_told_so_for_as_long(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US), to=1)
    found.advance(6 * S)
    assert link(found, 2) is LinkType.SYM
    found.advance(10 * MS)
    assert link(found, 2) is LinkType.LOST
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].neighbors == (HelloNeighbor(LinkType.LOST, NeighborType.NOT, 2),)
    found.advance(p.NEIGHB_HOLD_TIME_NS)
    assert link(found, 2) is None
    found.advance(2 * S)
    assert own_hellos(found)[-1][1].neighbors == ()


def test_7_1_the_validity_is_what_the_neighbor_says(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US, vtime=encode_time(1 * S)), to=1)
    found.advance(1 * S)
    assert link(found, 2) is LinkType.SYM
    found.advance(1 * MS)
    assert link(found, 2) is LinkType.LOST


def test_the_number_of_pairs_a_hello_names_does_not_depend_on_one_frame(bench: MakeBench) -> None:
    """A neighborhood larger than a frame is told in several hellos (6.2 allows it)."""
    found = bench(1)
    found.protocol(1)._room = 40
    for node in range(2, 60):
        found.say(node, HELLO_TYPE, hello(), to=1)
    found.advance(4 * S)
    last_ns = own_hellos(found)[-1][0]
    told = [h.node for t_ns, said in own_hellos(found) if t_ns == last_ns for h in said.neighbors]
    assert sorted(told) == list(range(2, 60))
    assert all(a != b for a, b in combinations(told, 2))


# --- 8.2 two hops -----------------------------------------------------------------------------------------------------


def two_hop(found: Bench, neighbor: int) -> list[int]:
    return found.protocol(1)._state.two_hop(NodeId(neighbor), now_ns=found.now_ns)


def test_8_2_the_symmetric_neighbors_of_a_symmetric_neighbor_are_two_hops_away(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(*with_neighbors(7, 8)), to=1)
    assert two_hop(found, 2) == [], "it does not hear us yet"
    found.say(2, HELLO_TYPE, hello(SEES_US, *with_neighbors(7), (LinkType.SYM, NeighborType.MPR, 8)), to=1)
    assert two_hop(found, 2) == [7, 8], "and we ourselves are not"


def test_8_2_a_neighbor_that_says_it_has_lost_another_takes_it_away(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(SEES_US, *with_neighbors(7, 8)), to=1)
    found.say(2, HELLO_TYPE, hello(SEES_US, (LinkType.LOST, NeighborType.NOT, 7), *with_neighbors(8)), to=1)
    assert two_hop(found, 2) == [8]


def test_8_5_a_lost_neighbor_takes_its_two_hop_neighbors_and_its_choice_along(bench: MakeBench) -> None:
    found = bench(1)
    found.say(2, HELLO_TYPE, hello(CHOSE_US, *with_neighbors(7)), to=1)
    assert found.protocol(1)._state.selectors(now_ns=found.now_ns) == [2]
    assert hops(found, 1, 7) == (2, 2)
    found.say(2, HELLO_TYPE, hello((LinkType.LOST, NeighborType.NOT, 1)), to=1)
    assert found.protocol(1)._state.selectors(now_ns=found.now_ns) == []
    assert hops(found, 1, 7) is None


# --- 8.3 multipoint relays --------------------------------------------------------------------------------------------


def relays(neighbors: dict[int, set[int]], **willing: int) -> list[int]:
    willingness = {NodeId(n): willing.get(f"n{n}", p.WILL_DEFAULT) for n in neighbors}
    known = {NodeId(n): tuple(NodeId(far) for far in sorted(reach)) for n, reach in neighbors.items()}
    known[NodeId(1)] = tuple(sorted(known))
    return [int(n) for n in multipoint_relays(NodeId(1), known, willingness=willingness)]


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
    assert {h.node: h.neighbor_type for h in own_hellos(found, 1)[-1][1].neighbors} == {2: NeighborType.MPR}
    assert {h.neighbor_type for h in own_hellos(found, 2)[-1][1].neighbors} == {NeighborType.SYM}
