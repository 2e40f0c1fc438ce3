"""The place of a UAV in the formation of a search: taking it up, staying near it."""

import itertools
import math
from collections.abc import Collection

import pytest
from search_board import FOLLOWER, LINE, PLAN, REACH_M, TAKEN_UP_NS, UP_M, Board, lane_of

from agents.mission.finding.phone_localization import Estimate
from agents.mission.hungarian import assign
from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.search_formation.pattern import fitted
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.units import STILL, US, Enu, NodeId, S
from fanet_mw.wire.search_plan import Search


def test_who_has_no_plan_waits_where_it_is() -> None:
    board = Board(LINE, Enu(7, 8, UP_M), plan=None)
    assert board.place.lane(5 * S) == (Enu(7, 8, UP_M), Enu(0, 0, 0))
    assert board.goal.at(None, 5 * S) == (Enu(7, 8, UP_M), Enu(0, 0, 0))


def test_a_place_is_taken_up_on_a_straight_way_that_begins_and_ends_with_the_plan() -> None:
    board = Board(LINE, Enu(0, -400, UP_M))
    end = board.place.lane(TAKEN_UP_NS)[0]
    assert board.place.lane(9 * S)[0] == Enu(0, -400, UP_M), "the plan begins after 10 s"
    half = board.place.lane(35 * S)[0]
    assert (half.east, half.north) == pytest.approx((end.east / 2, (end.north - 400) / 2))
    assert (board.place.is_taken_up(TAKEN_UP_NS - 1), board.place.is_taken_up(TAKEN_UP_NS)) == (False, True)


