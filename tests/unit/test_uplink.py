"""A packet that waits for a way to a head, and its lifetime."""

import pytest

from fanet_mw.errors import DropReason
from fanet_mw.protocol.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.trace import Dropped
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_REPORT, filler
from tests.conftest import MakeScenario


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
    uplink = alone._protocol._uplink  # type: ignore[attr-defined]
    assert uplink.released(now_ns=5 * S + MS) == []
    assert len(uplink) == 0
    assert len(dropped(alone)) == 2
