"""A packet for one node goes hop by hop along the way back of its floods; without a way it is flooded."""

from collections.abc import Callable
from typing import Any

import pytest

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.forwarding.one_way import OneWay, is_receipt
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, Header, Kind
from fanet_mw.wire.application_message import DELIVERED, Receipt, encode_receipts
from fanet_mw.wire.hello.beacon import Beacon, Role

MakeScenario = Callable[..., Scenario]
OURS, NEAR, FAR, OTHER = NodeId(2), NodeId(3), NodeId(4), NodeId(5)


class Station:
    """Node 2, which has heard node 3 at 1 s."""

    def __init__(self, make_scenario: MakeScenario) -> None:
        node = Node(OURS, make_scenario(**{"nodes.count": 5}), make_protocol, position=Enu(0.0, 0.0, 50.0))
        self.port: Port = node.port
        self.requests = node.requests
        self.neighbors = Neighbors(lifetime_ns=3 * S)
        self.hear()
        self.one_way = OneWay(self.port, self.neighbors)

    def hear(self) -> None:
        self.neighbors.on_hello(Neighbor(NEAR, 1 * S, -60.0, Beacon(NEAR, 0, 0, 0, 0, 0, Role.MEMBER, 0)))

    def flood(self, of: NodeId, over: NodeId, *, born_us: int, hops: int = 1) -> None:
        self.one_way.learn(Header(born_us, 1, of, 0xFFFF, over, int(Kind.JOIN), 8, hops, 0, FLAG_FLOOD), over)

    def packet(self, receiver: NodeId, inner: bytes = b"") -> Packet:
        return self.port.announce(Kind.DATA, inner, now_ns=S, flags=0, hop_limit=8, destination=receiver)

    def send(self, receiver: NodeId, *, at_ns: int = 2 * S) -> list[NodeId]:
        """The next hop of a packet, if there is one."""
        before = len(self.requests)
        assert self.one_way.send(self.packet(receiver), start_ns=at_ns, now_ns=at_ns) == (len(self.requests) > before)
        return [request.dst for request in self.requests[before:]]

    def end(self, outcome: TxOutcome, *, request: int = 0) -> Packet | None:
        return self.one_way.failed(TxStatus(request, outcome, 2 * S, 1))


@pytest.fixture
def station(make_scenario: MakeScenario) -> Station:
    return Station(make_scenario)


def test_a_neighbor_gets_the_packet_at_once_and_who_is_none_any_more_and_has_flooded_nothing_gets_none(
    station: Station,
) -> None:
    assert station.send(NEAR) == [NEAR]
    assert station.send(NEAR, at_ns=5 * S) == []
    assert station.send(FAR) == []


def test_the_way_to_a_node_is_the_way_back_of_its_newest_flood_and_of_the_shortest_copy(station: Station) -> None:
    station.flood(FAR, OTHER, born_us=7, hops=2)
    assert station.send(FAR) == [OTHER]
    station.flood(FAR, NEAR, born_us=6, hops=0)
    assert station.send(FAR) == [OTHER], "an older flood"
    station.flood(FAR, NEAR, born_us=7, hops=1)
    assert station.send(FAR) == [NEAR]
    station.flood(FAR, OTHER, born_us=7, hops=2)
    assert station.send(FAR) == [NEAR], "a longer copy of the same"
    station.flood(FAR, OTHER, born_us=8, hops=3)
    assert station.send(FAR) == [OTHER]


def test_a_packet_does_not_go_back_to_where_it_came_from(station: Station) -> None:
    station.flood(FAR, NEAR, born_us=7)
    came = station.packet(FAR)
    came = came._replace(header=came.header._replace(prev_hop=int(NEAR)))
    assert not station.one_way.send(came, start_ns=2 * S, now_ns=2 * S)


