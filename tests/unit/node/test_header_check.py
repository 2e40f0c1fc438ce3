"""Checks of routing headers: each statement that cannot be true, at its bound and one beyond."""

import pytest
from kit import MakeScenario

from fanet_mw import wire
from fanet_mw.errors import DropReason
from fanet_mw.node.duplicates import DELIVERED
from fanet_mw.node.header_check import CONTROL, HeaderCheck
from fanet_mw.units import BROADCAST, US, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, Header, Kind

OURS, NEIGHBOR, FAR = NodeId(2), NodeId(3), NodeId(4)
NOW_NS = 50 * S
NOW_US = NOW_NS // US
FIRST = Header(NOW_US, 7, NEIGHBOR, BROADCAST, NEIGHBOR, Kind.DATA, 8, 0, PRIORITY_BULK, FLAG_FLOOD)
"""A neighbor's own packet."""
HANDED_ON = {8}
"""The numbers of the data packets that we have handed on."""
RELAYED = FIRST._replace(origin=FAR, hops=1)
"""One that the neighbor has passed on."""


@pytest.fixture
def plausible(make_scenario: MakeScenario) -> HeaderCheck:
    return HeaderCheck(OURS, make_scenario(**{"nodes.count": 5}), handed_on=HANDED_ON.__contains__)


def judged(plausible: HeaderCheck, header: Header, *, src: NodeId = NEIGHBOR, before: int = 0) -> DropReason | None:
    age_ns = NOW_NS - header.origin_us * US
    return plausible.why_not(wire.fields_of(header.encode()), before, src, age_ns)


@pytest.mark.parametrize("header", [FIRST, RELAYED, RELAYED._replace(hops=200, hop_limit=55)], ids=str)
def test_what_can_be_true_is_believed(plausible: HeaderCheck, header: Header) -> None:
    assert judged(plausible, header) is None


@pytest.mark.parametrize("field", ["origin", "prev_hop", "destination"])
def test_the_last_node_is_one_and_the_next_is_none(plausible: HeaderCheck, field: str) -> None:
    last, none = RELAYED._replace(**{field: 5}), RELAYED._replace(**{field: 6})
    assert judged(plausible, last, src=NodeId(last.prev_hop)) is None
    assert judged(plausible, none, src=NodeId(none.prev_hop)) is DropReason.UNKNOWN_NODE


def test_a_packet_in_our_own_name_is_ours_only_if_we_have_made_it(plausible: HeaderCheck) -> None:
    header = RELAYED._replace(origin=OURS)
    assert judged(plausible, header) is DropReason.OWN
    assert judged(plausible, header, before=DELIVERED) is None, "we know it from the phase before"
    back = header._replace(seq=8)
    assert judged(plausible, back) is None, "we have handed it on, and it may come back"
    assert judged(plausible, back._replace(kind=Kind.SCHEDULE)) is DropReason.OWN, "control is numbered apart"


def test_the_transmitter_is_whom_the_radio_names(plausible: HeaderCheck) -> None:
    assert judged(plausible, FIRST, src=FAR) is DropReason.FORGED
    assert judged(plausible, RELAYED, src=FAR) is DropReason.FORGED


def test_only_its_origin_sends_a_packet_that_has_made_no_hop(plausible: HeaderCheck) -> None:
    assert judged(plausible, RELAYED._replace(hops=0)) is DropReason.FORGED


def test_a_hello_is_passed_on_by_nobody(plausible: HeaderCheck) -> None:
    assert judged(plausible, FIRST._replace(kind=Kind.HELLO)) is None
    assert judged(plausible, RELAYED._replace(kind=Kind.HELLO)) is DropReason.FORGED


def test_hops_made_and_hops_left_are_255_together_at_most(plausible: HeaderCheck) -> None:
    assert judged(plausible, RELAYED._replace(hops=55, hop_limit=200)) is None
    assert judged(plausible, RELAYED._replace(hops=56, hop_limit=200)) is DropReason.FORGED


def test_a_birth_lies_no_further_ahead_than_clocks_may_differ(
    plausible: HeaderCheck, make_scenario: MakeScenario
) -> None:
    assert judged(plausible, FIRST._replace(origin_us=NOW_US + 100_000)) is None
    assert judged(plausible, FIRST._replace(origin_us=NOW_US + 100_001)) is DropReason.FORGED
    clocks = {"clock.offset_ms": 20, "clock.drift_ppm": 100, "clock.sync": "beacons", "duration_s": 100}
    drifting = HeaderCheck(OURS, make_scenario(**{"nodes.count": 5, **clocks}), handed_on=HANDED_ON.__contains__)
    most_us = 100_000 + 2 * (20_000 + 100 * 100) + 1_000_000
    assert judged(drifting, FIRST._replace(origin_us=NOW_US + most_us)) is None
    assert judged(drifting, FIRST._replace(origin_us=NOW_US + most_us + 1)) is DropReason.FORGED


@pytest.mark.parametrize("apart", [0, CONTROL], ids=["data", "control"])
def test_a_number_is_one_that_the_time_so_far_has_room_for(plausible: HeaderCheck, apart: int) -> None:
    most = NOW_US // 100 + 100_000
    assert judged(plausible, FIRST._replace(seq=apart + most)) is None
    assert judged(plausible, FIRST._replace(seq=apart + most + 1)) is DropReason.FORGED


def test_a_node_whose_clock_has_jumped_back_believes_most_of_its_neighbors_and_no_single_one(
    make_scenario: MakeScenario,
) -> None:
    """A clock without a counter jumped back by 3.7 s: its node refused all packets of others for 4 s."""
    keys = {"nodes.count": 9, "clock.offset_ms": 5}
    plausible = HeaderCheck(OURS, make_scenario(**keys), handed_on=HANDED_ON.__contains__)

    def of(node: int, ahead_s: float) -> DropReason | None:
        told = FIRST._replace(origin=node, prev_hop=node, origin_us=NOW_US + round(ahead_s * 1e6))
        return judged(plausible, told, src=NodeId(node))

    assert [of(node, 0) for node in (3, 4, 5)] == [None] * 3
    assert [of(6, 3.7) for _ in range(9)] == [DropReason.FORGED] * 9, "one station is nobody's clock"
    assert [of(node, 3.7) for node in (6, 7)] == [DropReason.FORGED] * 2, "nor are two beside three others"
    assert [of(node, 3.7) for node in (7, 3, 4)] == [DropReason.FORGED, None, None]
    assert [of(node, 0) for node in (3, 4, 5)] == [None] * 3, "it has the time again"
    assert of(7, 3.7) is DropReason.FORGED


def test_exact_clocks_do_not_jump(plausible: HeaderCheck) -> None:
    early = FIRST._replace(origin_us=NOW_US + 3_700_000)
    for node in (3, 4, 5):
        assert judged(plausible, early._replace(origin=node, prev_hop=node), src=NodeId(node)) is DropReason.FORGED
