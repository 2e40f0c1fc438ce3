"""A node of the clustered protocol, by hand: what it relays, which leader it believes, and what it lets out."""

from collections.abc import Callable

import pytest

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, PRIORITY_BULK, PRIORITY_CONTROL, Header, Kind, filler
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.schedule import Join, Member, Schedule

LEADER, OURS, THEIRS, ANOTHER = NodeId(1), NodeId(2), NodeId(3), NodeId(4)
MakeScenario = Callable[..., Scenario]
MakeNode = Callable[..., Node]


@pytest.fixture
def make_node(make_scenario: MakeScenario) -> MakeNode:
    def make(**keys: object) -> Node:
        scenario = make_scenario(**{"nodes.count": 5, "radio.lead_ms": 0, **keys})
        made = Node(OURS, scenario, make_protocol, position=Enu(0.0, 0.0, 50.0))
        made.start(0)
        return made

    return make


def hear(node: Node, header: Header, inner: bytes = b"", *, at_ns: int = 1 * S) -> None:
    node.hear(Reception(header.encode() + inner, NodeId(header.prev_hop), at_ns, -60.0), at_ns)


def data(*, flags: int, destination: int = BROADCAST, hop_limit: int = 8) -> Header:
    return Header(900_000, 5, THEIRS, destination, ANOTHER, Kind.DATA, hop_limit, 1, PRIORITY_BULK, flags)


def name_head(node: Node, *, origin: int = LEADER) -> None:
    """A schedule names the node head of the second of two clusters: its slots are [5, 10) s of every 10 s."""
    members = (Member(THEIRS, 0, is_head=True), Member(OURS, 1, is_head=True))
    schedule = Schedule(0, 10_000_000, 5_000_000, 1, LEADER, 2, 0, 1, members, 0)
    header = Header(0, 9, origin, BROADCAST, origin, Kind.SCHEDULE, 8, 0, PRIORITY_CONTROL, FLAG_FLOOD)
    hear(node, header, schedule.encode_frame(LEADER), at_ns=100 * MS)


def sent(node: Node, kind: Kind = Kind.DATA) -> list[wire.Header]:
    return [header for r in node.requests if (header := wire.decode_header(r.frame)).kind == kind]


def test_a_packet_that_has_reached_its_receiver_goes_no_farther(make_node: MakeNode) -> None:
    node = make_node()
    name_head(node)
    for flags in (0, FLAG_TO_HEAD):
        hear(node, data(flags=flags, destination=OURS)._replace(seq=5 + flags), filler(40))
    assert sent(node) == []
    hear(node, data(flags=0, destination=THEIRS)._replace(seq=9), filler(60))
    assert len(sent(node)) == 1, "that of another one is flooded, because no way is known"


def test_a_hop_limit_ends_a_packet_on_its_way_to_a_head(make_node: MakeNode) -> None:
    node = make_node()
    hear(node, data(flags=FLAG_TO_HEAD, hop_limit=1), filler(40))
    assert node.report()["dropped"] == {DropReason.HOP_LIMIT: 1}
    assert node.report()["waiting"] == 0
    hear(node, data(flags=FLAG_TO_HEAD, hop_limit=2)._replace(seq=6), filler(40))
    assert node.report()["waiting"] == 1, "it is held until there is a way"


@pytest.mark.parametrize(("destination", "relays"), [(BROADCAST, 1), (ANOTHER, 1), (OURS, 0)])
def test_a_flood_ends_where_it_was_meant_for(make_node: MakeNode, destination: int, relays: int) -> None:
    node = make_node(**{"clusters.relay": "all"})
    hear(node, data(flags=FLAG_FLOOD, destination=destination), filler(40))
    assert len(sent(node)) == relays


@pytest.mark.parametrize(("copies", "relays"), [(0, 1), (1, 1), (2, 0)])
def test_a_relay_that_waits_for_copies_is_given_up_when_enough_have_come(
    make_node: MakeNode, copies: int, relays: int
) -> None:
    node = make_node(**{"clusters.relay": "counter", "clusters.counter": 3, "clusters.assess_ms": 500})
    hear(node, data(flags=FLAG_FLOOD), filler(40))
    for number in range(copies):
        hear(node, data(flags=FLAG_FLOOD), filler(40), at_ns=1 * S + number)
        hear(node, data(flags=FLAG_FLOOD)._replace(seq=6), filler(40), at_ns=1 * S + number)
    node.wake(2 * S)
    assert [header.seq for header in sent(node)].count(5) == relays, "copies of another packet do not count"


