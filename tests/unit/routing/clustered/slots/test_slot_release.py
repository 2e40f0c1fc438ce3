"""A head's queue: no packet leaves it outside the head's slot, and every dropped packet has a reason."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.errors import DropReason
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.slots import SlotRelease, Tenure
from fanet_mw.routing.clustered.tdma.slot_timing import Superframe
from fanet_mw.scenario import Clusters, Routing
from fanet_mw.units import MS, US, S
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, PRIORITY_REPORT, PRIORITY_SAFETY, Header

LEAD_NS = 20 * MS


def member_of(cluster: int, *, period_us: int = 1_000_000, clusters: int = 4) -> Tenure:
    return Tenure(Superframe(0, period_us * US, period_us // clusters * US, 2 * MS), cluster)


def packet(seq: int, priority: int = 3, born_us: int = 0) -> Packet:
    return Packet(Header(born_us, seq, 9, 0xFFFF, 9, 0, 32, 0, priority, 0), b"frame")


@given(
    arrivals_ms=st.lists(st.integers(0, 3000), max_size=30).map(sorted),
    cluster=st.integers(0, 3),
    pacing=st.sampled_from(["burst", "spread"]),
)
def test_every_packet_leaves_once_in_its_own_slot_at_least_a_gap_apart(
    arrivals_ms: list[int], cluster: int, pacing: str
) -> None:
    clusters = Clusters(pacing=pacing, flooding_period_s=1)
    release, membership = SlotRelease(TxQueue(Routing()), clusters, lead_ns=LEAD_NS), member_of(cluster)
    out: list[tuple[Packet, int]] = []

    def run(until_ns: int) -> None:
        while (wake_ns := release.next_wake_ns()) is not None and wake_ns <= until_ns:
            out.extend(release.due(membership, now_ns=max(wake_ns, 0)))

    for seq, at_ms in enumerate(arrivals_ms):
        run(at_ms * MS)
        release.push(packet(seq), membership, now_ns=at_ms * MS)
    run(60 * S)
    assert sorted(p.header.seq for p, _ in out) == list(range(len(arrivals_ms)))
    starts = [start for _, start in out]
    for p, start in out:
        assert start >= arrivals_ms[p.header.seq] * MS + LEAD_NS
        assert cluster * 250 * MS <= start % S < (cluster + 1) * 250 * MS - 2 * MS
    assert all(b - a >= 2 * MS for a, b in pairwise(starts))


@pytest.mark.parametrize(
    ("pacing", "count", "gap_us"), [("spread", 10, 24_800), ("spread", 2, 40_000), ("burst", 10, 2000)]
)
def test_a_slot_is_divided_among_what_is_queued_or_used_at_once(pacing: str, count: int, gap_us: int) -> None:
    """A slot of 248 ms; floods farther apart than 40 ms do not meet anyway."""
    release = SlotRelease(TxQueue(Routing()), Clusters(pacing=pacing, flooding_period_s=1), lead_ns=LEAD_NS)
    tenure = member_of(1)
    for seq in range(count):
        release.push(packet(seq), tenure, now_ns=0)
    out: list[tuple[Packet, int]] = []
    while (wake_ns := release.next_wake_ns()) is not None:
        out += release.due(tenure, now_ns=wake_ns)
    starts = [start_ns for _, start_ns in out]
    assert starts[0] == 250 * MS
    assert {b - a for a, b in pairwise(starts)} == {gap_us * US}


class Drops(list[tuple[DropReason, int]]):
    """Why a queue drops, and the number of what it drops."""

    def __call__(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None:
        self.append((reason, packet.header.seq))


def test_the_most_urgent_goes_first_and_the_least_important_is_evicted() -> None:
    drops = Drops()
    queue = TxQueue(Routing(queue_frames=3), drops)
    for seq, priority in enumerate((3, 2, 0)):
        queue.push(packet(seq, priority=priority), now_ns=0)
    assert drops == []
    queue.push(packet(3, priority=2), now_ns=0)
    assert drops == [(DropReason.QUEUE_FULL, 0)]
    queue.push(packet(4, priority=3), now_ns=0)
    assert drops[1:] == [(DropReason.QUEUE_FULL, 4)], "it was the least important itself"
    assert [queue.pop().header.seq for _ in range(3)] == [2, 1, 3]


def test_expired_packets_are_taken_out_and_named() -> None:
    drops = Drops()
    queue = TxQueue(Routing(lifetime_s=10), drops)
    for seq in range(4):
        queue.push(packet(seq, born_us=seq * 1000), now_ns=0)
    queue.expire(now_ns=10 * S + 2 * MS)
    assert drops == [(DropReason.EXPIRED, 0), (DropReason.EXPIRED, 1)]
    assert len(queue) == 2


def test_each_class_expires_by_its_own_lifetime() -> None:
    routing = Routing(lifetime_s=10, safety_lifetime_s=1, report_lifetime_s=4)
    drops = Drops()
    queue = TxQueue(routing, drops)
    for priority in (PRIORITY_CONTROL, PRIORITY_SAFETY, PRIORITY_REPORT, PRIORITY_BULK):
        queue.push(packet(priority, priority=priority, born_us=0), now_ns=0)

    def expired_at(now_us: int) -> list[int]:
        drops.clear()
        queue.expire(now_ns=now_us * US)
        return [seq for _, seq in drops]

    assert expired_at(1_000_000) == []
    assert expired_at(1_000_001) == [PRIORITY_SAFETY]
    assert expired_at(4_000_001) == [PRIORITY_REPORT]
    assert expired_at(10_000_001) == [PRIORITY_CONTROL, PRIORITY_BULK]


def test_a_class_without_a_lifetime_of_its_own_lives_as_long_as_the_others() -> None:
    routing = Routing(lifetime_s=10)
    assert [routing.lifetime_ns(p) // S for p in range(4)] == [10, 1, 10, 10]


def test_what_fits_beside_the_first_is_taken_in_order_and_nothing_overtakes() -> None:
    queue = TxQueue(Routing())
    for seq, size in enumerate((10, 20, 40, 5)):
        queue.push(packet(seq)._replace(frame=bytes(size)), now_ns=0)
    assert [p.header.seq for p in queue.pop_fitting(35)] == [0, 1]
    assert [p.header.seq for p in queue.pop_fitting(35)] == []
    assert [p.header.seq for p in queue.pop_fitting(45)] == [2, 3]
