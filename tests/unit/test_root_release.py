"""A root lets its packets out in its own turns, by hand: a window of 40 ms, turns of 2 ms, superframes of 100 ms."""

import pytest

from fanet_mw.protocol.root_release import Following, RootRelease
from fanet_mw.protocol.turns import Turns
from fanet_mw.protocol.txqueue import Packet, TxQueue
from fanet_mw.units import MS
from fanet_mw.wire import Header

LEAD_NS = 5 * MS
TURNS = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_frame=29)


def packet(seq: int, size: int = 100) -> Packet:
    return Packet(Header(0, seq, 9, 0xFFFF, 9, 0, 32, 0, 3, 0), bytes(size))


def root(*plans: Following) -> RootRelease:
    release = RootRelease(TxQueue(capacity=100), lead_ns=LEAD_NS)
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
    release = root((0, TURNS, (3, 10), 100))
    for seq in range(4):
        release.push(packet(seq), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], 46), ([1], 60), ([2], 146), ([3], 160)]


def test_as_many_go_together_as_a_turn_holds() -> None:
    release = root((0, TURNS, (3,), 250))
    for seq, size in enumerate((100, 100, 100, 200, 60)):
        release.push(packet(seq, size), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0, 1], 46), ([2], 146), ([3], 246), ([4], 346)]


@pytest.mark.parametrize(("now_ms", "start_ms"), [(41, 46), (41.5, 146)])
def test_a_turn_that_cannot_be_announced_in_time_is_not_taken(now_ms: float, start_ms: float) -> None:
    release = root((0, TURNS, (3,), 100))
    release.push(packet(0), now_ns=round(now_ms * MS))
    assert let_out(release, until_ms=1000) == [([0], start_ms)]


def test_a_plan_counts_from_the_instant_at_which_it_is_in_force() -> None:
    release = root((500 * MS, TURNS, (3,), 100))
    release.push(packet(0), now_ns=0)
    assert let_out(release, until_ms=1000) == [([0], 546)]


def test_a_plan_ends_where_the_next_one_begins() -> None:
    """At 60 ms the old plan's next turn would be at 146 ms; from 100 ms on there is another one."""
    release = root((0, TURNS, (3,), 100), (100 * MS, TURNS, (10,), 200))
    release.push(packet(0), now_ns=60 * MS)
    release.push(packet(1), now_ns=60 * MS)
    assert let_out(release, until_ms=1000) == [([0, 1], 160)]
