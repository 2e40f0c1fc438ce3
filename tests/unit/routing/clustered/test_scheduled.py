"""One node in a timetable made by hand: what it relays in which turn, what it misses, and what it keeps out of turns.

node 3 (root) in turn 27 -> node 4 in turn 28 -> we, node 2, in turn 31 - 29 = 2 of the next superframe -> ...
"""

from collections.abc import Callable

import pytest

from fanet_mw import wire
from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.node_timetable import UNANNOUNCED, FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.routing.clustered.timetable.turn_access import TurnAccess
from fanet_mw.scenario import Scenario
from fanet_mw.trace import BoundStated, Dropped
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S, earliest
from fanet_mw.wire import (
    FLAG_FLOOD,
    FLAG_TO_HEAD,
    PRIORITY_BULK,
    PRIORITY_REPORT,
    PRIORITY_SAFETY,
    Content,
    Header,
    Kind,
    filler,
)
from fanet_mw.wire.hello.digest import Digest, Holding
from fanet_mw.wire.places import Places
from fanet_mw.wire.schedule import Join, Member, Schedule

US, ROOT, BEFORE, AFTER = NodeId(2), NodeId(3), NodeId(4), NodeId(5)
TURNS = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)
FLOODS = (
    Turn(5, ROOT, ROOT, 0),
    Turn(8, US, ROOT, 0),
    Turn(27, ROOT, ROOT, 1),
    Turn(28, BEFORE, ROOT, 1),
    Turn(31, US, ROOT, 1),
    Turn(12, US, US, 0),
    Turn(14, ROOT, US, 0),
)  # fmt: skip
MakeScenario = Callable[..., Scenario]


def planned(turns: tuple[Turn, ...], *, valid_ns: int = 0, unreached: tuple[NodeId, ...] = ()) -> NodeTimetable:
    table = Timetable(turns, {ROOT: 5, US: 3}, {ROOT: (), US: unreached}, len(turns))
    return NodeTimetable.of(
        US, valid_ns, FittedTimetable(TURNS, table, together=1, frame_bytes=1024, whole=True, enough=True)
    )


@pytest.fixture
def node(make_scenario: MakeScenario) -> Node:
    return in_turns(make_scenario)


