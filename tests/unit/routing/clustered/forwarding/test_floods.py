"""What a node sends of a flood: the first frame, a relay, and one more copy for a neighbor that lacks it."""

from collections.abc import Callable

import pytest

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, Header, Kind, filler

MakeScenario = Callable[..., Scenario]
OURS, THEIRS = NodeId(2), NodeId(3)


@pytest.fixture
def node(make_scenario: MakeScenario) -> Node:
    return Node(OURS, make_scenario(**{"nodes.count": 4}), make_protocol, position=Enu(0.0, 0.0, 0.0))


def floods(node: Node) -> Floods:
    stream = node.port.stream("test").random
    return Floods(node.port, None, ContentionTiming(lead_ns=0, jitter=stream, window=stream))


def packet(*, origin: int = THEIRS, hop_limit: int = 8) -> Packet:
    header = Header(0, 5, origin, BROADCAST, origin, Kind.DATA, hop_limit, 0, 3, FLAG_TO_HEAD)
    return Packet(header, header.encode() + filler(40))


def hops_left(frame: bytes) -> tuple[int, int]:
    header = wire.decode_header(frame)
    return header.hop_limit, header.hops


def test_who_begins_a_flood_knows_it_when_it_comes_back(node: Node) -> None:
    floods(node).begin([packet()], start_ns=1 * MS)
    (request,) = node.requests
    back = wire.rewrite(request.frame, THEIRS, FLAG_FLOOD)
    assert node.hear(Reception(back, THEIRS, 3 * MS, -60.0), 3 * MS), "a copy"


@pytest.mark.parametrize(("origin", "left"), [(OURS, (8, 0)), (THEIRS, (7, 1))])
def test_a_flood_of_our_own_begins_with_all_its_hops(node: Node, origin: int, left: tuple[int, int]) -> None:
    floods(node).begin([packet(origin=origin)], start_ns=1 * MS)
    assert [hops_left(request.frame) for request in node.requests] == [left]


@pytest.mark.parametrize(("origin", "hop_limit", "goes"), [(THEIRS, 2, True), (THEIRS, 1, False), (OURS, 1, True)])
def test_once_more_costs_a_hop_too(node: Node, origin: int, hop_limit: int, goes: bool) -> None:
    floods(node).answer([packet(origin=origin, hop_limit=hop_limit)], start_ns=1 * MS)
    assert bool(node.requests) == goes


def test_a_full_window_loses_no_packet_that_nobody_will_ask_for(node: Node) -> None:
    """Windows of 8 ms every 500 ms, of which a quarter is one node's: one of these packets."""
    stream = node.port.stream("test").random
    contention = ContentionTiming(lead_ns=0, jitter=stream, window=lambda: 0.0)
    contention.turns_at = lambda _: Turns(0, 500 * MS, 8 * MS, 1 * MS, 480)
    ours = Floods(node.port, None, contention)
    header = Header(0, 5, THEIRS, NodeId(4), THEIRS, Kind.DATA, 8, 0, 3, 0)
    long = Packet(header, header.encode() + filler(1024))
    for _ in range(3):
        ours.contend(long, due_ns=1 * MS, now_ns=1 * MS)
    assert [request.start_ns // MS for request in node.requests] == [1, 500, 1000]
    node.requests.clear()
    for _ in range(3):
        ours.contend_again(long, due_ns=1501 * MS, now_ns=1501 * MS)
    assert len(node.requests) == 1, "a neighbor will ask for the others again"
