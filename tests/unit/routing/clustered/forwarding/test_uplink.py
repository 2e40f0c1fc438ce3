"""A packet that waits for a way to a head, and its lifetime."""

import pytest
from kit import MakeScenario

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxStatus
from fanet_mw.errors import DropReason
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.trace import Dropped
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import FLAG_TO_HEAD, PRIORITY_BULK, PRIORITY_REPORT, Header, Kind, filler
from fanet_mw.wire.hello.beacon import Beacon, Role


@pytest.fixture
def alone(make_scenario: MakeScenario) -> Node:
    """A node that nobody hears; it holds a report that lives for 2 s and a bulk packet that lives for 5 s."""
    keys = {"nodes.count": 3, "routing.lifetime_s": 5, "routing.report_lifetime_s": 2}
    node = Node(NodeId(2), make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 0.0))
    node.start(0)
    for priority in (PRIORITY_REPORT, PRIORITY_BULK):
        node.send(filler(40), destination=BROADCAST, priority=priority, app="test", born_ns=0, now_ns=0)
    return node


def dropped(node: Node) -> list[tuple[int, str]]:
    return [(record.t_ns, record.reason) for record in node.records if isinstance(record, Dropped)]


def test_a_packet_without_a_way_is_dropped_when_its_class_expires(alone: Node) -> None:
    alone.wake(2 * S)
    assert not dropped(alone)
    alone.wake(2 * S + MS)
    assert dropped(alone) == [(2 * S + MS, DropReason.EXPIRED)]
    alone.wake(5 * S + MS)
    assert [reason for _, reason in dropped(alone)] == [DropReason.EXPIRED] * 2


def test_a_held_packet_that_has_expired_does_not_go_when_a_way_appears(alone: Node) -> None:
    uplink = alone._protocol.parts.uplink  # type: ignore[attr-defined]
    assert uplink.released(now_ns=5 * S + MS) == []
    assert len(uplink) == 0
    assert len(dropped(alone)) == 2


# --- on the way to a parent -----------------------------------------------------------------------------------------


def hear_head(node: Node, *, at_ns: int = 1 * MS) -> None:
    """Node 3, a head, is heard: it is the way now."""
    header = Header(at_ns // US, 0x8000_0000 + at_ns // MS, 3, BROADCAST, 3, Kind.HELLO, 1, 0, 0, 0)
    beacon = Beacon(3, 3, 5 + at_ns // S, 0, 0, 0, Role.HEAD, 0)
    node.hear(Reception(header.encode() + beacon.encode_frame(3), NodeId(3), at_ns, -60.0), at_ns)


@pytest.fixture
def beside_a_head(make_scenario: MakeScenario) -> Node:
    node = Node(NodeId(2), make_scenario(**{"nodes.count": 3}), make_protocol, position=Enu(0.0, 0.0, 0.0))
    node.start(0)
    hear_head(node)
    node.send(filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=2 * MS, now_ns=2 * MS)
    return node


def ends(node: Node, outcome: TxOutcome) -> None:
    """The transmission that was asked for last has ended so."""
    node.on_status(TxStatus(node.requests[-1].seq, outcome, 9 * MS, 7), now_ns=9 * MS)


def test_a_packet_that_a_parent_does_not_take_is_tried_three_times_and_dropped(beside_a_head: Node) -> None:
    for tried in (1, 2, 3):
        assert len(beside_a_head.requests) == tried
        assert beside_a_head.requests[-1].dst == 3
        assert not dropped(beside_a_head)
        ends(beside_a_head, TxOutcome.LIFETIME)
    assert len(beside_a_head.requests) == 3
    assert dropped(beside_a_head) == [(9 * MS, DropReason.RETRY_LIMIT)]


def test_a_packet_that_the_radio_can_never_send_is_not_tried_again(beside_a_head: Node) -> None:
    ends(beside_a_head, TxOutcome.REFUSED)
    assert len(beside_a_head.requests) == 1
    assert dropped(beside_a_head) == [(9 * MS, DropReason.REFUSED)]


def test_a_parent_that_does_not_acknowledge_is_given_up_until_it_is_heard_again(beside_a_head: Node) -> None:
    ends(beside_a_head, TxOutcome.RETRY_LIMIT)
    assert len(beside_a_head.requests) == 1
    assert beside_a_head.report()["waiting"] == 1
    hear_head(beside_a_head, at_ns=2 * S)
    assert len(beside_a_head.requests) == 2


def test_a_packet_of_our_own_that_comes_back_on_its_way_is_known(beside_a_head: Node) -> None:
    back = wire.rewrite(beside_a_head.requests[0].frame, 3, FLAG_TO_HEAD)
    assert beside_a_head.hear(Reception(back, NodeId(3), 9 * MS, -60.0), 9 * MS)
    assert len(beside_a_head.requests) == 1
