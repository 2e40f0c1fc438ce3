"""A queue that is let out in a node's own turns, under a host whose wake-ups are late."""

import pytest

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.claimed.claimed_release import ClaimedRelease
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns, Share
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import MS
from fanet_mw.wire import Header

LEAD_NS = 5 * MS
FIRST_NS, SECOND_NS = 46 * MS, 62 * MS
"""Turns 3 and 11 of a period: the window, then 2 ms each."""
PACKET = Packet(Header(0, 7, 3, 0xFFFF, 3, 0, 32, 0, 3, 0), b"")


@pytest.fixture
def release() -> ClaimedRelease:
    own = OwnTurns(Turns(origin_ns=0, period_ns=500 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=16))
    own.share = Share(slot=3, length=8)
    made = ClaimedRelease(TxQueue(capacity=4), own, lead_ns=LEAD_NS, frame_bytes=0)
    made.push(PACKET, now_ns=0)
    assert made.next_wake_ns() == FIRST_NS - LEAD_NS
    return made


@pytest.mark.parametrize("late_ns", [0, 1, 2 * MS, LEAD_NS])
def test_who_is_woken_late_still_uses_a_turn_that_is_ahead(release: ClaimedRelease, late_ns: int) -> None:
    assert release.due(now_ns=FIRST_NS - LEAD_NS + late_ns) == [([PACKET], FIRST_NS)]


def test_a_turn_that_has_begun_is_left_for_the_next_one(release: ClaimedRelease) -> None:
    assert release.due(now_ns=FIRST_NS + 1) == []
    assert release.next_wake_ns() == SECOND_NS - LEAD_NS


def test_a_turn_that_is_no_longer_ours_is_not_used(release: ClaimedRelease) -> None:
    release._own.share = Share(slot=4, length=8)
    assert release.due(now_ns=FIRST_NS - LEAD_NS + 1) == []
    assert release.next_wake_ns() == FIRST_NS + 2 * MS - LEAD_NS


def test_an_earlier_turn_that_has_become_ours_is_taken(release: ClaimedRelease) -> None:
    release._own.share = Share(slot=1, length=2)
    assert release.due(now_ns=FIRST_NS - 4 * MS - LEAD_NS) == [([PACKET], FIRST_NS - 4 * MS)]
