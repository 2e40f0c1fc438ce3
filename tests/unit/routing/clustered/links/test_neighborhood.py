"""What hellos say of two hops: links that both ends confirm, and neighbors as long as they speak."""

import pytest
from kit import MakeScenario

from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.links.neighborhood import Neighborhood
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import Header, Kind
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.hello.neighbors import HeardNeighbor, NeighborList

US, LIFETIME_NS = NodeId(1), 3 * S


def hello(node: int, *neighbors: int) -> NeighborList:
    return NeighborList(NodeId(node), tuple(HeardNeighbor(NodeId(n), hears_us=True) for n in neighbors))


@pytest.fixture
def near() -> Neighborhood:
    return Neighborhood(US, lifetime_ns=LIFETIME_NS)


def test_a_link_counts_when_both_ends_say_so(near: Neighborhood) -> None:
    near.on_neighbor_list(hello(2, 1, 3), now_ns=0)
    near.on_neighbor_list(hello(4, 5), now_ns=0)
    assert near.adjacency(now_ns=0) == {1: (2,), 2: (1, 3)}, "node 4 does not hear us"
    assert [(h.node, h.hears_us) for h in near.heard(now_ns=0)] == [(2, True), (4, False)]


def test_a_neighbor_is_one_as_long_as_it_speaks(near: Neighborhood) -> None:
    near.on_neighbor_list(hello(2, 1), now_ns=0)
    near.on_neighbor_list(hello(3, 1), now_ns=2 * S)
    assert [said.node for said in near.alive(now_ns=LIFETIME_NS)] == [2, 3]
    assert [said.node for said in near.alive(now_ns=LIFETIME_NS + 1)] == [3]
    assert near.adjacency(now_ns=LIFETIME_NS + 1) == {1: (3,), 3: (1,)}


@pytest.mark.parametrize(("speaker", "known"), [(3, [3]), (4, [])])
def test_a_hello_speaks_for_its_sender_alone(make_scenario: MakeScenario, speaker: int, known: list[int]) -> None:
    node = Node(
        NodeId(2), make_scenario(**{"nodes.count": 9, "clusters.relay": "cds"}), make_protocol, position=Enu(0, 0, 50)
    )
    node.start(0)
    header = Header(1000, 0x8000_0001, 3, BROADCAST, 3, Kind.HELLO, 1, 0, 0, 0)
    beacon = Beacon(3, 0, 0, 0, 0, 0, Role.ISOLATED, 255).encode_frame(3)
    node.hear(Reception(header.encode() + beacon + hello(speaker).encode_frames(), NodeId(3), 5 * MS, -60.0), 5 * MS)
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    assert protocol.parts.two_hops is not None
    assert [other.node for other in protocol.parts.two_hops.neighbor_list(6 * MS).heard] == known
