"""What every part of the clustered protocol promises, whichever `clusters.relay` chose it.

The promises are in `fanet_mw/routing/clustered/contract.py`.
"""

import json
from collections.abc import Callable

import pytest

from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.build import RELAYS
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, PRIORITY_BULK, Header, Kind, filler
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.hello.digest import Digest

OURS, THEIRS = NodeId(2), NodeId(3)
NOW_NS = 1 * S


@pytest.fixture(params=sorted(RELAYS))
def node(request: pytest.FixtureRequest, make_scenario: Callable[..., Scenario]) -> Node:
    made = Node(OURS, make_scenario(**{"nodes.count": 5, "clusters.relay": request.param}), make_protocol,
                position=Enu(0.0, 0.0, 50.0))  # fmt: skip
    made.start(0)
    return made


def protocol_of(node: Node) -> Clustered:
    assert isinstance(node._protocol, Clustered)
    return node._protocol


def packet(seq: int, *, flags: int = FLAG_FLOOD, hop_limit: int = 8, kind: Kind = Kind.DATA) -> Packet:
    header = Header(900_000, seq, THEIRS, BROADCAST, THEIRS, kind, hop_limit, 0, PRIORITY_BULK, flags)
    return Packet(header, header.encode() + filler(40))


def heard(of: Packet) -> Reception:
    return Reception(of.frame, THEIRS, NOW_NS, -60.0)


def test_an_access_accounts_for_every_packet_that_it_is_to_forward(node: Node) -> None:
    """Each is requested, or waits, or is dropped with its reason."""
    protocol = protocol_of(node)
    for seq in range(20):
        protocol.parts.access.forward(packet(seq, flags=FLAG_TO_HEAD), start_ns=NOW_NS, now_ns=NOW_NS)
    assert len(node.requests) + protocol.waiting() + sum(node.dropped.values()) == 20


def test_an_access_tells_everyone_a_control_packet_of_the_node_or_keeps_it(node: Node) -> None:
    access = protocol_of(node).parts.access
    said = access.flood_control(Kind.JOIN, filler(40), now_ns=NOW_NS)
    assert said.header.origin == OURS
    assert said.header.flags == FLAG_FLOOD
    assert [r.start_ns >= NOW_NS for r in node.requests] + [True] * access.waiting() == [True]


def test_a_hello_goes_no_sooner_than_it_is_due(node: Node) -> None:
    for due_ns in range(NOW_NS, NOW_NS + 300 * MS, 7 * MS):
        assert protocol_of(node).parts.access.hello_start_ns(due_ns) >= due_ns


def test_an_answer_to_a_neighbor_goes_once_and_never_beyond_the_hop_limit(node: Node) -> None:
    access = protocol_of(node).parts.access
    access.answer(packet(1, hop_limit=1), due_ns=NOW_NS, now_ns=NOW_NS)
    assert not node.requests
    access.answer(packet(2, hop_limit=2), due_ns=NOW_NS, now_ns=NOW_NS)
    assert len(node.requests) + access.waiting() == 1


def test_a_relay_is_never_in_the_past_nor_beyond_the_hop_limit(node: Node) -> None:
    relaying = protocol_of(node).parts.relaying
    last, urgent = packet(1, hop_limit=1), packet(2, kind=Kind.SCHEDULE)
    assert not relaying.on_flood(last, heard(last), at_once=False, now_ns=NOW_NS)
    relays = [*relaying.on_flood(urgent, heard(urgent), at_once=True, now_ns=NOW_NS)]
    for seq in range(3, 20):
        relays += relaying.on_flood(packet(seq), heard(packet(seq)), at_once=False, now_ns=NOW_NS)
    assert relays[0][0] is urgent, "every node passes on what goes at once"
    assert min(start_ns for _, start_ns in relays) >= NOW_NS


def test_what_a_relaying_rule_leaves_open_is_decided_when_it_says(node: Node) -> None:
    parts = protocol_of(node).parts
    for seq in range(1, 9):
        parts.relaying.on_flood(packet(seq), heard(packet(seq)), at_once=False, now_ns=NOW_NS)
    open_before, decided = parts.contending.waiting(), []
    while (wake_ns := parts.contending.next_wake_ns()) is not None:
        assert wake_ns >= NOW_NS
        late_ns = wake_ns + 7 * MS
        relays = parts.contending.decided(late_ns)
        latest_ns = late_ns + node.scenario.radio.lead_ns
        assert all(late_ns <= start_ns < latest_ns for _, start_ns in relays), "lateness uses up the lead"
        decided += relays
    assert len(decided) == open_before
    assert parts.contending.waiting() == 0


def test_a_repair_of_a_process_that_was_woken_late_goes_no_later(make_scenario: Callable[..., Scenario]) -> None:
    """Its nodes contend, so that nothing but the wake-up can move its start."""
    made = Node(OURS, make_scenario(**{"nodes.count": 5, "clusters.repair_s": 5}), make_protocol,
                position=Enu(0.0, 0.0, 50.0))  # fmt: skip
    made.start(0)
    repair = protocol_of(made).parts.repair
    assert repair is not None
    repair.hold(packet(1), flooded=True, expect_ns=0, now_ns=NOW_NS)
    repair.on_digest(Digest((), complete=True), now_ns=NOW_NS + 1 * S)
    due_ns = repair.next_wake_ns()
    assert due_ns is not None
    made.wake(due_ns + 7 * MS)
    assert [r.start_ns for r in made.requests if r.frame[-40:] == filler(40)] == [due_ns + made.scenario.radio.lead_ns]


def test_roles_name_the_node_itself_and_bear_the_word_of_others(node: Node) -> None:
    roles = protocol_of(node).parts.roles
    roles.on_sign_of_life(THEIRS, born_ns=NOW_NS, now_ns=NOW_NS)
    roles.on_parent_lost(THEIRS, now_ns=NOW_NS)
    roles.on_flooding(NOW_NS)
    roles.before_hello(NOW_NS)
    beacon = roles.beacon(None, now_ns=NOW_NS)
    assert Beacon.decode_frame(packet(1).header.encode() + beacon.encode_frame(OURS)) == beacon
    assert (beacon.node, beacon.head, beacon.role) == (OURS, 0, Role.ISOLATED)
    assert 0 < roles.hello_share(NOW_NS) <= 1
    assert roles.report()["state"] == "seeking"


def test_every_part_reports_what_json_can_say_and_keys_of_its_own(node: Node) -> None:
    parts = protocol_of(node).parts
    reports = [parts.roles.report(), parts.access.report(), parts.relaying.report()]
    assert json.loads(json.dumps(reports)) == [dict(report) for report in reports]
    keys = [key for report in reports for key in report]
    assert len(keys) == len(set(keys))
