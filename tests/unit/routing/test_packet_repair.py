"""Repair at one node, as timelines: a packet that a neighbor lacks is sent once more, only once, and not too early."""

from fanet_mw import wire
from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet
from fanet_mw.routing.packet_repair import Repair
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire import Header, Kind
from fanet_mw.wire.hello.digest import Digest, Holding

NOTHING = Digest((), complete=True)
LATER = 2 * S


def packet(seq: int, *, origin: int = 7, born_ns: int = 0) -> Packet:
    header = Header(
        origin_us=born_ns // 1000, seq=seq, origin=NodeId(origin), destination=BROADCAST, prev_hop=NodeId(origin),
        kind=Kind.DATA, hop_limit=8, hops=0, priority=wire.PRIORITY_BULK, flags=wire.FLAG_FLOOD,
    )  # fmt: skip
    return Packet(header, header.encode())


def repair(*, capacity: int = 100, window_ns: int = 20 * S) -> Repair:
    return Repair(window_ns=window_ns, capacity=capacity, random=lambda: 0.5)


def holder(*seqs: int, capacity: int = 100) -> Repair:
    made = repair(capacity=capacity)
    for seq in seqs:
        made.hold(packet(seq), flooded=True, expect_ns=0, now_ns=0)
    return made


def sent(made: Repair, now_ns: int) -> list[int]:
    return [packet.header.seq for _, packet in made.due(now_ns=now_ns)]


def test_what_a_neighbor_lacks_is_sent_after_the_assessment() -> None:
    made = holder(1, 2, 3)
    made.on_digest(Digest((Holding(7, 3, 0b10),), complete=True), now_ns=LATER)
    assert made.next_wake_ns() == LATER + 100 * MS
    assert sent(made, LATER + 99 * MS) == []
    assert sent(made, LATER + 100 * MS) == [2]
    assert made.next_wake_ns() is None
    assert made.repaired == 1


def test_a_repair_that_is_called_late_says_when_it_was_due() -> None:
    made = holder(1)
    made.on_digest(NOTHING, now_ns=LATER)
    assert [due_ns for due_ns, _ in made.due(now_ns=LATER + 130 * MS)] == [LATER + 100 * MS]


def test_a_flood_that_may_still_be_under_way_is_not_repaired() -> None:
    made = holder(1)
    made.on_digest(NOTHING, now_ns=400 * MS)
    assert made.next_wake_ns() is None
    made.on_digest(NOTHING, now_ns=500 * MS)
    assert made.next_wake_ns() is not None


def test_a_packet_that_is_to_be_flooded_yet_waits_for_that() -> None:
    made = repair()
    made.hold(packet(1), flooded=False, expect_ns=6 * S, now_ns=0)
    made.on_digest(NOTHING, now_ns=5 * S)
    assert made.next_wake_ns() is None
    made.hold(packet(1), flooded=True, expect_ns=0, now_ns=5 * S)
    made.on_digest(NOTHING, now_ns=5 * S + 600 * MS)
    assert made.next_wake_ns() is not None


def test_a_copy_overheard_in_time_makes_it_unnecessary() -> None:
    made = holder(1)
    made.on_digest(NOTHING, now_ns=LATER)
    made.on_copy(key_of(origin=7, seq=1), now_ns=LATER + 50 * MS)
    assert sent(made, LATER + 1 * S) == []


def test_the_same_packet_is_not_sent_again_before_the_neighbor_could_say_that_it_came() -> None:
    made = holder(1)
    made.on_digest(NOTHING, now_ns=LATER)
    assert sent(made, LATER + 100 * MS) == [1]
    made.on_digest(NOTHING, now_ns=LATER + 500 * MS)
    assert made.next_wake_ns() is None
    made.on_digest(NOTHING, now_ns=LATER + 1100 * MS)
    assert made.next_wake_ns() is not None


def test_one_hello_sets_off_a_bounded_number_of_repairs() -> None:
    made = repair()
    for origin in range(1, 60):
        made.hold(packet(1, origin=origin), flooded=True, expect_ns=0, now_ns=0)
    made.on_digest(NOTHING, now_ns=LATER)
    assert len(sent(made, LATER + 1 * S)) == 32


def test_an_incomplete_digest_says_nothing_of_origins_it_does_not_name() -> None:
    made = holder(1)
    made.on_digest(Digest((), complete=False), now_ns=LATER)
    assert made.next_wake_ns() is None


def test_old_packets_and_the_oldest_beyond_the_capacity_are_forgotten() -> None:
    made = holder(1, 2, 3, capacity=2)
    made.on_digest(NOTHING, now_ns=LATER)
    assert sorted(sent(made, LATER + 1 * S)) == [2, 3]
    assert made.digest(now_ns=21 * S).holdings == ()


def test_a_large_swarm_is_told_in_turns() -> None:
    made = repair(capacity=1000)
    for origin in range(1, 201):
        made.hold(packet(1, origin=origin), flooded=True, expect_ns=0, now_ns=0)
    digests = [made.digest(now_ns=0) for _ in range(3)]
    assert not any(digest.complete for digest in digests)
    assert {h.origin for digest in digests for h in digest.holdings} == set(range(1, 201))
