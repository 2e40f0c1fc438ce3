"""The repositories of OLSR to the nanosecond: each entry is valid up to its end, and no longer."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.routing.olsr.messages import (
    Hello,
    HelloNeighbor,
    LinkType,
    NeighborType,
    TopologyControl,
    decode_time,
    encode_time,
)
from fanet_mw.routing.olsr.parameters import NEIGHB_HOLD_TIME_NS, WILL_DEFAULT
from fanet_mw.routing.olsr.state import Repositories
from fanet_mw.units import NodeId, S

US, THEM, FAR = NodeId(1), NodeId(2), NodeId(3)
NOW_NS = 7 * S
VALID = encode_time(6 * S)
END_NS = NOW_NS + decode_time(VALID)


def hello(*neighbors: HelloNeighbor, willingness: int = WILL_DEFAULT) -> Hello:
    return Hello(htime=0, willingness=willingness, neighbors=neighbors, vtime=VALID)


HEARS_US = HelloNeighbor(LinkType.SYM, NeighborType.SYM, US)
CHOSE_US = HelloNeighbor(LinkType.SYM, NeighborType.MPR, US)
HEARS_FAR = HelloNeighbor(LinkType.SYM, NeighborType.SYM, FAR)


def heard(*hellos: Hello) -> Repositories:
    state = Repositories(US)
    for one in hellos:
        state.on_hello(THEM, one, now_ns=NOW_NS)
    return state


VIEWS: dict[str, Callable[[Repositories, int], object]] = {
    "is_symmetric": lambda state, now_ns: state.is_symmetric(THEM, now_ns=now_ns),
    "symmetric": lambda state, now_ns: state.symmetric(now_ns=now_ns),
    "two_hop": lambda state, now_ns: state.two_hop(THEM, now_ns=now_ns),
    "is_selector": lambda state, now_ns: state.is_selector(THEM, now_ns=now_ns),
    "selectors": lambda state, now_ns: state.selectors(now_ns=now_ns),
    "topology": lambda state, now_ns: state.topology(now_ns=now_ns),
}


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("tidied", [False, True])
def test_what_a_message_says_is_valid_up_to_its_end(view: str, *, tidied: bool) -> None:
    for now_ns, valid in ((END_NS, True), (END_NS + 1, False)):
        state = heard(hello(CHOSE_US, HEARS_FAR))
        state.on_tc(THEM, TopologyControl(VALID, 5, (FAR,)), now_ns=NOW_NS)
        if tidied:
            state.tidy(now_ns)
        assert bool(VIEWS[view](state, now_ns)) is valid


def test_a_link_that_was_symmetric_is_lost_for_the_hold_time_and_then_forgotten() -> None:
    for now_ns, kind in (
        (END_NS, LinkType.SYM), (END_NS + 1, LinkType.LOST), (END_NS + NEIGHB_HOLD_TIME_NS, LinkType.LOST),
        (END_NS + NEIGHB_HOLD_TIME_NS + 1, None),
    ):  # fmt: skip
        for tidied in (False, True):
            state = heard(hello(HEARS_US))
            if tidied:
                state.tidy(now_ns)
            assert state.link_of(THEM, now_ns=now_ns) is kind
            assert state.linked(now_ns=now_ns) == ([] if kind is None else [THEM])


def test_a_neighbor_that_is_only_heard_is_forgotten_at_the_end_of_its_last_hello() -> None:
    state = heard(hello())
    assert state.link_of(THEM, now_ns=END_NS) is LinkType.ASYM
    assert state.link_of(THEM, now_ns=END_NS + 1) is None
    assert not state.is_symmetric(THEM, now_ns=NOW_NS)
    lost = heard(hello(HEARS_US), hello(HEARS_US._replace(link_type=LinkType.LOST)))
    assert lost.link_of(THEM, now_ns=NOW_NS) is LinkType.ASYM


def test_a_hello_at_the_last_instant_of_a_link_prolongs_it_and_one_later_begins_anew() -> None:
    lost_ns = END_NS + NEIGHB_HOLD_TIME_NS
    for later_ns, remembered in ((lost_ns, True), (lost_ns + 1, False)):
        state = heard(hello(HEARS_US))
        state.on_hello(THEM, hello(HEARS_US._replace(link_type=LinkType.UNSPEC)), now_ns=later_ns)
        assert state._links[THEM].sym_ns == (END_NS if remembered else later_ns - 1)


def test_each_hello_states_the_willingness_and_each_view_is_in_order_of_ids() -> None:
    state = Repositories(US)
    for node in (9, 4, 6):
        sent = hello(CHOSE_US, *(HEARS_FAR._replace(node=far) for far in (30, 10, 20)), willingness=node % 7)
        state.on_hello(NodeId(node), sent, now_ns=NOW_NS)
        state.on_tc(NodeId(node), TopologyControl(VALID, 1, (NodeId(30), NodeId(10))), now_ns=NOW_NS)
    assert state.symmetric(now_ns=NOW_NS) == state.linked(now_ns=NOW_NS) == state.selectors(now_ns=NOW_NS) == [4, 6, 9]
    assert state.two_hop(NodeId(9), now_ns=NOW_NS) == [10, 20, 30]
    assert state.topology(now_ns=NOW_NS) == [(last, far) for last in (4, 6, 9) for far in (10, 30)]
    assert [state.willingness(NodeId(node)) for node in (4, 6, 9)] == [4, 6, 2]


def test_who_is_no_neighbor_of_a_neighbor_any_more_is_taken_out_and_this_node_is_never_its_own_two_hop() -> None:
    state = heard(hello(HEARS_US, HEARS_FAR), hello(HEARS_US, HEARS_FAR._replace(neighbor_type=NeighborType.NOT)))
    assert state.two_hop(THEM, now_ns=NOW_NS) == []


def test_only_a_symmetric_neighbor_teaches_its_neighbors_and_chooses_relays() -> None:
    state = heard(hello(HelloNeighbor(LinkType.LOST, NeighborType.MPR, US), HEARS_FAR))
    assert (state.two_hop(THEM, now_ns=NOW_NS), state.selectors(now_ns=NOW_NS)) == ([], [])


def test_a_tc_is_outdated_by_a_newer_one_until_that_has_expired() -> None:
    state = Repositories(US)
    assert state.on_tc(THEM, TopologyControl(VALID, 5, (FAR,)), now_ns=NOW_NS)
    version = state.version
    assert not state.on_tc(THEM, TopologyControl(VALID, 4, (NodeId(8),)), now_ns=END_NS)
    assert state.version == version, "what is outdated changes no routes"
    assert state.on_tc(THEM, TopologyControl(VALID, 4, (NodeId(8),)), now_ns=END_NS + 1)
    assert state.topology(now_ns=END_NS + 1) == [(THEM, 8)]
    assert state.version == version + 1
    state.on_tc(THEM, TopologyControl(VALID, 4, (NodeId(9),)), now_ns=END_NS + 2)
    assert state.topology(now_ns=END_NS + 2) == [(THEM, 8), (THEM, 9)], "one set in several messages"
    state.on_tc(THEM, TopologyControl(VALID, 5, (FAR,)), now_ns=END_NS + 3)
    assert state.topology(now_ns=END_NS + 3) == [(THEM, FAR)], "a newer one replaces it"


def test_only_who_names_this_node_as_relay_over_a_symmetric_link_is_a_selector() -> None:
    assert heard(hello(CHOSE_US)).selectors(now_ns=NOW_NS) == [THEM]
    chose_another = CHOSE_US._replace(node=FAR)
    assert heard(hello(HEARS_US, chose_another)).selectors(now_ns=NOW_NS) == []
    lost = heard(hello(CHOSE_US), hello(CHOSE_US._replace(link_type=LinkType.LOST)))
    assert (lost.is_selector(THEM, now_ns=NOW_NS), lost.selectors(now_ns=NOW_NS)) == (False, [])
    assert heard(hello(HEARS_US)).is_selector(THEM, now_ns=NOW_NS) is False


def test_each_hello_may_change_the_routes_and_prolongs_what_is_only_heard() -> None:
    state = heard(hello())
    before = state.version
    state.on_hello(THEM, hello(), now_ns=NOW_NS + S)
    assert state.version == before + 1
    assert state.link_of(THEM, now_ns=END_NS + S) is LinkType.ASYM
    assert state.link_of(THEM, now_ns=END_NS + S + 1) is None
    assert heard(hello(HEARS_US)).next_change_ns(END_NS) == END_NS, "still valid at that instant"


@given(st.lists(st.tuples(st.integers(0, 20), st.booleans(), st.integers(2, 5)), min_size=1, max_size=6))
def test_nothing_changes_before_the_next_change(messages: list[tuple[int, bool, int]]) -> None:
    state, now_ns = Repositories(US), 0
    for later_s, is_tc, node in messages:
        now_ns += later_s * S
        if is_tc:
            state.on_tc(NodeId(node), TopologyControl(VALID, 1, (FAR,)), now_ns=now_ns)
        else:
            state.on_hello(NodeId(node), hello(HEARS_US, HEARS_FAR._replace(node=9)), now_ns=now_ns)

    def routes_from(at_ns: int) -> object:
        near = state.symmetric(now_ns=at_ns)
        return near, [state.two_hop(node, now_ns=at_ns) for node in near], state.topology(now_ns=at_ns)

    change_ns = state.next_change_ns(now_ns)
    assert routes_from(min(change_ns, now_ns + 1000 * S)) == routes_from(now_ns)
    if change_ns < now_ns + 1000 * S:
        assert routes_from(change_ns + 1) != routes_from(now_ns)
