"""A packet for a neighbor goes to it alone; what it does not acknowledge goes the way of all others."""

from collections.abc import Callable

import pytest

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.forwarding.one_hop import OneHop
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire import Kind
from fanet_mw.wire.hello.beacon import Beacon, Role

MakeScenario = Callable[..., Scenario]
OURS, NEAR, FAR = NodeId(2), NodeId(3), NodeId(4)


class Station:
    """Node 2, which has heard node 3 at 1 s."""

    def __init__(self, make_scenario: MakeScenario) -> None:
        node = Node(OURS, make_scenario(**{"nodes.count": 5}), make_protocol, position=Enu(0.0, 0.0, 50.0))
        self.port: Port = node.port
        self.requests = node.requests
        self.neighbors = Neighbors(lifetime_ns=3 * S)
        self.hear()
        self.one_hop = OneHop(self.port, self.neighbors)

    def hear(self) -> None:
        self.neighbors.on_hello(Neighbor(NEAR, 1 * S, -60.0, Beacon(NEAR, 0, 0, 0, 0, 0, Role.MEMBER, 0)))

    def packet(self, receiver: NodeId) -> Packet:
        return self.port.announce(Kind.DATA, b"", now_ns=S, flags=0, hop_limit=8, destination=receiver)

    def end(self, outcome: TxOutcome, *, request: int = 0) -> Packet | None:
        return self.one_hop.failed(TxStatus(request, outcome, 2 * S, 1))


@pytest.fixture
def station(make_scenario: MakeScenario) -> Station:
    return Station(make_scenario)


@pytest.mark.parametrize(("receiver", "now_ns"), [(FAR, 2 * S), (NEAR, 5 * S), (NodeId(0xFFFF), 2 * S)])
def test_who_is_no_neighbor_or_none_any_more_gets_nothing_so(station: Station, receiver: NodeId, now_ns: int) -> None:
    assert not station.one_hop.send(station.packet(receiver), start_ns=now_ns, now_ns=now_ns)
    assert not station.requests


def test_a_neighbor_gets_the_packet_alone_and_nothing_follows_when_it_acknowledges(station: Station) -> None:
    assert station.one_hop.send(station.packet(NEAR), start_ns=2 * S, now_ns=2 * S)
    assert [request.dst for request in station.requests] == [NEAR]
    assert station.end(TxOutcome.ACKED) is None
    assert not len(station.one_hop)


@pytest.mark.parametrize("outcome", [TxOutcome.RETRY_LIMIT, TxOutcome.QUEUE_FULL, TxOutcome.LATE])
def test_a_neighbor_that_does_not_answer_is_none_until_its_next_hello(station: Station, outcome: TxOutcome) -> None:
    packet = station.packet(NEAR)
    assert station.one_hop.send(packet, start_ns=2 * S, now_ns=2 * S)
    assert station.end(TxOutcome.RETRY_LIMIT, request=7) is None, "a request of others"
    assert station.end(outcome) == packet
    assert not station.one_hop.send(packet, start_ns=2 * S, now_ns=2 * S)
    station.hear()
    assert station.one_hop.send(packet, start_ns=2 * S, now_ns=2 * S)
