"""A root lets its packets out in its own turns, by hand: a window of 40 ms, turns of 2 ms, superframes of 100 ms."""

import pytest

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.turn_release import RootRelease, TurnsInForce
from fanet_mw.scenario import Routing
from fanet_mw.units import MS, NodeId
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, PRIORITY_REPORT, PRIORITY_SAFETY, Header, Kind

ME = NodeId(9)
LEAD_NS = 5 * MS
TURNS = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)


def packet(seq: int, size: int = 100, *, priority: int = PRIORITY_BULK, kind: Kind = Kind.DATA) -> Packet:
    return Packet(Header(seq, seq, ME, 0xFFFF, ME, kind, 32, 0, priority, 0), bytes(size))


def root(*plans: TurnsInForce, reserved: dict[int, int] | None = None) -> RootRelease:
    release = RootRelease(ME, TxQueue(Routing()), reserved=reserved or {}, lead_ns=LEAD_NS)
    release.follow(plans, now_ns=0)
    return release


def let_out(release: RootRelease, *, until_ms: int) -> list[tuple[list[int], float]]:
    """(numbers of those that share a frame, its instant [ms]), woken just when it asks to be."""
    found = []
    while (wake_ns := release.next_wake_ns()) is not None and wake_ns <= until_ms * MS:
        for packets, start_ns in release.due(now_ns=max(0, wake_ns)):
            assert start_ns - LEAD_NS == wake_ns, "announced one lead ahead"
            found.append(([packet.header.seq for packet in packets], start_ns / MS))
    return found


def test_each_turn_is_used_once() -> None:
    release = root(TurnsInForce(0, TURNS, (3, 10), 100, 2))
    for seq in range(4):
        release.push(packet(seq), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], 46), ([1], 60), ([2], 146), ([3], 160)]


def test_as_many_go_together_as_a_turn_holds() -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 250, 2))
    for seq, size in enumerate((100, 100, 100, 200, 60)):
        release.push(packet(seq, size), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0, 1], 46), ([2], 146), ([3], 246), ([4], 346)]


@pytest.mark.parametrize(("now_ms", "start_ms"), [(41, 46), (41.5, 146)])
def test_a_turn_that_cannot_be_announced_in_time_is_not_taken(now_ms: float, start_ms: float) -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 100, 2))
    release.push(packet(0), now_ns=round(now_ms * MS))
    assert let_out(release, until_ms=1000) == [([0], start_ms)]


def test_a_plan_counts_from_the_instant_at_which_it_is_in_force() -> None:
    release = root(TurnsInForce(500 * MS, TURNS, (3,), 100, 2))
    release.push(packet(0), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], 546)]


def test_a_plan_ends_where_the_next_one_begins() -> None:
    """At 60 ms the old plan's next turn would be at 146 ms; from 100 ms on there is another one."""
    release = root(TurnsInForce(0, TURNS, (3,), 100, 2), TurnsInForce(100 * MS, TURNS, (10,), 200, 2))
    release.push(packet(0), now_ns=60 * MS)
    release.push(packet(1), now_ns=60 * MS)
    assert let_out(release, until_ms=1000) == [([0, 1], 160)]


def test_what_waits_for_a_turn_goes_by_a_plan_that_it_learns_of_meanwhile() -> None:
    for before in (), (TurnsInForce(0, TURNS, (3,), 100, 2),):
        release = root(*before)
        release.push(packet(0), now_ns=60 * MS)
        release.follow([*before, TurnsInForce(100 * MS, TURNS, (10,), 200, 2)], now_ns=70 * MS)
        assert let_out(release, until_ms=1000) == [([0], 160)]


@pytest.mark.parametrize(("change_ms", "start_ms"), [(50, 46), (49, 60)])
def test_a_turn_whose_flood_would_outlive_its_timetable_is_not_used(change_ms: int, start_ms: float) -> None:
    """The flood of turn 3 lasts two turns, from 46 to 50 ms."""
    release = root(TurnsInForce(0, TURNS, (3,), 100, 2), TurnsInForce(change_ms * MS, TURNS, (10,), 100, 2))
    release.push(packet(0), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], start_ms)]


ROOMS = {PRIORITY_SAFETY: 40, PRIORITY_REPORT: 50}


def test_reports_and_warnings_ride_beside_bulk_and_never_in_its_place() -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    for seq, (size, priority) in enumerate(
        [(100, PRIORITY_BULK), (100, PRIORITY_BULK)] + [(50, PRIORITY_REPORT)] * 3 + [(40, PRIORITY_SAFETY)]
    ):
        release.push(packet(seq, size, priority=priority), now_ns=0)
    assert let_out(release, until_ms=1000) == [([5, 2, 0], 46), ([3, 1], 146), ([4], 246)]


def test_a_frame_is_no_longer_than_its_turn_whatever_rides_in_it() -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    for seq, (size, priority) in enumerate([(40, PRIORITY_SAFETY), (50, PRIORITY_REPORT)] + [(60, PRIORITY_BULK)] * 3):
        release.push(packet(seq, size, priority=priority), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0, 1, 2], 46), ([3, 4], 146)]


def test_the_room_that_bulk_leaves_is_for_the_most_urgent() -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    for seq, priority in enumerate([PRIORITY_REPORT, PRIORITY_REPORT, PRIORITY_REPORT, PRIORITY_SAFETY]):
        release.push(packet(seq, 40, priority=priority), now_ns=0)
    assert let_out(release, until_ms=1000) == [([3, 0, 1, 2], 46)]


@pytest.mark.parametrize(("size", "priority"), [(51, PRIORITY_REPORT), (60, PRIORITY_CONTROL)])
def test_what_has_no_room_of_its_own_overtakes_no_bulk(size: int, priority: int) -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    release.push(packet(0, 150), now_ns=0)
    release.push(packet(1, size, priority=priority), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], 46), ([1], 146)]


def test_announcements_go_before_bulk_and_a_newer_one_in_place_of_an_older() -> None:
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    release.push(packet(0), now_ns=0)
    release.push(packet(1, 90, priority=PRIORITY_CONTROL, kind=Kind.SCHEDULE), now_ns=0)
    assert [old.header.seq for old in release.outdated(before_us=2)] == [1]
    release.push(packet(2, 90, priority=PRIORITY_CONTROL, kind=Kind.SCHEDULE), now_ns=0)
    assert release.outdated(before_us=2) == []
    release.push(packet(3, 50, priority=PRIORITY_REPORT), now_ns=0)
    assert let_out(release, until_ms=1000) == [([2, 3], 46), ([0], 146)]


def test_when_bulk_will_be_through_counts_on_the_room_that_it_has_beside_the_others() -> None:
    """Both would fit a turn now; a warning and a report that are yet to come may take their rooms."""
    release = root(TurnsInForce(0, TURNS, (3,), 190, 2), reserved=ROOMS)
    through_ms = []
    for seq in range(2):
        one = packet(seq, 60)
        release.push(one, now_ns=0)
        through_ms.append((release.through_ns(one, now_ns=0) or 0) / MS)
    assert through_ms == [50, 150]
    assert let_out(release, until_ms=1000) == [([0, 1], 46)]
