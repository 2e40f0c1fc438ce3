"""Which leader a node follows, and when it stands for election: superframes of 1 s, a leader is given up after 4 s."""

import pytest

from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader_election import Authority, Lease
from fanet_mw.units import NodeId, S

LEADER = Authority(5, 9)


@pytest.fixture
def liveness() -> Liveness:
    return Liveness()


@pytest.fixture
def lease(liveness: Liveness) -> Lease:
    made = Lease(NodeId(5), period_ns=S, liveness=liveness)
    made.start(0)
    return made


def test_old_news_of_a_leader_who_may_be_dead_does_not_count(lease: Lease) -> None:
    assert not lease.accept(LEADER, born_ns=10 * S, now_ns=14 * S + 1)
    assert lease.authority is None
    assert lease.accept(LEADER, born_ns=10 * S, now_ns=14 * S)


@pytest.mark.parametrize(("other", "prevails"), [((4, 20), True), ((5, 8), True), ((5, 10), False), ((6, 1), False)])
def test_the_leader_longest_in_office_prevails_then_the_lower_id(
    lease: Lease, other: tuple[int, int], prevails: bool
) -> None:
    lease.accept(LEADER, born_ns=10 * S, now_ns=10 * S)
    assert lease.accept(Authority(*other), born_ns=11 * S, now_ns=11 * S) == prevails
    assert lease.authority == (Authority(*other) if prevails else LEADER)


def test_a_junior_one_is_obeyed_when_the_senior_has_fallen_silent(lease: Lease) -> None:
    lease.accept(LEADER, born_ns=10 * S, now_ns=10 * S)
    assert lease.accept(Authority(6, 1), born_ns=15 * S, now_ns=15 * S)


def test_an_older_announcement_that_comes_later_shortens_nothing(lease: Lease) -> None:
    lease.accept(LEADER, born_ns=10 * S, now_ns=10 * S)
    lease.accept(LEADER, born_ns=8 * S, now_ns=11 * S)
    assert lease.valid(14 * S)
    assert not lease.valid(14 * S + 1)


@pytest.mark.parametrize(("alive", "waits_s"), [((), 0), ((7, 8), 0), ((2,), 1), ((2, 3), 2), ((1, 2, 3, 4), 3)])
def test_the_lowest_id_that_lives_stands_at_once_and_others_in_their_turn(
    lease: Lease, liveness: Liveness, alive: tuple[int, ...], waits_s: int
) -> None:
    lease.accept(LEADER, born_ns=10 * S, now_ns=10 * S)
    for node in alive:
        liveness.on_sign_of_life(node, born_ns=13 * S)
    assert not lease.review(14 * S - 1)
    stands = [second for second in range(5) if lease.review((14 + second) * S)]
    assert stands[0] == waits_s
