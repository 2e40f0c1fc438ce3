"""How a node treats a frame before its protocol sees it: duplicate, expired, for this node, several packets in one."""

import pytest
from kit import MakeScenario

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxOutcome, TxStatus
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.duplicates import DuplicateSet
from fanet_mw.node.header_check import CONTROL, RESTART_STEP_NS
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.node.packet_watch import RadioStage
from fanet_mw.routing import make_protocol
from fanet_mw.routing.flooding import Flooding
from fanet_mw.trace import Delivered, Dropped
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, PRIORITY_BULK, PRIORITY_REPORT, Header, Kind, filler

OURS, THEIRS, ANOTHER = NodeId(2), NodeId(3), NodeId(4)
PLAIN = Header(0, 7, THEIRS, BROADCAST, THEIRS, Kind.DATA, 8, 0, PRIORITY_BULK, FLAG_FLOOD)


@pytest.fixture
def node(make_scenario: MakeScenario) -> Node:
    """A node that floods and relays at once."""
    keys = {"nodes.count": 5, "routing.protocol": "flooding", "routing.jitter_ms": 0, "routing.lifetime_s": 5}
    keys |= {"routing.report_lifetime_s": 2, "radio.max_frame_bytes": 400, "traffic.payload_bytes": 100}
    made = Node(OURS, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 0.0))
    made.start(0)
    return made


def frame(**change: int) -> bytes:
    return PLAIN._replace(**change).encode() + filler(40)


def packet(**change: int) -> Packet:
    return Packet(PLAIN._replace(**change), frame(**change))


def hear(node: Node, data: bytes, *, at_ns: int = 1 * MS) -> bool:
    return node.hear(Reception(data, NodeId(wire.decode_header(data).prev_hop), at_ns, -60.0), at_ns)


def delivered(node: Node) -> list[Delivered]:
    return [record for record in node.records if isinstance(record, Delivered)]


def send(node: Node, **change: int) -> int:
    given = {"destination": BROADCAST, "priority": PRIORITY_BULK, "born_ns": 0, "now_ns": 0} | change
    return node.send(filler(40), app="test", **given)  # type: ignore[arg-type]


def test_packets_that_share_a_frame_share_its_status(node: Node) -> None:
    """Two packets of 76 bytes fit into a frame of 160; the third goes in one of its own, and nobody asks about it."""
    node.port.scenario = node.scenario.model_copy(
        update={"radio": node.scenario.radio.model_copy(update={"max_frame_bytes": 160})}
    )
    own = [node._own.make(Kind.DATA, filler(40), destination=BROADCAST, priority=0, flags=0, hop_limit=3, born_ns=0)
           for _ in range(3)]  # fmt: skip
    for one, wanted in zip(own, (False, True, False), strict=True):
        node._own.held.add(one.frame[wire.NAME])
        if wanted:
            node.watch.begin(one.header.seq, radio=True)
    node.port.transmit_together(own, flags=FLAG_FLOOD, at_ns=[5, 9])
    assert [(r.start_ns, r.wants_status) for r in node.requests] == [(5, True), (5, False), (9, False), (9, False)]
    node.watch.news.clear()
    node.on_status(TxStatus(node.requests[0].seq, TxOutcome.SENT, 5, 1), now_ns=6)
    assert [(news.seq, news.what) for news in node.watch.news] == [(own[1].header.seq, RadioStage.SENT)]


# --- known before -------------------------------------------------------------------------------------------------


def test_a_copy_is_known_though_a_generation_of_other_packets_came_in_between(node: Node) -> None:
    node._duplicates = DuplicateSet(capacity=10)
    assert not hear(node, frame(seq=100))
    for seq in range(200, 210):
        assert not hear(node, frame(seq=seq))
    assert hear(node, frame(seq=100, hops=1, prev_hop=ANOTHER)), "ten came in between: one generation"
    assert len(node.deliveries) == len(node.requests) == 11, "delivered and relayed once each"
    assert node.report()["dropped"] == {DropReason.DUPLICATE: 1}


def test_the_application_gets_a_packet_once_though_it_passes_in_both_phases(node: Node) -> None:
    hear(node, frame(flags=FLAG_TO_HEAD))
    hear(node, frame(flags=FLAG_FLOOD, prev_hop=ANOTHER, hops=1))
    assert len(node.deliveries) == len(delivered(node)) == 1


