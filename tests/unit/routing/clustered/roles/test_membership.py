"""What one node learns from schedules about its own place, part by part and epoch by epoch."""

from fanet_mw.node.neighbors import Neighbors
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.roles.failover import Failover
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader_election import Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.states import Action, Event
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.schedule import Join, Member, Schedule

US = NodeId(2)


def schedule(*nodes: int, epoch: int = 1, part: int = 0, parts: int = 1) -> Schedule:
    """One cluster, the first node its head."""
    members = tuple(Member(node, 0, rank == 0) for rank, node in enumerate(nodes))
    return Schedule(0, 1_000_000, 500_000, epoch, 1, 1, part, parts, members, 0)


def test_an_older_epoch_that_comes_later_changes_nothing() -> None:
    member = Membership(US)
    assert member.learn(schedule(3, 2, epoch=2), guard_ns=0) is Event.NAMED_MEMBER
    assert member.learn(schedule(2, 3, epoch=1), guard_ns=0) is None
    assert member.epoch == 2
    assert member.learn(schedule(2, 3, epoch=3), guard_ns=0) is Event.NAMED_HEAD


def test_epochs_wrap() -> None:
    member = Membership(US)
    member.learn(schedule(3, 2, epoch=0xFFFF), guard_ns=0)
    assert member.learn(schedule(2, 3, epoch=1), guard_ns=0) is Event.NAMED_HEAD


def test_who_is_in_no_part_is_left_out_when_all_parts_have_come() -> None:
    member = Membership(US)
    assert member.learn(schedule(3, 4, part=0, parts=2), guard_ns=0) is None, "we may be in the other one"
    assert member.learn(schedule(5, 6, part=1, parts=2), guard_ns=0) is Event.LEFT_OUT


def test_a_part_that_is_repeated_says_nothing_new() -> None:
    member = Membership(US)
    assert member.learn(schedule(3, 2), guard_ns=0) is Event.NAMED_MEMBER
    assert member.learn(schedule(3, 2), guard_ns=0) is None
    assert member.learn(schedule(3, 4, epoch=2), guard_ns=0) is Event.LEFT_OUT
    assert member.learn(schedule(3, 4, epoch=2), guard_ns=0) is None


def test_the_head_comes_first_in_the_succession_wherever_it_is_listed() -> None:
    member = Membership(US)
    members = (Member(2, 0, is_head=False), Member(4, 0, is_head=True), Member(3, 0, is_head=False))
    member.learn(schedule()._replace(members=members), guard_ns=0)
    assert member.succession == (4, 2, 3)
    assert member.rank(3) == 2


def test_a_replaced_head_that_shows_between_two_parts_of_a_new_schedule_is_followed_as_the_old_one_named_it() -> None:
    """Above 56 nodes a schedule has several parts, and anything may happen before the last of them has come."""
    node, liveness = NodeId(4), Liveness()
    member, lease = Membership(node), Lease(node, period_ns=S, liveness=liveness)
    gradient = Gradient(node=node, neighbors=Neighbors(lifetime_ns=4 * S), hello_ns=S)
    failover = Failover(
        membership=member, gradient=gradient, liveness=liveness, lease=lease, node=node, hello_ns=S, takes_slot=True
    )
    failover.start(0, leads=False)
    assert failover.on_schedule(schedule(2, 3, 4), guard_ns=0, born_ns=S, now_ns=S)
    assert failover.on_stand_in(Join(3, Enu(0, 0, 0), instead_of=2), born_ns=2 * S, now_ns=2 * S) == [Action.FOLLOW]
    assert member.head == 3
    failover.on_schedule(schedule(7, 8, epoch=2, parts=2), guard_ns=0, born_ns=3 * S, now_ns=3 * S)
    assert failover.on_sign_of_life(2, born_ns=3 * S, now_ns=3 * S) == [Action.FOLLOW]
    assert member.head == 2
    failover.on_schedule(schedule(3, 4, epoch=2, part=1, parts=2), guard_ns=0, born_ns=4 * S, now_ns=4 * S)
    assert member.head == 7
