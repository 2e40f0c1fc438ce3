"""A node that hears nobody says so in all that it sends, and what it says then counts for nothing else."""

from collections.abc import Callable

import pytest

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_DEAF, FLAG_FLOOD, Header, Kind, filler

US, OTHER = NodeId(2), NodeId(3)


@pytest.fixture
def node(make_scenario: Callable[..., Scenario]) -> Node:
    keys = {"nodes.count": 5, "clusters.relay": "scheduled", "clusters.flooding_period_s": 0.1, "radio.lead_ms": 0}
    made = Node(US, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    made.start(0)
    return made


def hear(node: Node, *, at_ns: int, flags: int = FLAG_FLOOD, kind: Kind = Kind.DATA) -> None:
    header = Header(at_ns // 1000, 1, OTHER, BROADCAST, OTHER, kind, 9, 0, 3, flags)
    node.hear(Reception(header.encode() + filler(40), OTHER, at_ns, -60.0), at_ns)


def states_deafness(node: Node, *, at_ns: int) -> bool:
    node.requests.clear()
    node.say_hello(b"", start_ns=at_ns, now_ns=at_ns)
    (request,) = node.requests
    return bool(wire.decode_header(request.frame).flags & FLAG_DEAF)


def test_it_says_so_after_four_hellos_without_a_frame_until_the_next_one(node: Node) -> None:
    hear(node, at_ns=2 * S)
    assert [states_deafness(node, at_ns=t_ns) for t_ns in (6 * S - 1, 6 * S)] == [False, True]
    hear(node, at_ns=6 * S + MS)
    assert not states_deafness(node, at_ns=6 * S + 2 * MS)


def test_a_node_that_starts_long_after_the_others_has_had_no_time_to_hear_anybody(node: Node) -> None:
    node.start(100 * S)
    assert [states_deafness(node, at_ns=t_ns) for t_ns in (100 * S, 104 * S - 1, 104 * S)] == [False, False, True]


@pytest.mark.parametrize("deaf", [False, True])
def test_what_a_deaf_node_sends_is_delivered_and_no_sign_of_life(node: Node, *, deaf: bool) -> None:
    hear(node, at_ns=S, flags=FLAG_FLOOD | (FLAG_DEAF if deaf else 0))
    assert len(node.deliveries) == 1
    assert isinstance(node._protocol, Clustered)
    assert node._protocol.parts.roles.parts.liveness.last_ns(OTHER) == (None if deaf else S)
    (relayed,) = node.requests
    assert bool(wire.decode_header(relayed.frame).flags & FLAG_DEAF) is deaf, "others are told, too"


def test_control_packets_of_a_deaf_node_are_neither_used_nor_relayed(node: Node) -> None:
    hear(node, at_ns=S, flags=FLAG_FLOOD | FLAG_DEAF, kind=Kind.JOIN)
    assert node.requests == []
    assert not node.dropped, "it is not even read"
