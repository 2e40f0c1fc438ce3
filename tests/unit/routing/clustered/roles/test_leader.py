"""The leader, by hand: superframes of 1 s, joins in, schedules out."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import pytest

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader import ANSWER_NS, OBJECTION_NS, SETTLE_NS, Leader
from fanet_mw.routing.clustered.roles.leader_election import Authority, silence_ns
from fanet_mw.routing.clustered.roles.position_updates import lost_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire.schedule import Join, Schedule

STILL = Enu(0.0, 0.0, 0.0)
HERE = Motion(Enu(0.0, 0.0, 50.0), STILL, 0)
MakeScenario = Callable[..., Scenario]


class Desk:
    """A leader and its signs of life."""

    def __init__(self, scenario: Scenario, *, epoch: int = 0, elected: bool = False) -> None:
        self.liveness = Liveness()
        self.leader = Leader(
            Authority(0, 1), scenario=scenario, liveness=self.liveness, epoch=epoch, elected=elected, now_ns=0,
            needs_every_link=scenario.clusters.relay == "scheduled", measured_period_ns=scenario.clusters.period_ns,
        )  # fmt: skip

    def join(self, node: int, east_m: float, *, born_ns: int, instead_of: int = 0) -> None:
        join = Join(node, Enu(east_m, 0.0, 50.0), STILL, instead_of)
        self.liveness.on_sign_of_life(node, born_ns=born_ns)
        self.leader.on_join(join, HERE._replace(at_ns=born_ns), born_ns=born_ns, now_ns=born_ns)

    def announce(self) -> tuple[int, Sequence[Schedule]]:
        """The next announcement, and when."""
        now_ns = self.leader.next_wake_ns()
        return now_ns, self.leader.wake(HERE, now_ns=now_ns)

    def announced_at(self, until_ns: int) -> set[int]:
        """The members of the newest schedule at an instant."""
        members: set[int] = set()
        while self.leader.next_wake_ns() <= until_ns:
            _, parts = self.announce()
            members = {member.node for part in parts for member in part.members}
        return members


@pytest.fixture
def scenario(make_scenario: MakeScenario) -> Scenario:
    return make_scenario(**{"nodes.count": 6, "clusters.count": 1, "clusters.flooding_period_s": 1})


def test_who_joined_before_a_formation_set_out_is_beside_the_leader_though_it_hears_of_that_later(
    make_scenario: MakeScenario,
) -> None:
    keys = {"nodes.count": 2, "clusters.count": 1, "clusters.relay": "scheduled", "mobility.model": "formation"}
    desk = Desk(make_scenario(**keys))
    flown = [
        Motion(Enu(0.0, 10.0 * max(0, now_s - 1), 50.0), Enu(0.0, 10.0 * (now_s > 0), 0.0), now_s * S)
        for now_s in range(8)
    ]
    for here in flown[:3]:
        desk.leader.fly(here)
    desk.leader.on_join(Join(2, Enu(100.0, 0.0, 50.0), STILL), flown[3], born_ns=100 * MS, now_ns=3 * S)
    desk.leader.wake(flown[7], now_ns=7 * S)
    assert desk.leader.place(2).minus(desk.leader.place(1)).norm() == pytest.approx(100, abs=3)


def test_the_first_leader_waits_five_seconds_for_joins_before_it_calls(scenario: Scenario) -> None:
    assert Desk(scenario).announce()[0] == 5 * S


def test_who_was_elected_calls_at_once_and_assigns_when_answers_are_in(make_scenario: MakeScenario) -> None:
    """In a period of 4 s it does not wait for its next announcement."""
    keys = {"nodes.count": 6, "clusters.count": 1, "clusters.flooding_period_s": 4}
    desk = Desk(make_scenario(**keys), elected=True)
    assert [(at_ns, call.members) for at_ns, (call,) in (desk.announce(), desk.announce())] == [
        (0, ()),
        (ANSWER_NS, ()),
    ], "nobody has answered"
    desk = Desk(make_scenario(**keys), elected=True)
    desk.announce()
    desk.join(2, 100, born_ns=500 * MS)
    now_ns, (schedule,) = desk.announce()
    assert now_ns == ANSWER_NS
    assert [member.node for member in schedule.members] == [2]


def test_clusters_are_made_when_no_join_has_come_for_a_moment(scenario: Scenario) -> None:
    desk = Desk(scenario)
    desk.join(2, 100, born_ns=1000 * MS)
    desk.join(3, 200, born_ns=1500 * MS)
    now_ns, (schedule,) = desk.announce()
    assert now_ns == 1500 * MS + SETTLE_NS
    assert {member.node for member in schedule.members} == {2, 3}
    assert schedule.start_us % 1_000_000 == 0
    assert schedule.start_us * 1000 > now_ns, "its superframes begin when all have heard of it"


@pytest.mark.parametrize("placed_before", [False, True])
def test_nodes_that_join_one_after_the_other_without_end_do_not_keep_the_leader_silent(
    make_scenario: MakeScenario, *, placed_before: bool
) -> None:
    scenario = make_scenario(**{"nodes.count": 60, "clusters.count": 1, "clusters.flooding_period_s": 1})
    desk, announced = Desk(scenario), [0]
    if placed_before:
        desk.join(2, 100, born_ns=1 * S)
        assert desk.announced_at(9 * S) == {2}
        announced = [9 * S]
    begin_ns = 10 * S if placed_before else 1 * S
    members: set[int] = set()
    for number in range(50):
        now_ns = begin_ns + number * 600 * MS
        while desk.leader.next_wake_ns() <= now_ns:
            at_ns, parts = desk.announce()
            announced.append(at_ns)
            members = {member.node for part in parts for member in part.members} or members
        desk.join(3 + number, 100 + number, born_ns=now_ns)
    gaps_ns = [later - earlier for earlier, later in pairwise(announced)]
    patience_ns = silence_ns(scenario.clusters.period_ns) if placed_before else 12 * S
    assert max(gaps_ns) < patience_ns
    assert len(members) >= 40, "they are placed while others still come"


def test_the_leader_itself_is_a_member_of_no_cluster(scenario: Scenario) -> None:
    desk = Desk(scenario)
    desk.join(1, 0, born_ns=1 * S)
    desk.join(2, 100, born_ns=1 * S)
    assert desk.announced_at(3 * S) == {2}
    epochs = {desk.announce()[1][0].epoch for _ in range(5)}
    assert epochs == {1}, "and its own join is no reason for another assignment"


def test_an_older_join_that_comes_later_says_nothing(scenario: Scenario) -> None:
    desk = Desk(scenario)
    desk.join(2, 100, born_ns=2 * S)
    desk.join(2, 900, born_ns=1 * S)
    desk.announced_at(4 * S)
    assert desk.leader.place(NodeId(2)).east == 100


def test_a_node_without_a_sign_for_long_is_forgotten(scenario: Scenario) -> None:
    desk = Desk(scenario)
    desk.join(2, 100, born_ns=1 * S)
    desk.join(3, 200, born_ns=1 * S)
    desk.liveness.on_sign_of_life(3, born_ns=40 * S)
    assert desk.announced_at(1 * S + lost_ns(scenario)) == {2, 3}
    assert desk.announced_at(4 * S + lost_ns(scenario)) == {3}


@pytest.mark.parametrize("objects", [True, False])
def test_a_head_that_somebody_stands_in_for_is_gone_unless_it_shows_that_it_lives(
    scenario: Scenario, objects: bool
) -> None:
    desk = Desk(scenario)
    for node in (2, 3, 4):
        desk.join(node, 100.0 * node, born_ns=1 * S)
    assert desk.announced_at(5 * S) == {2, 3, 4}
    desk.join(4, 400, born_ns=6 * S, instead_of=3)
    if objects:
        desk.liveness.on_sign_of_life(3, born_ns=6 * S + 1)
    assert desk.announced_at(6 * S + OBJECTION_NS + 2 * S) == ({2, 3, 4} if objects else {2, 4})


def test_epochs_wrap_and_are_never_0(scenario: Scenario) -> None:
    desk = Desk(scenario, epoch=0xFFFF)
    desk.join(2, 100, born_ns=1 * S)
    _, (schedule,) = desk.announce()
    assert schedule.epoch == 1
    schedule.encode_frame(1)
