"""A node that learns from a hello that a neighbor follows an older schedule sends it the newest one again."""

import pytest

from fanet_mw.node.duplicates import key_of
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.schedule_check import ScheduleRefresh
from fanet_mw.units import MS, S
from fanet_mw.wire import Header, Kind
from fanet_mw.wire.hello.beacon import Beacon, Role

OURS, EPOCH = Authority(5, 1), 7
PACKET = Packet(Header(0, 3, 1, 0xFFFF, 1, Kind.SCHEDULE, 32, 0, 0, 1), b"schedule")


@pytest.fixture
def refresh() -> ScheduleRefresh:
    made = ScheduleRefresh(lambda: 0.5)
    made.keep(PACKET, 0, OURS, EPOCH, now_ns=10 * S)
    return made


def follows(term: int, leader: int, epoch: int) -> Beacon:
    return Beacon(node=9, head=0, head_seq=0, cluster=0, epoch=epoch, role=Role.MEMBER, hops_to_head=255, slot=0,
                  term=term, leader=leader)  # fmt: skip


@pytest.mark.parametrize(
    ("beacon", "lacks"),
    [
        (follows(5, 1, 7), False),
        (follows(5, 1, 6), True),
        (follows(5, 1, 8), False),  # it knows more than we do
        (follows(0, 0, 0), True),  # it follows nobody
        (follows(6, 1, 9), True),  # a junior leader
        (follows(4, 1, 1), False),  # a senior one: it will tell us
    ],
)
def test_who_follows_less_than_we_do_gets_the_newest(refresh: ScheduleRefresh, beacon: Beacon, lacks: bool) -> None:
    refresh.on_beacon(beacon, now_ns=11 * S)
    assert (refresh.due_ns == 11 * S + 100 * MS) == lacks
    assert refresh.due(now_ns=12 * S) == ([PACKET] if lacks else [])


def test_a_flood_is_given_time_to_arrive_by_itself(refresh: ScheduleRefresh) -> None:
    refresh.on_beacon(follows(5, 1, 6), now_ns=10 * S + 499 * MS)
    assert refresh.due_ns is None


def test_what_another_has_sent_meanwhile_is_not_sent_again(refresh: ScheduleRefresh) -> None:
    refresh.on_beacon(follows(5, 1, 6), now_ns=11 * S)
    refresh.on_copy(key_of(1, 3), now_ns=11 * S + 50 * MS)
    assert refresh.due(now_ns=12 * S) == []
    refresh.on_beacon(follows(5, 1, 6), now_ns=11 * S + 900 * MS)
    assert refresh.due_ns is None, "it has just been sent"
    refresh.on_beacon(follows(5, 1, 6), now_ns=12 * S)
    assert refresh.due_ns is not None


def test_a_part_that_came_after_the_plan_is_given_up_with_the_others(refresh: ScheduleRefresh) -> None:
    refresh.on_beacon(follows(5, 1, 6), now_ns=11 * S)
    second = Packet(PACKET.header._replace(seq=4), b"second part")
    refresh.keep(second, 1, OURS, EPOCH, now_ns=11 * S + 20 * MS)
    refresh.on_copy(key_of(1, 4), now_ns=11 * S + 50 * MS)
    assert refresh.due(now_ns=12 * S) == []
