"""The formation in lines, and the plan that gives each UAV a place in it."""

import itertools
import math
from collections.abc import Collection, Sequence
from random import Random

import pytest

from agents.mission.flight.take_off import turns_ns
from agents.mission.search_formation.formation_planner import (
    NOTICE_IN_ROUNDS_NS,
    NOTICE_NS,
    FormationPlanner,
    pattern_of,
    plan_of,
)
from agents.mission.search_formation.pattern import Pattern, fitted, of_few
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.search_plan import Search, SearchStatus

REACH_M = 250.0
DEMANDS = Demands(area_m=2500, seen_m=137, reach_m=REACH_M, height_m=50, speed_m_s=7.5)


def formation(count: int = 45) -> Pattern:
    made = fitted(count, DEMANDS)
    assert made is not None
    return made


def is_one(places: Sequence[Enu]) -> bool:
    reached, waiting = {0}, [0]
    while waiting:
        here = places[waiting.pop()]
        further = [i for i, place in enumerate(places) if i not in reached and place.minus(here).norm() <= REACH_M]
        reached.update(further)
        waiting += further
    return len(reached) == len(places)


def test_the_formation_is_in_one_piece_during_the_whole_sweep_and_nobody_meets() -> None:
    pattern = formation()
    assert pattern.places == 45
    for second in range(0, 2 * round(pattern.shape.sweep_s) + 20, 2):
        places = [pattern.at(place, second) for place in range(pattern.places)]
        assert is_one(places), second
        assert min(a.minus(b).norm() for a, b in itertools.combinations(places, 2)) > 8.0


def test_tied_places_stay_in_reach_of_each_other_once_the_chain_is_straight() -> None:
    pattern = formation()
    for second in range(45, round(pattern.shape.sweep_s) + 120, 5):
        for place in range(pattern.places):
            for other in pattern.tethers(place, second):
                apart = pattern.at(place, second).minus(pattern.at(other, second)).norm()
                assert apart <= 0.95 * REACH_M, (second, place, other)


def test_every_spot_of_the_area_comes_within_range_of_a_lane() -> None:
    pattern = formation()
    tracks = [
        pattern.at(place, 0.5 * step)
        for place in range(2 * pattern.dimensions.lanes)
        for step in range(0, 2 * round(pattern.shape.sweep_s) + 1, 8)
    ]
    for east, north in itertools.product(range(-1240, 1250, 155), repeat=2):
        assert any(math.hypot(track.east - east, track.north - north) <= 137 for track in tracks), (east, north)


def test_too_few_have_no_formation() -> None:
    assert fitted(13, DEMANDS) is None


def planner_of(
    node: int,
    *,
    expected: int,
    lost: Collection[int] = (),
    parted: Collection[int] = (),
    take_off_ns: int = 0,
    notice_ns: int = NOTICE_NS,
) -> FormationPlanner:
    roll_call = RollCall(NodeId(node), hello_interval_s=1.0)
    roll_call.parted = parted
    roll_call.lost.update(dict.fromkeys(lost, 0))
    return FormationPlanner(
        NodeId(node), roll_call, expected=expected, deploy_speed_m_s=9, take_off_ns=take_off_ns, turns_ns=turns_ns,
        random=Random(1).random, notice_ns=notice_ns,
        of_few=lambda count, now_ns: of_few(count, DEMANDS) if now_ns < 300 * S else None,
    )  # fmt: skip