def test_what_a_node_made_itself_is_not_delivered_to_it(node: Node) -> None:
    seq = send(node)
    hear(node, frame(origin=OURS, seq=seq, prev_hop=THEIRS, hops=1, flags=FLAG_TO_HEAD))
    assert not node.deliveries


# --- for whom, and until when -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("destination", "is_ours"), [(BROADCAST, True), (OURS, True), (ANOTHER, False)])
def test_a_packet_is_delivered_to_whom_it_is_meant_for(node: Node, destination: int, is_ours: bool) -> None:
    hear(node, frame(destination=destination, hops=2))
    assert len(node.deliveries) == is_ours
    assert [(r.origin, r.seq, r.hops, r.delay_ns) for r in delivered(node)] == [(THEIRS, 7, 3, 1 * MS)] * is_ours


def test_a_delay_ends_when_the_application_has_the_packet(node: Node) -> None:
    node.hear(Reception(frame(origin_us=1000), THEIRS, 5 * MS, -60.0), 8 * MS)
    assert delivered(node) == [Delivered(8 * MS, OURS, THEIRS, 7, 7 * MS, 1, 3 * MS)]


def test_a_hello_that_is_old_when_it_is_heard_is_no_news_and_is_counted(node: Node) -> None:
    oldest_ns = node._header_check.oldest_hello_ns
    for seq, at_ns in ((1, oldest_ns), (2, oldest_ns + 1)):
        hear(node, frame(kind=Kind.HELLO, seq=seq, hop_limit=1, flags=0), at_ns=at_ns)
    assert [packet.header.seq for packet in node.hellos] == [1]
    assert node.report()["dropped"] == {DropReason.EXPIRED: 1}


@pytest.mark.parametrize(("priority", "lifetime_ns"), [(PRIORITY_BULK, 5 * S), (PRIORITY_REPORT, 2 * S)])
def test_a_packet_ends_at_the_lifetime_of_its_class(node: Node, priority: int, lifetime_ns: int) -> None:
    hear(node, frame(priority=priority, seq=1), at_ns=lifetime_ns)
    hear(node, frame(priority=priority, seq=2), at_ns=lifetime_ns + 1)
    assert [packet.header.seq for packet in node.deliveries] == [1]
    assert len(node.requests) == 1, "what has expired is not relayed either"
    assert node.report()["dropped"] == {DropReason.EXPIRED: 1}
    assert [r for r in node.records if isinstance(r, Dropped)] == [
        Dropped(lifetime_ns + 1, OURS, DropReason.EXPIRED, THEIRS, 2)
    ]


def test_a_relay_costs_one_of_the_hop_limit_and_a_hop_count_that_cannot_be_is_forged(node: Node) -> None:
    hear(node, frame(seq=1, hop_limit=8, hops=3))
    hear(node, frame(seq=2, hop_limit=8, hops=247))
    hear(node, frame(seq=3, hop_limit=8, hops=248))
    relayed = [wire.decode_header(request.frame) for request in node.requests]
    assert [(header.hop_limit, header.hops, header.prev_hop) for header in relayed] == [(7, 4, OURS), (7, 248, OURS)]
    assert node.report()["dropped"] == {DropReason.FORGED: 1}


# --- several in one frame -----------------------------------------------------------------------------------------


def test_a_bundle_is_one_reception_of_several_packets(node: Node) -> None:
    hear(node, wire.bundle([frame(seq=1), frame(seq=2), frame(seq=3)]))
    assert [packet.header.seq for packet in node.deliveries] == [1, 2, 3]
    assert node.report()["receptions"] == 1
    (request,) = node.requests
    assert len(wire.unbundle(request.frame)) == 3, "what they make it send goes together again"
    hear(node, wire.bundle([frame(seq=2), frame(seq=3), frame(seq=4)]))
    assert node.report()["dropped"] == {DropReason.DUPLICATE: 2}, "each packet by itself"


@pytest.mark.parametrize("starts_ms", [(20, 30), (30, 20)])
def test_packets_that_share_a_frame_go_at_the_first_instant_of_them(node: Node, starts_ms: tuple[int, int]) -> None:
    node.port.relay_together([(packet(seq=seq), start_ms * MS) for seq, start_ms in enumerate(starts_ms)])
    assert [request.start_ns for request in node.requests] == [20 * MS]