def test_a_hop_that_does_not_answer_is_none_until_it_is_heard_again(station: Station) -> None:
    assert station.send(NEAR) == [NEAR]
    assert station.end(TxOutcome.RETRY_LIMIT, request=7) is None, "a request of others"
    missed = station.end(TxOutcome.RETRY_LIMIT)
    assert missed is not None
    assert missed.header.destination == NEAR
    assert station.send(NEAR) == []
    station.hear()
    assert station.send(NEAR) == [NEAR]
    assert station.end(TxOutcome.ACKED, request=1) is None
    station.flood(FAR, OTHER, born_us=7)
    assert station.send(FAR) == [OTHER]
    assert station.end(TxOutcome.RETRY_LIMIT, request=2) is not None
    assert station.send(FAR) == []
    assert not len(station.one_way)


@pytest.mark.parametrize("outcome", [TxOutcome.QUEUE_FULL, TxOutcome.LIFETIME, TxOutcome.LATE, TxOutcome.REFUSED])
def test_what_the_own_radio_did_not_let_out_says_nothing_of_the_way(station: Station, outcome: TxOutcome) -> None:
    """An overloaded node forgot its ways, and flooded what had a way: one frame became one of each node."""
    station.flood(FAR, OTHER, born_us=7)
    for request, (receiver, hop) in ((0, (NEAR, NEAR)), (2, (FAR, OTHER))):
        assert station.send(receiver) == [hop]
        assert station.end(outcome, request=request) is not None
        assert station.send(receiver) == [hop]


@pytest.mark.parametrize("outcome", [TxOutcome.RETRY_LIMIT, TxOutcome.QUEUE_FULL, TxOutcome.REFUSED])
def test_what_did_not_reach_the_next_hop_is_flooded_from_here(make_scenario: MakeScenario, outcome: TxOutcome) -> None:
    made: list[Clustered] = []

    def make(*parts: Any) -> RoutingProtocol:
        protocol = make_protocol(*parts)
        assert isinstance(protocol, Clustered)
        made.append(protocol)
        return protocol

    node = Node(OURS, make_scenario(**{"nodes.count": 5}), make, position=Enu(0.0, 0.0, 50.0))
    (protocol,) = made
    protocol.parts.one_way.learn(Header(7, 1, FAR, 0xFFFF, OTHER, int(Kind.JOIN), 8, 1, 0, FLAG_FLOOD), OTHER)
    packet = node.port.announce(Kind.DATA, b"", now_ns=S, flags=0, hop_limit=8, destination=FAR)
    protocol.originate(packet, due_ns=S, now_ns=S)
    (request,) = node.requests
    assert request.dst == OTHER
    node.on_status(TxStatus(request.seq, outcome, S, 1), now_ns=2 * S)
    assert [request.dst for request in node.requests[1:]] == [BROADCAST]


def test_who_hears_its_own_packets_flooded_over_others_shows_the_way_once_a_second(station: Station) -> None:
    def heard(hops: int, receiver: NodeId = OURS) -> Header:
        return station.packet(receiver).header._replace(origin=int(FAR), hops=hops)

    shows = station.one_way.must_show
    assert not shows(heard(0), now_ns=2 * S), "a neighbor knows the way"
    assert not shows(heard(1, FAR), now_ns=2 * S)
    assert not shows(heard(1, NodeId(0xFFFF)), now_ns=2 * S)
    assert [shows(heard(1), now_ns=at_ns) for at_ns in (2 * S, 3 * S - 1, 3 * S)] == [True, False, True]


def test_beside_turns_only_receipts_leave_the_turns(station: Station) -> None:
    receipts = encode_receipts([Receipt(0, 7, DELIVERED)], node=OURS)
    assert is_receipt(station.packet(FAR, receipts))
    beside = OneWay(station.port, station.neighbors, takes=is_receipt, not_before=lambda start_ns: start_ns + 5)
    assert beside.takes(station.packet(FAR, receipts))
    assert not beside.takes(station.packet(FAR))
    assert not beside.takes(station.packet(NodeId(0xFFFF), receipts))
    assert beside.send(station.packet(NEAR, receipts), start_ns=2 * S, now_ns=2 * S)
    assert station.requests[-1].start_ns == 2 * S + 5