@pytest.mark.parametrize(("origin", "leader"), [(LEADER, LEADER), (ANOTHER, 0)])
def test_nobody_announces_for_another_leader(make_node: MakeNode, origin: int, leader: int) -> None:
    node = make_node(**{"clusters.flooding_period_s": 10, "clusters.count": 2})
    name_head(node, origin=origin)
    assert node.report()["leader"] == leader
    assert node.report()["dropped"] == ({} if leader else {DropReason.MALFORMED: 1})


def test_a_neighbor_is_gone_when_its_hellos_have_stopped_for_a_while(make_node: MakeNode) -> None:
    node = make_node(**{"routing.hello_interval_s": 1})
    beacon = Beacon(THEIRS, 0, 0, 0, 0, 0, Role.ISOLATED, 255)
    header = Header(1_000_000, 0x8000_0000, THEIRS, BROADCAST, THEIRS, Kind.HELLO, 1, 0, PRIORITY_CONTROL, 0)
    hear(node, header, beacon.encode_frame(THEIRS), at_ns=1 * S)
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    neighbors = protocol.parts.neighbors
    assert neighbors.count(now_ns=4500 * MS) == len(neighbors.alive(now_ns=4500 * MS)) == 1
    assert neighbors.count(now_ns=4501 * MS) == len(neighbors.alive(now_ns=4501 * MS)) == 0


def test_what_waits_at_a_head_beyond_its_lifetime_is_dropped_with_its_reason(make_node: MakeNode) -> None:
    node = make_node(**{"clusters.flooding_period_s": 10, "clusters.count": 2, "routing.lifetime_s": 2})
    name_head(node)
    node.send(filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=1 * S, now_ns=1 * S)
    node.wake(3 * S)
    assert node.report()["waiting"] == 1
    node.wake(3 * S + 1 * US)
    assert node.report()["waiting"] == 0
    assert node.report()["dropped"] == {DropReason.EXPIRED: 1}


def test_a_head_lets_out_together_what_fits_a_frame(make_node: MakeNode) -> None:
    keys = {"clusters.flooding_period_s": 10, "clusters.count": 2, "routing.aggregate": True}
    node = make_node(**keys, **{"radio.max_frame_bytes": 1400, "routing.lifetime_s": 60})
    name_head(node)
    for _ in range(5):
        node.send(filler(560), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=1 * S, now_ns=1 * S)
    node.requests.clear()
    node.wake(5 * S)
    first_ns = min(r.start_ns for r in node.requests)
    (frame,) = [r.frame for r in node.requests if r.start_ns == first_ns]
    assert len(wire.unbundle(frame)) == 2


# --- in a leader's name ---------------------------------------------------------------------------------------------


def test_a_leader_answers_the_latest_epochs_that_may_be_claimed_in_its_name_and_believes_none_beyond(
    make_scenario: MakeScenario,
) -> None:
    """Epoch 1 at 2 s: 1.3 s later there was time for one more, and sixteen may have been missed."""
    keys = {"nodes.count": 5, "radio.lead_ms": 0, "clusters.flooding_period_s": 5}
    leader = Node(LEADER, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    leader.start(0)
    joins = Header(1_000_000, 0x8000_0000, OURS, BROADCAST, OURS, Kind.JOIN, 8, 0, PRIORITY_CONTROL, FLAG_FLOOD)
    hear(leader, joins, Join(OURS, Enu(50.0, 0.0, 50.0), Enu(0.0, 0.0, 0.0)).encode_frame(OURS))
    at_ns = 1 * S
    while not leader.report()["epoch"]:
        at_ns += 10 * MS
        leader.wake(at_ns)
    began_ns = at_ns

    def claim(epoch: int, *, after_ms: int) -> None:
        t_ns = began_ns + after_ms * MS
        leader.wake(t_ns)
        members = (Member(THEIRS, 0, is_head=True),)
        schedule = Schedule(t_ns // US, 5_000_000, 5_000_000, epoch, LEADER, 1, 0, 1, members, 0)
        header = Header(
            t_ns // US, 900 + epoch, LEADER, BROADCAST, THEIRS, Kind.SCHEDULE, 8, 1, PRIORITY_CONTROL, FLAG_FLOOD
        )
        hear(leader, header, schedule.encode_frame(LEADER), at_ns=t_ns)

    claim(2, after_ms=650)
    claim(1 + 17, after_ms=1000)
    claim(1 + 18, after_ms=1010)
    assert leader.report()["dropped"] == {DropReason.OWN: 3, DropReason.MALFORMED: 1}
    for after_ms in range(1020, 8000, 10):
        leader.wake(began_ns + after_ms * MS)
    assert leader.report()["epoch"] == 19