def test_a_shared_frame_is_no_longer_than_frames_may_be(node: Node) -> None:
    """100 bytes and a little each: three fit 400 bytes, a fourth does not."""
    one = len(frame())
    fit = 400 // one
    node.port.relay_together([(packet(seq=seq), 1 * MS) for seq in range(2 * fit + 1)])
    assert [len(request.frame) for request in node.requests] == [fit * one, fit * one, one]


# --- its own packets ----------------------------------------------------------------------------------------------


def test_packets_of_one_origin_are_numbered_without_gaps_whatever_control_goes_in_between(node: Node) -> None:
    numbers = []
    for _ in range(3):
        numbers.append(send(node))
        node.port.announce(Kind.ROUTING, b"", now_ns=0, flags=0, hop_limit=1)
    assert numbers == [numbers[0], numbers[0] + 1, numbers[0] + 2]


class Boastful(Flooding):
    """Reports under names that the node and results have."""

    def report(self) -> dict[str, object]:
        return {
            "receptions": 0,
            "kind": "emulator",
            "messages": 3,
            "waiting": "a",
            "missed_turns": -1,
            "slots": 16,
            "turns": [1, 2],
            "role": 5,
            "head": "x",
            "cluster": 1e9,
            "epoch": 7,
            "own": 1,
        }


def test_a_protocol_of_another_package_reports_under_no_name_of_ours(make_scenario: MakeScenario) -> None:
    node = Node(
        OURS,
        make_scenario(**{"routing.protocol": "flooding"}),
        Boastful,
        position=Enu(0.0, 0.0, 0.0),
    )
    told = dict(node.report())
    assert (told["receptions"], told["epoch"], told["own"]) == (0, 7, 1)
    strange = {"receptions": 0, "kind": "emulator", "messages": 3, "waiting": "a", "missed_turns": -1,
               "slots": 16, "turns": [1, 2], "role": 5, "head": "x", "cluster": 1e9}  # fmt: skip
    assert {key: told[f"protocol.{key}"] for key in strange} == strange
    assert not strange.keys() & told.keys() - {"receptions"}


@pytest.mark.parametrize(("woken_ms", "start_ms"), [(100, 120), (115, 120), (120, 120), (150, 150)])
def test_the_first_frame_of_a_packet_goes_a_lead_after_its_birth(
    make_scenario: MakeScenario, woken_ms: int, start_ms: int
) -> None:
    """Born at 100 ms, with a lead of 20 ms; an application that is woken late has that much less of the lead."""
    keys = {"nodes.count": 5, "routing.protocol": "flooding", "radio.lead_ms": 20}
    node = Node(OURS, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 0.0))
    node.start(0)
    send(node, born_ns=100 * MS, now_ns=woken_ms * MS)
    assert [request.start_ns for request in node.requests] == [start_ms * MS]


def test_a_node_that_starts_again_does_not_reuse_the_names_of_its_packets(node: Node) -> None:
    before = [send(node) for _ in range(100)]
    node.start(10 * S)
    assert send(node, born_ns=10 * S, now_ns=10 * S) > max(before)


def test_numbers_begin_again_when_their_bits_are_used_up_and_each_kind_keeps_its_own(node: Node) -> None:
    """A node that started 59 h 39 min after the swarm ended within a second, by a number that had no room."""
    started_ns = (CONTROL - 2) * RESTART_STEP_NS
    node.start(started_ns)
    made = [send(node, born_ns=started_ns, now_ns=started_ns) for _ in range(4)]
    assert made == [CONTROL - 2, CONTROL - 1, 0, 1]
    said = [node.say_hello(b"", start_ns=started_ns, now_ns=started_ns).number for _ in range(4)]
    assert said == [CONTROL + number for number in made]
    assert [node._own.handed_on(number) for number in (CONTROL - 3, *made, 2, *said)] == [
        False, True, True, True, True, False, False, False, False, False,
    ]  # fmt: skip


def test_a_packet_longer_than_frames_may_be_is_a_mistake_of_the_caller(node: Node) -> None:
    with pytest.raises(LocalProtocolError, match=r"packet of 426 bytes must be <= 400"):
        node.send(filler(390), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=0, now_ns=0)


def test_a_drop_is_counted_and_recorded(node: Node) -> None:
    hear(node, frame(hop_limit=1), at_ns=300 * US)
    assert node.report()["dropped"] == {DropReason.HOP_LIMIT: 1}
    assert [r for r in node.records if isinstance(r, Dropped)] == [
        Dropped(300 * US, OURS, DropReason.HOP_LIMIT, THEIRS, 7)
    ]