def around_swarm() -> tuple[Search, dict[int, Enu]]:
    """A plan of lines that begin around 45 UAVs which stand in a grid, and where each of them is."""
    made = fitted(45, Demands(2500, 131, REACH_M, 65, 7.5))
    assert made is not None
    stand = {node: Enu(200.0 * ((node - 1) % 9) - 800, 200.0 * ((node - 1) // 9) - 400, UP_M) for node in range(1, 46)}
    begun = made.begun_around([*stand.values()])[0]
    goals = [begun.at(place, 0.0) for place in range(45)]
    nodes = [0] * 45
    for node, place in enumerate(assign([[at.horizontal_to(g) ** 2 for g in goals] for at in stand.values()]), start=1):
        nodes[place] = node
    return plan_of(begun, tuple(nodes), planner=1, start_us=10_000_000, deploy_ds=450), stand


@pytest.mark.parametrize("has_camera", [True, False])
def test_some_uavs_fly_to_their_places_over_what_no_camera_would_show_and_others_expect_them_there(
    has_camera: bool,
) -> None:
    plan, stand = around_swarm()
    arrival_ns, aside = 55 * S, 0
    watcher = Board(1, stand[1], plan=None, look_m=65.0 if has_camera else math.inf)
    for node, at in stand.items():
        watcher.place.see(node, at, 0)
    watcher.place.adopt(plan, 0)
    for place, node in enumerate(plan.nodes):
        board = Board(node, stand[node], plan=None, look_m=65.0 if has_camera else math.inf)
        for other, at in stand.items():
            board.place.see(other, at, 0)
        board.place.adopt(plan, 0)
        goal = board.place.lane(arrival_ns)[0]
        ways = [board.place.lane(second * S)[0] for second in range(10, 56)]
        flown_m = sum(a.horizontal_to(b) for a, b in itertools.pairwise(ways))
        straight_m = stand[node].horizontal_to(goal)
        aside += flown_m > straight_m + 1
        assert flown_m <= max(straight_m, 0.9 * 9 * 45) + 30
        assert ways[-1] == goal
        if node != 1:
            for second in (15, 30, 50):
                expected = watcher.place.likely_ways([place], second * S)[place].position
                assert expected.horizontal_to(ways[second - 10]) < 1e-6, "they know each other's detours"
    assert (aside > 20) is has_camera
    assert (aside == 0) is not has_camera


def test_to_another_formation_after_losses_all_fly_straight() -> None:
    plan, stand = around_swarm()
    board = Board(23, stand[23], plan=None, look_m=65.0)
    for node, at in stand.items():
        board.place.see(node, at, 0)
    board.place.adopt(plan._replace(last_m=plan.last_m - 100), 0)
    board.place.adopt(plan, 0)
    ways = [board.place.lane(second * S)[0] for second in (10, 30, 55)]
    assert ways[0].horizontal_to(ways[1]) + ways[1].horizontal_to(ways[2]) == pytest.approx(
        ways[0].horizontal_to(ways[2])
    )


def test_nobody_hurries_over_a_lost_uav_that_had_left_its_place() -> None:
    now_ns = TAKEN_UP_NS + 60 * S
    for away, closes in (((), True), ((LINE + 1,), False)):
        board = Board(LINE, lane_of(LINE, now_ns))
        board.place.close_ranks({LINE + 1}, now_ns, away=away)
        assert (board.place.closing_s(now_ns) is not None) is closes
        assert board.place.pattern is not None
        assert board.place.pattern.vacant == {LINE}, "others fly on without it in any case"


@pytest.mark.parametrize(("since_s", "leads"), [(0, True), (40, True), (40.1, False)])
def test_for_40_s_after_a_loss_whoever_is_nearer_to_another_part_leads(since_s: float, leads: bool) -> None:
    now_ns = TAKEN_UP_NS + 60 * S
    board = Board(LINE, lane_of(LINE, now_ns))
    board.place.close_ranks({LINE + 2}, now_ns, parted=range(LINE + 3, FOLLOWER + 1))
    assert board.place.leads_to_gap(LINE + 1, now_ns + round(since_s * S)) is leads
    assert not board.place.leads_to_gap(LINE - 1, now_ns)


def test_who_gets_a_place_in_another_formation_flies_there_from_where_it_is() -> None:
    here = Enu(300, -900, UP_M)
    board, now_ns = Board(LINE, here), TAKEN_UP_NS + 90 * S
    later = PLAN._replace(revision=2, start_us=now_ns // US)
    board.place.adopt(later, now_ns)
    assert board.place.lane(now_ns)[0] != here, "the same formation goes on"
    board.place.adopt(later._replace(revision=3, last_m=1000.0), now_ns)
    assert board.place.lane(now_ns)[0] == here
    assert not board.place.is_taken_up(now_ns)


def test_a_uav_of_a_line_stays_near_its_lane_and_a_follower_goes_anywhere() -> None:
    lane, moves = Enu(0, 500, UP_M), Enu(0, 7.5, 0)
    line, follower = Board(LINE, lane).place, Board(FOLLOWER, lane).place
    assert follower.bounded(300, 100, lane, moves, 0)[0] == Enu(300, 100, UP_M)
    assert line.bounded(300, 450, lane, moves, 0)[0] == Enu(58, 450, UP_M), "aside by the leash"
    assert line.bounded(0, 100, lane, moves, 0)[0] == Enu(0, 360, UP_M), "behind by the lag"
    assert line.bounded(20, 700, lane, moves, 0) == (Enu(20, 500, UP_M), moves), "ahead: the line brings it there"
    assert line.bounded(20, 560, lane, moves, 0, leads=True) == (Enu(20, 560, UP_M), STILL), "who was sent flies ahead"
    assert line.bounded(20, 700, lane, moves, 0, leads=True) == (Enu(20, 620, UP_M), moves), "by 120 m at most"


@pytest.mark.parametrize(("east_m", "goes_m"), [(40, 0), (-58, 0), (80, 21.5), (-80, -21.5), (300, 58)])
def test_who_looks_for_somebody_leaves_its_lane_only_as_far_as_its_camera_needs(east_m: float, goes_m: float) -> None:
    """It went to a false place 48 m to one side, and passed somebody 38 m to the other (rescue, seed 14, 114 s)."""
    lane, moves = Enu(0, 500, UP_M), Enu(0, 7.5, 0)
    place = Board(LINE, lane, look_m=65.0).place
    goal, feed = place.bounded(east_m, 450, lane, moves, 0, views=True)
    assert (goal.east, goal.north, feed) == (pytest.approx(goes_m), 450, STILL)
    near_m = max(-58, min(58, east_m))
    assert place.bounded(east_m, 450, lane, moves, 0)[0].east == near_m, "who has seen somebody flies there"
    assert place.bounded(40, 450, lane, STILL, 0, views=True)[0].east == 40, "nothing is missed by it at rest"
    assert Board(LINE, lane).place.bounded(near_m, 450, lane, moves, 0, views=True)[0].east == near_m, "no camera"


@pytest.mark.parametrize(("east_m", "north_m"), [(60, 80), (-60, 80), (60, -80), (-60, -80), (0, 100), (100, 0)])
def test_a_place_at_rest_has_no_side_to_which_a_uav_may_not_go(east_m: float, north_m: float) -> None:
    """North was ahead, so a line at the south edge never looked 20 m behind itself (rescue, seed 3, 155 to 197 s)."""
    lane = Enu(0, 500, UP_M)
    place = Board(LINE, lane).place
    near, far = Estimate(east_m, 500 + north_m, 1, 0, 1), Estimate(2 * east_m, 500 + 2 * north_m, 1, 0, 1)
    assert place.bounded(near.east_m, near.north_m, lane, STILL, 0) == (Enu(east_m, 500 + north_m, UP_M), STILL)
    goal, feed = place.bounded(far.east_m, far.north_m, lane, STILL, 0)
    assert feed == STILL
    assert goal.minus(lane).norm() == pytest.approx(140)
    assert (place.misses_m(near, lane, STILL, 0), place.misses_m(far, lane, STILL, 0)) == (0.0, pytest.approx(60))
    assert place.leads_by(near, lane, STILL)
    assert place.bounded(0, 500, lane, STILL, 0)[0] == lane


def test_a_uav_knows_how_far_its_place_keeps_it_from_a_survivor_for_good() -> None:
    lane, moves = Enu(0, 500, UP_M), Enu(0, 7.5, 0)

    def misses_m(node: NodeId, east_m: float, north_m: float, velocity: Enu = moves) -> float:
        return Board(node, lane).place.misses_m(Estimate(east_m, north_m, 1.0, 0.0, 1.0), lane, velocity, 0)

    assert misses_m(LINE, 58, 900) == misses_m(LINE, -58, 360) == 0.0
    assert misses_m(LINE, 88, 320) == pytest.approx(50), "30 m beyond the leash, 40 m beyond the lag"
    assert misses_m(FOLLOWER, 300, 0) == 0.0


def test_who_has_left_a_ring_for_somebody_strays_until_it_is_back_and_nobody_of_a_line_does() -> None:
    made = fitted(45, Demands(2500, 137, 250, UP_M, 7.5), shape=ShapeName.RING)
    assert made is not None
    now_ns = TAKEN_UP_NS + 5 * S
    ring = plan_of(made, tuple(range(1, 46)), planner=1, start_us=PLAN.start_us, deploy_ds=PLAN.deploy_ds)
    for node, plan, strays in ((NodeId(4), ring, True), (NodeId(5), ring, False), (LINE, PLAN, False)):
        board = Board(node, Enu(0, 0, UP_M))
        board.place.adopt(plan, 0)
        lane = board.place.lane(now_ns)[0]
        for off_m, far in ((20, False), (300, True)):
            board.own_motion.fix(lane._replace(east=lane.east + off_m, north=lane.north + off_m), STILL, now_ns=now_ns)
            assert board.place.strays(now_ns) == (strays and far), (node, off_m)
            assert not board.place.strays(TAKEN_UP_NS - 1)


def test_of_two_parts_of_a_row_that_take_each_other_for_lost_one_passes_above_the_other() -> None:
    chain, below, beyond = range(31, 41), NodeId(35), NodeId(36)

    def above(node: NodeId, lost: Collection[int], *, parted: Collection[int] = (1,)) -> bool:
        place = Board(node, Enu(0, 0, UP_M)).place
        place.close_ranks(lost, TAKEN_UP_NS, parted=parted)
        return place.passes_above

    assert above(below, {36, 37})
    assert above(below, {36}), "those behind it are out of reach, and not lost"
    assert not above(beyond, {35, 34})
    assert all(above(NodeId(node), {36, 37}) for node in chain if node < 36), "those behind follow"
    assert not above(below, {36}, parted=()), "one UAV is lost, and nobody else is missed"
    assert above(below, {36, 37}, parted=()), "two beside each other may be another part for long"
    assert not above(LINE, {36, 37}), "another row"
    assert not above(below, set())


def test_where_those_of_another_part_are_on_the_way_follows_from_where_they_were_and_from_their_places() -> None:
    board, parted, lost = Board(LINE, Enu(0, 0, UP_M)), 30, 29
    goal = lane_of(parted, TAKEN_UP_NS)
    board.place.see(parted, goal._replace(east=goal.east - 400.0), PLAN.start_us * US - 5 * S)  # before all set out
    for share, off_m in ((0.0, 400.0), (0.5, 200.0), (0.75, 100.0)):
        now_ns = PLAN.start_us * US + round(share * PLAN.deploy_ds * S / 10)
        board.place.close_ranks({lost}, now_ns, parted={parted})
        (motion,) = board.place.parted_ways(now_ns).values()
        assert goal.east - motion.position.east == pytest.approx(off_m)
        assert motion.velocity.east == pytest.approx(0.0 if not share else 400.0 / (PLAN.deploy_ds / 10))
    board.place.see(parted, goal._replace(east=goal.east - 150.0), now_ns)  # it is late
    board.place.see(parted, goal, now_ns - S)
    (motion,) = board.place.parted_ways(now_ns).values()
    assert goal.east - motion.position.east == pytest.approx(150.0), "the latest one counts"
    assert board.place.parted_ways(TAKEN_UP_NS) == {}, "in the sweep who is tied to whom says where they are"


def test_another_part_is_sought_until_ranks_are_closed_also_while_a_link_by_chance_leads_there() -> None:
    place, now_ns = Board(LINE, Enu(0, 0, UP_M)).place, 30 * S
    sought = []
    for after_s, parted in ((0, {30}), (5, set()), (14, set()), (16, set()), (17, {31})):
        place.close_ranks({29}, now_ns + after_s * S, parted=parted)
        sought.append(set(place.sought))
    assert sought == [{30}, {30}, {30}, set(), {31}]


def test_a_uav_lost_in_the_sweep_may_hover_where_its_place_was_then_over_ground_as_high_as_here() -> None:
    early, lost, hill_m = NodeId(20), NodeId(9), 30.0
    board = Board(LINE, Enu(0, 0, UP_M + hill_m))
    board.own_motion.altimeter(UP_M, now_ns=TAKEN_UP_NS + 40 * S)
    board.place.close_ranks({early}, TAKEN_UP_NS - S)
    for after_s in (40, 41, 90):
        board.place.close_ranks({early, lost}, TAKEN_UP_NS + after_s * S)
        at = lane_of(lost, TAKEN_UP_NS + 40 * S)
        assert board.place.lost_at(TAKEN_UP_NS + 40 * S) == {lost: at._replace(up=at.up + hill_m)}