def in_turns(make_scenario: MakeScenario, **more: object) -> Node:
    keys = {"nodes.count": 5, "clusters.relay": "scheduled", "clusters.flooding_period_s": 0.1, "radio.lead_ms": 2}
    keys |= {"clusters.contention_ms": 40, "traffic.interval_s": 1, **more}
    made = Node(US, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    made.start(0)
    access_of(made)._timetables.in_order = [planned(FLOODS)]
    access_of(made)._has_shown = access_of(made)._timetables.newest
    followers = access_of(made)._delays._followers
    followers.follow(UNANNOUNCED)
    followers.hear(UNANNOUNCED, ROOT, now_ns=10 * S)
    return made


def access_of(node: Node) -> TurnAccess:
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    assert isinstance(protocol.parts.access, TurnAccess)
    return protocol.parts.access


def hear_in_turn(
    node: Node, sender: NodeId, turn: int, *, superframe: int = 10, told_ns: int = 0, hop_limit: int = 9
) -> None:
    """A packet of the root, of one millisecond, in a turn; the application has it `told_ns` after its end."""
    end_ns = TURNS.start_ns(turn, superframe_start_ns=superframe * 100 * MS) + MS
    seq = 1000 * superframe + turn
    hops = 0 if sender == ROOT else 1
    header = Header(end_ns // 1000 - 5000, seq, ROOT, BROADCAST, sender, Kind.DATA, hop_limit, hops, 3, FLAG_FLOOD)
    node.hear(Reception(header.encode() + filler(40), sender, end_ns, -60.0), end_ns + told_ns)


def relays(node: Node) -> list[float]:
    """When it relays data [ms]."""
    return [r.start_ns / MS for r in node.requests if wire.decode_header(r.frame).kind == Kind.DATA]


def test_a_flood_is_relayed_in_our_turn_of_it(node: Node) -> None:
    hear_in_turn(node, ROOT, 5)
    assert relays(node) == [1040 + 8 * 2]


def test_a_flood_that_goes_on_in_the_next_superframe_is_relayed_there(node: Node) -> None:
    hear_in_turn(node, BEFORE, 28)
    assert relays(node) == [1100 + 40 + 2 * 2]


@pytest.mark.parametrize(
    ("more", "waits"),
    [
        ({}, True),
        ({"mobility.model": "formation"}, True),
        ({"mobility.model": "random_waypoint"}, False),
        ({"mobility.model": "random_waypoint", "clusters.links": "measured"}, True),
    ],
)
def test_joins_keep_out_of_turns_only_where_something_is_promised(
    make_scenario: MakeScenario, more: dict[str, object], waits: bool
) -> None:
    """After the loss of a leader all join anew, and windows have no room for that."""
    node = in_turns(make_scenario, **more)
    for number in range(8):
        header = Header(1_050_000, number, NodeId(5), BROADCAST, BEFORE, Kind.JOIN, 9, 1, 0, FLAG_FLOOD)
        join = Join(5, Enu(0.0, 0.0, 50.0), Enu(0.0, 0.0, 0.0), 0).encode_frame(NodeId(5))
        node.hear(Reception(header.encode() + join, BEFORE, 1051 * MS, -60.0), 1051 * MS)
    access_of(node).flood_control(Kind.JOIN, filler(40), now_ns=1051 * MS)
    starts = [request.start_ns % (100 * MS) for request in node.requests]
    assert len(starts) == 9
    assert (max(starts) < 40 * MS) == waits
    assert (starts[-1] < 40 * MS) == waits, "our own"


def test_a_flood_of_the_superframe_before_is_relayed_in_this_one(node: Node) -> None:
    """Heard from another in turn 29 + 1: it began at 1000 ms, and so our turn 29 + 2 lies at 1144 ms."""
    late = (*FLOODS[:3], Turn(30, AFTER, ROOT, 1), *FLOODS[4:])
    access_of(node)._timetables.in_order = [planned(late)]
    hear_in_turn(node, AFTER, 1, superframe=11)
    assert relays(node) == [1100 + 40 + 2 * 2]


def test_what_comes_together_goes_on_together_in_each_of_our_turns_of_it(node: Node) -> None:
    access_of(node)._timetables.in_order = [
        planned((Turn(5, ROOT, ROOT, 0), Turn(8, US, ROOT, 0), Turn(10, US, ROOT, 0)))
    ]
    end_ns = TURNS.start_ns(5, superframe_start_ns=1000 * MS) + MS
    frames = [
        Header(end_ns // 1000, seq, ROOT, BROADCAST, ROOT, Kind.DATA, 9, 0, 3, FLAG_FLOOD).encode() + filler(40)
        for seq in (1, 2)
    ]
    node.hear(Reception(wire.bundle(frames), ROOT, end_ns, -60.0), end_ns)
    sent = [(r.start_ns / MS, [wire.decode_header(f).seq for f in wire.unbundle(r.frame)]) for r in node.requests]
    assert sent == [(1040 + 8 * 2, [1, 2]), (1040 + 10 * 2, [1, 2])]


def test_a_part_of_an_assignment_of_before_takes_no_part_of_the_newest_away(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 4, "clusters.count": 3, "clusters.relay": "scheduled", "radio.lead_ms": 0}
    node = Node(US, make_scenario(**keys, **{"clusters.flooding_period_s": 1}), make_protocol, position=Enu(0, 0, 50))
    node.start(0)
    members = [Member(NodeId(n), n - 2, is_head=True) for n in (2, 3, 4)]
    parts = {0: members[:2], 1: members[2:]}
    for seq, (epoch, part) in enumerate([(2, 0), (1, 1), (2, 1)], start=1):
        assert access_of(node)._timetables.newest is None
        now_ns = seq * 100 * MS
        named = tuple(parts[part])
        places = Places(tuple(Enu(100.0 * one.node, 0.0, 50.0) for one in named), Enu(100.0, 0.0, 50.0))
        told = Schedule(0, 1_000_000, 333_333, epoch, ROOT - 2, 3, part, 2, named, 0).encode_frame(1)
        header = Header(now_ns // 1000, seq, ROOT - 2, BROADCAST, ROOT - 2, Kind.SCHEDULE, 9, 0, 0, FLAG_FLOOD)
        node.hear(Reception(header.encode() + told + places.encode_frames(1), NodeId(1), now_ns, -60.0), now_ns)
    assert node.dropped == {}
    newest = access_of(node)._timetables.newest
    assert newest is not None
    assert newest.version.epoch == 2


def test_a_packet_that_waits_for_its_turn_answers_nobody(node: Node) -> None:
    """Who hears it out of turn would not relay it, nor its flood, of which it would be a copy."""
    access, now_ns = access_of(node), 1050 * MS
    access.use_turns(now_ns)
    header = Header(now_ns // 1000, 1, US, BROADCAST, US, Kind.DATA, 9, 0, PRIORITY_BULK, 0)
    packet = Packet(header, header.encode() + filler(40))
    access.forward(packet, start_ns=now_ns, now_ns=now_ns)
    access.answer(packet, due_ns=now_ns, now_ns=now_ns)
    assert node.requests == []
    access.wake(1064 * MS)
    assert [request.start_ns for request in node.requests] == [1064 * MS], "the flood"
    access.answer(packet, due_ns=1500 * MS, now_ns=1500 * MS)
    assert len(node.requests) == 2


def test_a_join_that_can_wait_goes_in_a_turn_that_nothing_else_needs(node: Node) -> None:
    access = access_of(node)
    access.use_turns(1050 * MS)
    access.flood_control(Kind.JOIN, filler(40), patient=True, now_ns=1050 * MS)
    assert node.requests == [], "it does not contend"
    access.wake(1062 * MS)
    assert [(r.start_ns / MS, wire.decode_header(r.frame).kind) for r in node.requests] == [(1064, Kind.JOIN)]


def test_data_that_comes_later_goes_before_a_join_that_can_wait(node: Node) -> None:
    access = access_of(node)
    access.use_turns(1050 * MS)
    access.flood_control(Kind.JOIN, filler(40), patient=True, now_ns=1050 * MS)
    node.send(filler(920), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=1051 * MS, now_ns=0)
    access.wake(1062 * MS)
    access.wake(1162 * MS)
    said = [(r.start_ns / MS, wire.decode_header(r.frame).kind) for r in node.requests]
    assert said == [(1064, Kind.DATA), (1164, Kind.JOIN)]


@pytest.mark.parametrize("patient", [True, False])
def test_a_join_contends_where_data_waits_or_when_it_must_not_wait(node: Node, *, patient: bool) -> None:
    access = access_of(node)
    access.use_turns(1050 * MS)
    if patient:
        node.send(filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=1050 * MS, now_ns=0)
    access.flood_control(Kind.JOIN, filler(40), patient=patient, now_ns=1050 * MS)
    (request,) = node.requests
    assert TURNS.turn_at(request.start_ns) is None


@pytest.mark.parametrize(("told_ns", "is_relayed"), [(5 * MS, True), (5 * MS + 1, False), (30 * MS, False)])
def test_a_turn_that_has_begun_is_missed_counted_and_not_relayed_late(
    node: Node, told_ns: int, is_relayed: bool
) -> None:
    """Heard at 1051 ms, its turn begins at 1056 ms."""
    hear_in_turn(node, ROOT, 5, told_ns=told_ns)
    assert len(node.deliveries) == 1, "the application has it whether or not it is relayed"
    assert relays(node) == [1056.0] * is_relayed
    assert node.report()["missed_turns"] == 1 - is_relayed
    assert node.dropped[DropReason.MISSED_TURN] == 1 - is_relayed, "it ends here, with its reason"


def test_a_hop_limit_holds_in_turns_and_what_it_ends_is_counted(node: Node) -> None:
    hear_in_turn(node, ROOT, 5, hop_limit=1)
    assert len(node.deliveries) == 1
    assert relays(node) == []
    assert node.dropped == {DropReason.HOP_LIMIT: 1}


def test_what_is_heard_in_no_turn_of_its_flood_is_not_relayed_and_counted(node: Node) -> None:
    hear_in_turn(node, AFTER, 5)
    assert relays(node) == []
    assert node.dropped[DropReason.OUT_OF_TURN] == 1
    assert [r.reason for r in node.records if isinstance(r, Dropped)] == [DropReason.OUT_OF_TURN]


def hear(node: Node, sender: NodeId, end_ns: int, *, seq: int = 1) -> None:
    """A packet of the root that ends at an instant."""
    hops = 0 if sender == ROOT else 1
    header = Header(end_ns // 1000 - 5000, seq, ROOT, BROADCAST, sender, Kind.DATA, 9, hops, 3, FLAG_FLOOD)
    node.hear(Reception(header.encode() + filler(40), sender, end_ns, -60.0), end_ns)


@pytest.mark.parametrize(("late", "starts_ms"), [(0, [1056.0]), (2, [1056.0]), (3, []), (8, []), (9, [])])
def test_a_frame_that_found_the_medium_busy_is_relayed_in_our_turn_if_that_is_still_to_come(
    node: Node, late: int, starts_ms: list[float]
) -> None:
    """The root's turn is the fifth, ours the eighth; where the frame ended nothing is planned."""
    hear(node, ROOT, TURNS.start_ns(5 + late, superframe_start_ns=1000 * MS) + MS)
    assert relays(node) == starts_ms
    assert node.dropped == ({} if starts_ms else {DropReason.MISSED_TURN if late <= 8 else DropReason.OUT_OF_TURN: 1})


def test_a_late_frame_of_a_sender_whose_turn_is_of_another_flood_is_relayed_too(node: Node) -> None:
    access_of(node)._timetables.in_order = [planned((*FLOODS[:2], Turn(6, ROOT, AFTER, 0), Turn(7, US, AFTER, 0)))]
    hear(node, ROOT, TURNS.start_ns(6, superframe_start_ns=1000 * MS) + MS)
    assert relays(node) == [1056.0]


def copied(node: Node, end_ns: int, *, by: NodeId, transmitter: NodeId) -> None:
    """A copy of what `hear` gave the node, as the node `by` sends it, heard from a station."""
    header = Header(end_ns // 1000 - 5000, 1, ROOT, BROADCAST, by, Kind.DATA, 9, by != ROOT, 3, FLAG_FLOOD)
    node.hear(Reception(header.encode() + filler(40), transmitter, end_ns + 5 * MS, -60.0), end_ns + 5 * MS)


@pytest.mark.parametrize("heard_again", [False, True])
def test_what_came_too_late_goes_in_our_turn_of_the_next_superframe_unless_another_node_has_sent_it(
    node: Node, *, heard_again: bool
) -> None:
    access_of(node)._timetables.in_order = [planned(FLOODS[:2])]
    end_ns = TURNS.start_ns(9, superframe_start_ns=1000 * MS) + MS
    hear(node, ROOT, end_ns)
    if heard_again:
        copied(node, end_ns, by=AFTER, transmitter=AFTER)
    while (due_ns := access_and_repair_due(node)) is not None and due_ns < 1400 * MS:
        node.wake(due_ns)
    assert relays(node) == ([] if heard_again else [1156.0])


def access_and_repair_due(node: Node) -> int | None:
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    assert protocol.parts.repair is not None
    resumed = access_of(node)._resumed
    assert resumed is not None
    return earliest(protocol.parts.repair.next_wake_ns(), resumed.next_wake_ns())


def test_a_turn_in_which_something_newer_is_relayed_is_not_taken_for_what_was_missed(node: Node) -> None:
    """What was missed waits for the next one; what is newer and comes then is not sent in the same turn."""
    access_of(node)._timetables.in_order = [planned(FLOODS[:2])]
    hear(node, ROOT, TURNS.start_ns(9, superframe_start_ns=1000 * MS) + MS)
    while (due_ns := access_and_repair_due(node)) is not None and due_ns < 1140 * MS:
        node.wake(due_ns)
    hear_in_turn(node, ROOT, 5, superframe=11)
    node.wake(1154 * MS)
    assert relays(node) == [1156.0], "what is newer"
    node.wake(1254 * MS)
    assert relays(node) == [1156.0, 1256.0]
    hear_in_turn(node, ROOT, 5, superframe=12)
    assert relays(node) == [1156.0, 1256.0]


def test_what_was_missed_keeps_out_of_turns_that_the_next_timetable_gives_to_another(node: Node) -> None:
    """It waited for the turn at 1156 ms, and sent there whatever was in force by then: it broke bounds of others."""
    access = access_of(node)
    access._timetables.in_order = [planned(FLOODS[:2])]
    hear(node, ROOT, TURNS.start_ns(9, superframe_start_ns=1000 * MS) + MS)
    (packet,) = node.deliveries
    assert access._resumed is not None
    assert access._resumed.resume(packet, now_ns=1062 * MS)
    changed = (FLOODS[0], Turn(8, AFTER, ROOT, 0), Turn(11, US, ROOT, 0))
    access._timetables.in_order = [planned(FLOODS[:2]), planned(changed, valid_ns=1100 * MS)]
    while (due_ns := access._resumed.next_wake_ns()) is not None and due_ns < 1400 * MS:
        access._resumed.wake(due_ns)
    assert relays(node) == [1162.0]


def test_what_was_missed_contends_where_the_node_has_no_turn_of_its_flood(node: Node) -> None:
    access_of(node)._timetables.in_order = [planned((Turn(5, ROOT, ROOT, 0), Turn(12, US, US, 0)))]
    hear(node, ROOT, TURNS.start_ns(5, superframe_start_ns=1000 * MS) + MS)
    (packet,) = node.deliveries
    access_of(node).answer(packet, due_ns=1500 * MS, now_ns=1500 * MS)
    (start_ms,) = relays(node)
    assert TURNS.turn_at(round(start_ms * MS)) is None


def test_a_hello_asks_for_a_packet_that_was_missed_and_states_nothing_before(node: Node) -> None:
    def asked(at_ns: int) -> Digest | None:
        node.requests.clear()
        node.say_hello(b"", start_ns=at_ns, now_ns=at_ns)
        return Digest.decode_frames(Content.of(node.requests[-1].frame))

    hear(node, ROOT, 1051 * MS, seq=1)
    assert asked(1600 * MS) is None
    hear(node, ROOT, 1651 * MS, seq=3)
    assert asked(2100 * MS) is None, "it may be under way"
    assert asked(2151 * MS) == Digest((Holding(ROOT, 3, 0b10),), complete=True)
    hear(node, ROOT, 2251 * MS, seq=2)
    assert asked(3000 * MS) is None


def test_a_copy_that_another_station_repeats_as_it_is_cancels_nothing(node: Node) -> None:
    end_ns = TURNS.start_ns(9, superframe_start_ns=1000 * MS) + MS
    hear(node, ROOT, end_ns)
    copied(node, end_ns, by=ROOT, transmitter=AFTER)
    assert access_and_repair_due(node) is not None
    copied(node, end_ns, by=ROOT, transmitter=ROOT)
    assert access_and_repair_due(node) is None


@pytest.mark.parametrize(("early_us", "is_relayed"), [(0, True), (50, True), (51, False)])
@pytest.mark.parametrize("turn_before", [(), (Turn(4, ROOT, US, 0),)])
def test_by_a_clock_that_is_behind_a_frame_ends_before_its_turn_and_is_relayed_within_the_slack(
    node: Node, early_us: int, *, is_relayed: bool, turn_before: tuple[Turn, ...]
) -> None:
    """The frame of the fifth turn ends in the fourth, empty or with another flood of its sender."""
    access_of(node)._timetables.in_order = [planned((*turn_before, *FLOODS))]
    end_ns = TURNS.start_ns(5, superframe_start_ns=1000 * MS) - early_us * 1000
    header = Header(end_ns // 1000 - 5000, 1, ROOT, BROADCAST, ROOT, Kind.DATA, 9, 0, 3, FLAG_FLOOD)
    node.hear(Reception(header.encode() + filler(40), ROOT, end_ns, -60.0), end_ns)
    assert relays(node) == [1056.0] * is_relayed
    assert node.dropped[DropReason.OUT_OF_TURN] == 1 - is_relayed


def test_the_newest_timetable_in_force_counts(node: Node) -> None:
    other = (Turn(5, ROOT, ROOT, 0), Turn(20, US, ROOT, 0), Turn(12, US, US, 0))
    access_of(node)._timetables.in_order = [planned(FLOODS), planned(other, valid_ns=2000 * MS)]
    hear_in_turn(node, ROOT, 5, superframe=10)
    hear_in_turn(node, ROOT, 5, superframe=20)
    assert relays(node) == [1056, 2040 + 20 * 2]


@pytest.mark.parametrize(
    ("priority", "size", "fits"),
    [
        (PRIORITY_BULK, 224, True), (PRIORITY_BULK, 225, False), (PRIORITY_SAFETY, 225, False),
        (PRIORITY_REPORT, 225, True), (PRIORITY_REPORT, 800, True), (PRIORITY_REPORT, 801, False),
    ],
)  # fmt: skip
def test_a_packet_that_fits_no_turn_is_dropped_with_its_reason(
    node: Node, priority: int, size: int, *, fits: bool
) -> None:
    """A turn of 1,024 bytes keeps 800 of them free for a report; the packet is on its way to a head."""
    informed(node, told_ms=0)
    access_of(node)._roots.reserved = {PRIORITY_REPORT: 800}
    header = Header(5000, 9, BEFORE, BROADCAST, BEFORE, Kind.DATA, 9, 0, priority, FLAG_TO_HEAD)
    frame = header.encode() + filler(size - len(header.encode()))
    node.hear(Reception(frame, BEFORE, 6 * MS, -60.0), 6 * MS)
    assert node.dropped[DropReason.TOO_LARGE] == (not fits)
    assert node.report()["waiting"] == fits


@pytest.mark.parametrize("handover_ms", [0, 20])
def test_a_bound_runs_from_application_to_application(make_scenario: MakeScenario, handover_ms: int) -> None:
    """One turn of 100 ms, a flood of three turns, a lead before it; handover and another lead behind."""
    keys = {"nodes.count": 5, "clusters.relay": "scheduled", "clusters.flooding_period_s": 0.1, "radio.lead_ms": 2}
    keys |= {"clusters.contention_ms": 40, "traffic.interval_s": 1, "radio.handover_ms": handover_ms}
    node = Node(US, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    node.start(0)
    access_of(node)._timetables.in_order = [planned(FLOODS)]
    own = access_of(node)._delays.own()
    assert own is not None
    assert own.worst_ns(interval_ns=1000 * MS) == (2 + 100 + 3 * 2 + handover_ms + 2) * MS


def test_who_cannot_reach_everyone_promises_nothing(node: Node) -> None:
    access_of(node)._timetables.in_order = [planned(FLOODS, unreached=(AFTER,))]
    node.send(filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=0, now_ns=0)
    assert not [record for record in node.records if isinstance(record, BoundStated)]
    assert access_of(node)._delays.own() is None


def informed(node: Node, *, told_ms: int) -> TurnAccess:
    """The node follows a timetable, and heard an announcement of it that was made at an instant."""
    access = access_of(node)
    access._delays.announced_ns = told_ms * MS
    access._delays.follow(now_ns=told_ms * MS)
    access.use_turns(told_ms * MS)
    return access


def test_who_hears_nobody_in_turns_is_told_so_once_the_timetable_was_in_force_for_long(node: Node) -> None:
    access = access_of(node)
    access._timetables.in_order = [planned(FLOODS)._replace(valid_ns=20 * S)]
    assert [access._delays.hears_nobody(t_s * S) for t_s in (19, 21, 24, 25)] == [False, False, False, True]
    access._delays._followers.hear(UNANNOUNCED, ROOT, now_ns=24 * S)
    assert [access._delays.hears_nobody(t_s * S) for t_s in (25, 28, 30)] == [False, False, True]


def promised(node: Node, *, at_ms: int, size: int = 40) -> list[BoundStated]:
    node.send(
        filler(size), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=at_ms * MS, now_ns=at_ms * MS
    )
    return [record for record in node.records if isinstance(record, BoundStated)]


BOUND_NS = (2 + 100 + 3 * 2 + 2) * MS


@pytest.mark.parametrize(("told_ms", "is_promised"), [(10_000, True), (9_972, True), (9_971, False), (9_000, False)])
def test_a_promise_reaches_as_far_as_the_leader_gives_notice(node: Node, told_ms: int, is_promised: bool) -> None:
    """A packet of 11562 ms leaves at 11564 ms; three turns and a lead later, at 11572 ms, applications have it.

    No timetable that was announced after `told_ms` comes into force sooner than a superframe and 1.5 s later.
    """
    informed(node, told_ms=told_ms)
    expected = [BoundStated(11_562 * MS, US, 0, BOUND_NS)] if is_promised else []
    assert promised(node, at_ms=11_562) == expected


@pytest.mark.parametrize(("before", "is_promised"), [(0, True), (1, False)])
def test_a_promise_counts_what_waits(node: Node, before: int, is_promised: bool) -> None:
    """One packet more than a turn holds is through a superframe later than the bound."""
    informed(node, told_ms=0)
    for _ in range(before):
        node.send(filler(900), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=0, now_ns=0)
    node.records.clear()
    node.send(filler(900), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=0, now_ns=0)
    assert any(isinstance(record, BoundStated) for record in node.records) is is_promised


def test_a_packet_with_a_bound_goes_before_what_waits_without_one(node: Node) -> None:
    """Where turns carry just the load, what came before the timetable would make all that follows late for ever."""

    def send(at_ms: int) -> None:
        now_ns = at_ms * MS
        node.send(filler(900), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=now_ns, now_ns=now_ns)

    access = informed(node, told_ms=-10_000)
    for _ in range(3):
        send(0)
    access._delays.announced_ns = 0
    send(0)
    node.wake(62 * MS)
    send(100)
    for superframe in range(1, 5):
        node.wake((superframe * 100 + 62) * MS)
    assert [record.seq for record in node.records if isinstance(record, BoundStated)] == [3, 4]
    assert [wire.decode_header(r.frame).seq for r in node.requests] == [3, 4, 0, 1, 2]


def test_turns_are_used_until_a_timetable_without_any_comes_into_force(node: Node) -> None:
    """Our turn is at 64 ms of each superframe, and its flood lasts 6 ms: that at 964 ms is the last before 1 s."""
    access_of(node)._timetables.in_order = [planned(FLOODS), planned(FLOODS[:5], valid_ns=1000 * MS)]
    access = informed(node, told_ms=0)
    for births in ((0, 0, 0), (955, 955), (990,)):
        for at_ms in births:
            node.send(
                filler(900),
                destination=BROADCAST,
                priority=PRIORITY_BULK,
                app="test",
                born_ns=at_ms * MS,
                now_ns=at_ms * MS,
            )
        while (wake_ns := access._roots.next_wake_ns()) is not None:
            node.wake(wake_ns)
    assert [start_ms for start_ms in relays(node) if start_ms > 60] == [64, 164, 264, 964]
    assert len(access._roots) == 0, "what has no turn any more goes another way"
    assert node.report()["waiting"] == 2


def test_what_was_promised_keeps_its_turn_when_another_leader_s_timetable_holds_at_once(node: Node) -> None:
    """Two parts of a swarm meet: the timetable of the leader that prevails holds already, and has no turn for us."""
    access = informed(node, told_ms=10_000)
    assert promised(node, at_ms=11_520)
    access.follow(planned(FLOODS[:5], valid_ns=11_000 * MS), now_ns=11_530 * MS)
    node.send(
        filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=11_540 * MS, now_ns=11_540 * MS
    )
    while (wake_ns := access._roots.next_wake_ns()) is not None:
        node.wake(wake_ns)
    assert relays(node) == [11_564.0], "both fit into that turn"
    assert len(promised(node, at_ms=11_600)) == 1, "nothing more is promised"
    assert access._roots.next_wake_ns() is None, "the turns are those of the other timetable now"


def test_a_timetable_of_another_leader_takes_the_place_of_one_that_is_still_to_come(node: Node) -> None:
    access = informed(node, told_ms=0)
    access.follow(planned(FLOODS, valid_ns=2000 * MS), now_ns=100 * MS)
    access.follow(planned(FLOODS[:5], valid_ns=50 * MS), now_ns=200 * MS)
    assert [plan.valid_ns // MS for plan in access._timetables.in_order] == [0, 50]
    assert not access._roots.has_turn(now_ns=200 * MS)


def test_a_packet_whose_turns_are_gone_is_dropped_if_a_bound_was_stated_for_it(node: Node) -> None:
    """No timetable fits any more: what was promised would come late, the rest waits for a way to a head."""
    access = informed(node, told_ms=10_000)
    for _ in range(2):
        node.send(
            filler(900),
            destination=BROADCAST,
            priority=PRIORITY_BULK,
            app="test",
            born_ns=11_520 * MS,
            now_ns=11_520 * MS,
            watch=True,
        )
    assert [record.seq for record in node.records if isinstance(record, BoundStated)] == [0]
    access.follow(None, now_ns=11_530 * MS)
    assert node.dropped == {DropReason.BOUND_LOST: 1}
    assert node.watch.news == [(0, 11_530 * MS, DropReason.BOUND_LOST)], "its application is told"
    assert node.report()["waiting"] == 1


def test_a_packet_that_would_come_after_its_bound_is_dropped_in_its_turn(node: Node) -> None:
    """The node takes office after it stated the bound, and its announcement takes the place of bulk in its turn."""
    access = informed(node, told_ms=10_000)
    assert promised(node, at_ms=11_520, size=200)
    access._delays._lease.take_office(11_530 * MS)
    access.flood_control(Kind.SCHEDULE, filler(900), now_ns=11_530 * MS)
    node.send(
        filler(40), destination=BROADCAST, priority=PRIORITY_BULK, app="test", born_ns=11_540 * MS, now_ns=11_540 * MS
    )
    for _ in range(2):
        node.wake(access._roots.next_wake_ns() or 0)
    assert node.dropped == {DropReason.BOUND_LOST: 1}
    assert relays(node) == [11_664.0], "nothing was promised of the other one, so it goes late"


def test_a_leader_promises_nothing_for_bulk(node: Node) -> None:
    informed(node, told_ms=0)._delays._lease.take_office(0)
    assert promised(node, at_ms=0) == []


def test_what_is_repaired_after_it_was_lost_has_no_bound(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 5, "clusters.relay": "scheduled", "clusters.flooding_period_s": 0.1, "clusters.repair_s": 5}
    node = Node(US, make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    node.start(0)
    access_of(node)._timetables.in_order = [planned(FLOODS)]
    informed(node, told_ms=0)
    assert promised(node, at_ms=0) == []


def test_a_flood_of_whoever_follows_another_timetable_is_not_relayed(node: Node) -> None:
    """In this turn the node expects a packet of the root, and hears one of another node that has turns too."""
    end_ns = TURNS.start_ns(5, superframe_start_ns=1000 * MS) + MS
    for seq, origin in ((1, US), (2, ROOT)):
        header = Header(end_ns // 1000 - 5000, seq, origin, BROADCAST, ROOT, Kind.DATA, 9, 0, 3, FLAG_FLOOD)
        node.hear(Reception(header.encode() + filler(40), ROOT, end_ns, -60.0), end_ns)
    assert relays(node) == [1056.0], "only that of the root"


def test_a_flood_of_another_timetable_is_counted(node: Node) -> None:
    hear_in_turn(node, ROOT, 14)
    assert relays(node) == []
    assert node.dropped[DropReason.OUT_OF_TURN] == 1


@pytest.mark.parametrize(("due_ms", "earliest_ms", "latest_ms"), [(1010, 1010, 1010), (1050, 1100, 1135)])
def test_hellos_keep_out_of_the_turns(node: Node, due_ms: int, earliest_ms: int, latest_ms: int) -> None:
    node.say_hello(b"", start_ns=due_ms * MS, now_ns=due_ms * MS)
    (request,) = node.requests
    assert earliest_ms * MS <= request.start_ns <= latest_ms * MS


@pytest.mark.parametrize(("copy", "missed"), [(BEFORE, 1), (AFTER, 0)])
def test_over_lossy_links_a_copy_from_after_our_turn_misses_nothing(node: Node, copy: NodeId, missed: int) -> None:
    """The one of turn 6 came so late that ours, 8, is over; that of turn 10 is the first that has arrived."""
    turns = (Turn(5, ROOT, ROOT, 0), Turn(6, BEFORE, ROOT, 0), Turn(8, US, ROOT, 0), Turn(10, AFTER, ROOT, 0))
    access_of(node)._timetables.in_order = [planned(turns)._replace(odds=Odds({US: (0.0,)}))]
    hear_in_turn(node, copy, 6 if copy == BEFORE else 10, told_ns=30 * MS)
    assert relays(node) == []
    assert node.report()["missed_turns"] == missed


def test_a_join_does_not_take_the_place_of_an_announcement_that_waits(node: Node) -> None:
    """Over lossy links a leader says in its turns which neighbor has fallen silent, too."""
    access = access_of(node)
    access._timetables.in_order = [planned(FLOODS)._replace(odds=Odds({US: (0.0,)}), calls=(20,))]
    access.use_turns(1050 * MS)
    access.flood_control(Kind.SCHEDULE, filler(40), now_ns=1050 * MS)
    access.flood_control(Kind.JOIN, filler(40), now_ns=1051 * MS)
    assert access.waiting() == 2
    access.flood_control(Kind.SCHEDULE, filler(40), now_ns=1052 * MS)
    assert access.waiting() == 2, "a newer one does"


@pytest.mark.parametrize("nodes", [5, 4])
def test_a_likely_delay_is_stated_for_those_who_are_in_the_timetable(node: Node, nodes: int) -> None:
    """The swarm has five nodes; after a split a part of it makes a timetable of its own."""
    plan = planned(FLOODS)
    table = plan.table._replace(spans={NodeId(n): 3 for n in range(1, nodes + 1)})
    odds = Odds({US: (0.0,)})
    access_of(node)._timetables.in_order = [plan._replace(table=table, odds=odds, calls=(20,))]
    assert access_of(node).report()["likely_ms"] is not None
