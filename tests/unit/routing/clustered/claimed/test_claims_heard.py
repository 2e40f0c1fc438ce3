"""How a node treats claims in hellos: impossible ones, claims about third nodes, and how many lots a rival has."""

import pytest
from kit import MakeScenario

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.claimed.claimed_access import ClaimedAccess
from fanet_mw.routing.clustered.claimed.own_turns import Share, draws
from fanet_mw.routing.clustered.claimed.slot_acquisition import SlotAcquisition
from fanet_mw.routing.clustered.claimed.slot_claims import SlotClaim, SlotClaims, SlotHello
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import Header, Kind
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.hello.claims import Claims, SlotStatus


@pytest.fixture
def node(make_scenario: MakeScenario) -> Node:
    made = Node(
        NodeId(2), make_scenario(**{"nodes.count": 9, "clusters.relay": "claimed"}), make_protocol,
        position=Enu(0.0, 0.0, 50.0),
    )  # fmt: skip
    made.start(0)
    return made


def claiming_of(node: Node) -> SlotAcquisition:
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    assert isinstance(protocol.parts.access, ClaimedAccess)
    return protocol.parts.access._claiming


def test_no_node_calls_itself_leader_where_nobody_assigns_anything(node: Node) -> None:
    """Neither in its report nor in its hellos on the air, however long it flies."""
    for second in range(1, 15):
        node.wake(second * S)
        node.say_hello(b"", start_ns=second * S, now_ns=second * S)
    beacons = [Beacon.decode_frame(request.frame) for request in node.requests]
    assert len(beacons) == 14
    assert {(beacon.leader, beacon.term, beacon.role) for beacon in beacons} == {(0, 0, Role.ISOLATED)}
    assert not {"state", "leader", "term"} & node.report().keys(), "it has no part in a swarm that has no parts"


@pytest.mark.parametrize(("length", "slot"), [(8, 3), (7, None), (1 << 20, None)])
def test_a_superframe_that_cannot_be_is_no_claim(node: Node, length: int, slot: int | None) -> None:
    claim = claiming_of(node).claim_of(NodeId(5), SlotStatus(slot=3, length=length, crowd=4))
    assert (claim.slot, claim.crowd) == (slot, 4)


@pytest.mark.parametrize(("speaker", "known"), [(3, [3]), (4, [])])
def test_a_hello_speaks_for_its_sender_alone(node: Node, speaker: int, known: list[int]) -> None:
    header = Header(1000, 0x8000_0001, 3, BROADCAST, 3, Kind.HELLO, 1, 0, 0, 0)
    beacon = Beacon(3, 0, 0, 0, 0, 0, Role.ISOLATED, 255).encode_frame(3)
    inner = beacon + Claims(NodeId(speaker), SlotStatus(slot=1, length=8), ()).encode_frames()
    node.hear(Reception(header.encode() + inner, NodeId(3), 5 * MS, -60.0), 5 * MS)
    assert wire.decode_header(header.encode() + inner).origin == 3
    assert [claims.node for claims in claiming_of(node).near.alive(now_ns=6 * MS)] == known


@pytest.mark.parametrize("said", [(3, 1), (1, 3)])
def test_a_rival_has_the_most_lots_that_anyone_says_it_has(said: tuple[int, int]) -> None:
    rivals = [(NodeId(5), lots) for lots in said]
    assert draws(NodeId(2), 1, [(NodeId(5), Share(0, 8))], rivals).rivals == ((5, 3),)


def test_a_shorter_superframe_waits_until_it_has_been_possible_for_a_while() -> None:
    """Five neighbors leave: six nodes need eight slots, one needs one, but their hellos may only have been lost."""
    claims = SlotClaims(NodeId(1), now_ns=0, listen_ns=0, lifetime_ns=3 * S, sized_to=16)
    for other in range(2, 7):
        claims.on_hello(SlotHello(SlotClaim(NodeId(other), other, 0, 8, 6), ()), now_ns=0)
    lengths = [claims.step(second * S).own.length for second in range(14)]
    assert lengths[:4] == [8] * 4
    assert lengths.count(8) == 4 + 7, "the eighth superframe in a row decides"
    assert lengths[-1] == 1