def planner_with(
    nodes: int, *, node: int = 1, lost: Collection[int] = (), parted: Collection[int] = ()
) -> FormationPlanner:
    made = planner_of(node, expected=nodes, lost=lost, parted=parted)
    for other in range(1, nodes + 1):
        place = Enu(200.0 * ((other - 1) % 9 - 4), 200.0 * ((other - 1) // 9 - 2), 50)
        made.status(SearchStatus(0, place, other, 0, 100), now_ns=0)
    return made


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_plan_gives_everyone_a_place_and_the_swarm_stays_in_one_piece_on_the_way_to_these(seed: int) -> None:
    planner, pattern, random = planner_of(1, expected=45), formation(), Random(seed)
    starts = {}
    for node in range(1, 46):
        east, north = 200 * ((node - 1) % 9 - 4), 200 * ((node - 1) // 9 - 2)
        starts[node] = Enu(east + random.uniform(-30, 30), north + random.uniform(-30, 30), 50)
        planner.status(SearchStatus(0, starts[node], node, 0, 100), now_ns=0)
    assert planner.review(pattern, now_ns=S)
    plan = planner.plan
    assert plan is not None
    assert sorted(plan.nodes) == list(range(1, 46))
    begun = pattern_of(plan, reach_m=REACH_M)
    assert begun.dimensions.first_m >= 300.0, "the lines begin around the swarm"
    for share in (step / 40 for step in range(41)):
        places = []
        for place, node in enumerate(plan.nodes):
            way = begun.at(place, 0.0).minus(starts[node])
            places.append(Enu(starts[node].east + share * way.east, starts[node].north + share * way.north, 50))
        assert is_one(places), share


def grid(count: int, columns: int, apart_m: float) -> dict[int, Enu]:
    """Where UAVs of a grid around the middle stand, by id."""
    rows = -(-count // columns)
    return {
        at + 1: Enu(apart_m * (at % columns - (columns - 1) / 2), apart_m * (at // columns - (rows - 1) / 2), 50)
        for at in range(count)
    }


@pytest.mark.parametrize(
    ("swarm", "area_m", "lines"),
    [
        (grid(40, 8, 100.0), 1000.0, 4),  # they fly to four lines as one network
        (grid(110, 11, 200.0), 4000.0, 2),  # to four they would come apart
        ({node: at._replace(north=9e3 * (node % 2)) for node, at in grid(40, 8, 100.0).items()}, 1000.0, 4),
    ],
)
def test_uavs_fly_in_as_many_lines_as_they_reach_in_one_piece_and_in_most_if_they_are_torn_anyway(
    swarm: dict[int, Enu], area_m: float, lines: int
) -> None:
    planner = planner_of(1, expected=len(swarm))
    for node, at in swarm.items():
        planner.status(SearchStatus(0, at, node, 0, 100), now_ns=0)
    assert planner.review(fitted(len(swarm), DEMANDS._replace(area_m=area_m)), now_ns=S)
    plan = planner.plan
    assert plan is not None
    assert (plan.teams, sorted(plan.nodes)) == (lines, list(swarm))
    begun = pattern_of(plan, reach_m=REACH_M)
    if lines == 2:
        assert is_one([begun.at(place, begun.shape.sweep_s) for place in range(begun.places)]), "relays suffice"


def test_a_uav_that_one_byte_cannot_name_gets_no_place() -> None:
    planner = planner_of(1, expected=6)
    swarm = dict(zip((1, 2, 3, 255, 256, 300), grid(6, 3, 100.0).values(), strict=True))
    for node, at in swarm.items():
        planner.status(SearchStatus(0, at, node, 0, 100), now_ns=0)
    assert planner.review(of_few(6, DEMANDS._replace(area_m=400)), now_ns=S)
    assert planner.plan is not None
    assert sorted(node for node in planner.plan.nodes if node) == [1, 2, 3, 255]
    assert not planner.review(of_few(6, DEMANDS._replace(area_m=400)), now_ns=60 * S), "nor a vacant one later"


@pytest.mark.parametrize(("apart_m", "waits_s"), [(200.0, 0.0), (190.0, 5.1)])
def test_lines_around_a_swarm_begin_when_each_is_there_and_could_have_visited_who_is_near_it(
    apart_m: float, waits_s: float
) -> None:
    planner, pattern = planner_of(1, expected=45), formation()
    for node in range(1, 46):
        at = Enu(apart_m * ((node - 1) % 9 - 4), apart_m * ((node - 1) // 9 - 2), 50)
        planner.status(SearchStatus(0, at, node, 0, 100), now_ns=0)
    assert planner.review(pattern, now_ns=S)
    assert planner.plan is not None
    assert planner.plan.deploy_ds / 10 == pytest.approx(apart_m * math.sqrt(32 / 45) / 3.7 + waits_s, abs=0.1)


def test_uavs_that_hear_nobody_take_different_places_and_keep_them() -> None:
    pattern, places = formation(), []
    for node in range(1, 46):
        planner = planner_of(node, expected=45)
        for second in range(40):
            planner.on_neighbor(node, Enu(10.0 * node, 0.0, 50.0), now_ns=second * S)
            planner.review(pattern, now_ns=second * S)
        assert planner.plan is not None
        assert planner.plan.revision == 1
        places.append(planner.plan.nodes.index(node))
    assert sorted(places) == list(range(45))


def test_the_first_plan_begins_when_all_have_had_time_to_take_off() -> None:
    begins_s = []
    for take_off_s, apart_m in ((0, 15), (5, 15), (30, 15), (30, 3)):
        planner = planner_of(1, expected=45, take_off_ns=take_off_s * S)
        planner.review(None, now_ns=S)
        for other in range(1, 46):
            planner.status(SearchStatus(0, Enu(float(apart_m * other), 0.0, 0.1), other, 0, 100), now_ns=0)
        assert planner.review(formation(), now_ns=3 * S)
        assert planner.plan is not None
        begins_s.append(planner.plan.start_us * US / S)
    assert begins_s == [10, 10, 31, 68], "from the notice of 7 s, or from the first review; in turns, for 37 s at most"


def test_a_plan_with_a_short_notice_is_told_again_a_second_before_it_begins() -> None:
    planner = planner_of(1, expected=2, notice_ns=NOTICE_IN_ROUNDS_NS)
    for node, east_m in ((1, 0.0), (2, 100.0)):
        planner.status(SearchStatus(0, Enu(east_m, 0.0, 50), node, 0, 100), now_ns=0)
    told_s = []
    for second in range(1, 10):
        planner.review(of_few(2, DEMANDS), now_ns=second * S)
        told_s += [second] * len(planner.to_tell)
        planner.to_tell.clear()
    assert planner.plan is not None
    assert planner.plan.start_us * US == 4 * S
    assert told_s == [1, 3, 9], "at once, before it begins, and 6 s later"


def test_another_planner_tells_the_plan_to_who_says_after_it_that_it_has_none_and_not_to_who_said_so_before() -> None:
    first = planner_with(45)
    first.review(formation(), now_ns=S)
    assert first.plan is not None
    planner = planner_of(1, expected=2)
    planner.status(SearchStatus(0, Enu(100, 0, 50), 2, 0, 100), now_ns=0)
    planner.on_plan(first.plan)
    for second in range(1, 25):
        planner.on_neighbor(2, Enu(100, 0, 50), now_ns=second * S)
        planner.review(formation(), now_ns=second * S)
    assert planner.to_tell == []
    planner.status(SearchStatus(25_000_000, Enu(100, 0, 50), 2, 0, 100), now_ns=25 * S)
    planner.review(formation(), now_ns=25 * S)
    assert planner.to_tell == [first.plan]


def test_who_is_out_for_a_survivor_becomes_a_follower_and_until_it_is_back_others_close_ranks() -> None:
    planner, pattern = planner_with(45), formation()
    planner.status(SearchStatus(1, Enu(-400.0, 0.0, 50), 21, 0, 100, absent=True), now_ns=0)
    assert planner.absent == {21}
    assert planner.review(pattern, now_ns=S)
    assert planner.plan is not None
    assert planner.plan.nodes.index(21) in pattern.followers
    undisturbed = planner_with(45)
    undisturbed.review(pattern, now_ns=S)
    assert undisturbed.plan is not None
    assert undisturbed.plan.nodes.index(21) not in pattern.followers
    planner.status(SearchStatus(2, Enu(-400.0, 0.0, 50), 21, 1, 100), now_ns=2 * S)
    assert planner.absent == set()


def planned(lost_place: int) -> tuple[FormationPlanner, Search, int]:
    """A planner that has followed its plan for 20 s when the UAV of this place is lost: with the plan and that UAV."""
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    planner.review(pattern, now_ns=2 * S)
    assert planner.plan is not None
    return planner, planner.plan, planner.plan.nodes[lost_place]


@pytest.mark.parametrize("shape", [ShapeName.LINES, ShapeName.SPIRAL, ShapeName.RING])
def test_the_plan_remains_when_uavs_are_lost(shape: ShapeName) -> None:
    pattern = fitted(45, DEMANDS, shape=shape)
    assert pattern is not None
    planner = planner_with(45, lost=range(2, 40))
    plan = plan_of(pattern, tuple(range(1, 46)), planner=1, start_us=0, deploy_ds=10)
    planner.on_plan(plan)
    for second in (1, 20, 200):
        planner.review(pattern, now_ns=second * S)
    assert planner.plan == plan


def test_a_newcomer_gets_the_place_of_a_uav_only_when_that_one_has_been_lost_for_long() -> None:
    planner, before, lost = planned(20)
    planner._roll_call.lost[lost] = 3 * S
    planner.review(formation(), now_ns=20 * S)
    assert planner.plan is not None
    assert lost in planner.plan.nodes
    for now_ns, has_one in ((40 * S, False), (80 * S, True)):
        planner.status(SearchStatus(now_ns // US, Enu(0, 0, 50), 99, 0, 100), now_ns=now_ns)
        planner.review(formation(), now_ns=now_ns)
        assert (99 in planner.plan.nodes, lost in planner.plan.nodes) == (has_one, not has_one)
    assert set(before.nodes) - {lost} < set(planner.plan.nodes)


def test_only_the_lowest_id_that_is_alive_plans() -> None:
    assert not planner_with(45, node=2).review(formation(), now_ns=S)


def test_who_flies_home_holds_no_place_any_more_from_when_it_says_so() -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    before = planner.plan
    assert before is not None
    planner.review(pattern, now_ns=2 * S)
    leaver, later_ns = before.nodes[3], 20 * S
    planner.status(SearchStatus(later_ns // US, Enu(0, 0, 50), leaver, 1, 0), now_ns=later_ns)
    planner.on_neighbor(leaver, Enu(0, 0, 50), now_ns=later_ns)  # its hellos are heard still
    assert planner.review(pattern, now_ns=later_ns)
    after = planner.plan
    assert after is not None
    assert leaver not in after.nodes
    assert sorted(node for node in after.nodes if node) == [node for node in range(1, 46) if node != leaver]
    assert after.nodes[3] in before.nodes[pattern.followers.start :]


@pytest.mark.parametrize(("leavers", "whole"), [(3, True), (20, False)])
def test_when_those_who_stay_cannot_span_the_area_they_fly_a_formation_that_they_can(leavers: int, whole: bool) -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    planner.review(pattern, now_ns=2 * S)
    before = planner.plan
    assert before is not None
    for node in range(46 - leavers, 46):
        planner.status(SearchStatus(20_000_000, Enu(0, 0, 50), node, 1, 0), now_ns=20 * S)
    assert planner.review(pattern, now_ns=20 * S)
    assert planner.plan is not None
    assert planner.plan.start_us == before.start_us, "others may be about to say that they leave as well"
    planner.review(pattern, now_ns=21 * S)
    assert planner.review(pattern, now_ns=32 * S) != whole
    plan = planner.plan
    assert plan is not None
    assert (plan.start_us == before.start_us, plan.shape == before.shape) == (whole, whole)
    assert plan.revision == before.revision + (1 if whole else 2)
    assert sorted(node for node in plan.nodes if node) == list(range(1, 46 - leavers))
    made = pattern_of(plan, reach_m=REACH_M)
    assert is_one([made.at(place, 0.0) for place in range(made.places)])
    assert max(made.at(place, made.shape.sweep_s).east for place in range(made.places)) > 1100
    assert not planner.review(pattern, now_ns=90 * S), "it is not made anew while it can be flown"


def test_nobody_begins_anew_when_the_search_is_over() -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    before = planner.plan
    assert before is not None
    for node in range(1, 46):
        planner.status(SearchStatus(300_000_000, Enu(0, 0, 50), node, 1, 0 if node > 9 else 99), now_ns=300 * S)
    for second in (300, 301, 320):
        planner.review(pattern, now_ns=second * S)
        assert planner.plan is not None
        assert planner.plan.start_us == before.start_us


def test_what_a_slow_flood_says_counts_although_hellos_of_that_uav_came_before_it() -> None:
    planner, _, _ = planned(0)
    leaver, there = 7, Enu(30.0, 0.0, 50.0)
    planner.on_neighbor(leaver, there, now_ns=10 * S)
    planner.status(SearchStatus(5_000_000, Enu(0, 0, 50), leaver, 1, 0, absent=True), now_ns=10 * S)
    assert (planner.leavers, planner.absent) == ({leaver}, {leaver})
    assert planner._members[leaver].position == there
    planner.status(SearchStatus(4_000_000, Enu(0, 0, 50), leaver, 1, 100), now_ns=11 * S)
    assert planner.leavers == {leaver}, "an older status that comes later changes nothing"


def test_a_planner_that_flies_home_leaves_planning_to_the_next() -> None:
    first, second = planner_with(45, node=1), planner_with(45, node=2)
    gone = SearchStatus(S // US, Enu(0, 0, 50), 1, 0, 0)
    for planner in (first, second):
        planner.status(gone, now_ns=S)
    assert not first.review(formation(), now_ns=S)
    assert second.review(formation(), now_ns=S)
    assert second.plan is not None
    assert 1 not in second.plan.nodes


def test_of_two_plans_the_newer_one_counts_and_of_equal_ones_that_of_the_lower_id() -> None:
    listener = planner_of(9, expected=9)

    def plan(revision: int, planner: int) -> Search:
        return Search(1, 100.0, 10.0, 50.0, 50.0, 7.5, 10, revision, planner, (1, 2, 3, 4), 2, 0, 0)

    assert [listener.on_plan(plan(*which)) for which in ((1, 4), (1, 5), (1, 3), (2, 8), (1, 1), (2, 8))] == [
        True, False, True, True, False, False,
    ]  # fmt: skip


def test_the_number_of_a_plan_wraps_as_a_forged_one_may_be_the_greatest() -> None:
    planner, pattern = planner_with(45), formation()
    planner.on_plan(plan_of(pattern, tuple(range(1, 46)), planner=1, start_us=0, deploy_ds=10)._replace(revision=65535))
    planner.review(pattern, now_ns=S)
    later_ns = 90 * S
    for node in range(1, 46):
        charge = 0 if node == 5 else 100
        planner.status(SearchStatus(later_ns // US, Enu(0, 0, 50), node, 65535, charge), now_ns=later_ns)
    assert planner.review(pattern, now_ns=later_ns)
    assert planner.plan is not None
    told = told_in(bytes(HEADER_BYTES) + planner.plan.encode_frame(1))[0]
    assert told.revision == 1, "0 stands for no plan"
    other = planner_with(45, node=2)
    other.on_plan(told._replace(revision=65535))
    assert other.on_plan(told)


class Swarm:
    """Planners that hear each other's hellos, statuses and plans."""

    def __init__(self, count: int) -> None:
        self.pattern = fitted(count, DEMANDS, shape=ShapeName.SPIRAL)
        self.planners = {node: self.fresh(node, count) for node in range(1, count + 1)}
        self.second = 0
        self.lost: set[int] = set()

    def fresh(self, node: int, count: int) -> FormationPlanner:
        return planner_of(node, expected=count)

    def fly(self, seconds: int, *, deaf: Collection[int] = ()) -> None:
        """Let time pass; those who are `deaf` receive no plan."""
        for _ in range(seconds):
            self.second += 1
            now_ns = self.second * S
            for planner in self.planners.values():
                planner._roll_call.lost.update(dict.fromkeys(self.lost, 0))
            for node, sender in self.planners.items():
                plan, place = sender.plan, Enu(20.0 * node, 0.0, 50.0)
                status = SearchStatus(now_ns // US, place, node, plan.revision if plan else 0, 100)
                for receiver in self.planners.values():
                    if self.second % 12 == node % 12:
                        receiver.status(status, now_ns=now_ns)
                    elif receiver is not sender:
                        receiver.on_neighbor(node, place, now_ns=now_ns)
                sender.review(self.pattern, now_ns=now_ns)
                told, sender.to_tell = sender.to_tell, []
                for plan in told:
                    for receiver in (self.planners[other] for other in self.planners if other not in deaf):
                        receiver.on_plan(plan)

    @property
    def plans(self) -> set[Search | None]:
        return {planner.plan for planner in self.planners.values()}


def test_a_planner_that_restarts_follows_the_plan_of_the_others() -> None:
    swarm = Swarm(5)
    swarm.fly(60)
    (plan,) = swarm.plans
    assert plan is not None
    assert plan.planner == 1
    swarm.planners[1] = swarm.fresh(1, 5)
    swarm.fly(60)
    assert swarm.plans == {plan}
    swarm.planners[6] = swarm.fresh(6, 5)
    swarm.lost.add(4)
    del swarm.planners[4]
    swarm.fly(90)
    (mended,) = swarm.plans
    assert mended is not None
    assert mended.planner == 1, "it plans again"
    assert sorted(mended.nodes) == [1, 2, 3, 5, 6], "the newcomer has the place of the lost one"


def test_a_new_planner_tells_the_plan_to_whom_the_lost_one_could_not_reach() -> None:
    swarm = Swarm(7)
    swarm.fly(60, deaf=[7])
    plan = swarm.planners[2].plan
    assert plan is not None
    assert swarm.planners[7].plan is None
    for lost in (1, 4, 5, 6):
        del swarm.planners[lost]
        swarm.lost.add(lost)
    swarm.fly(150)
    assert swarm.plans == {plan}, "a loss changes no plan"


def test_a_restarted_planner_whom_nobody_tells_the_plan_makes_one_that_replaces_it() -> None:
    swarm = Swarm(3)
    swarm.fly(40)
    swarm.planners[1] = swarm.fresh(1, 3)
    swarm.fly(55, deaf=[1])
    assert swarm.planners[1].plan is None
    swarm.fly(30, deaf=[1])
    (plan,) = swarm.plans
    assert plan is not None
    assert (plan.planner, plan.revision) == (1, 2)


def test_each_part_of_a_swarm_that_has_come_apart_has_one_planner() -> None:
    parts = range(1, 20), range(20, 46)
    leads = [
        node
        for part, away in (parts, parts[::-1])
        for node in part
        if planner_with(45, node=node, parted=away).review(formation(), now_ns=15 * S)
    ]
    assert leads == [1, 20]
