"""Tasks: a UAV bids for survivors that were reported, wins, and gives up."""

import pytest
from search_board import FOLLOWER, LINE, TAKEN_UP_NS, UP_M, Board, lane_of

from agents.mission.finding.phone_localization import Estimate
from fanet_mw.trace import Approaching, Arrived, Located
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.search_messages import Bid
from fanet_mw.wire.survivors import Found, Standing, Survivor

NOW_NS = TAKEN_UP_NS + 20 * S


def board_with_a_task(*, east_m: float) -> Board:
    """A follower that has won the task to go to a survivor, so far east of its lane, whom four nodes have reported."""
    at = lane_of(FOLLOWER, NOW_NS)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + east_m, at.north, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.choose(NOW_NS)
    return board


def test_a_follower_bids_for_a_reported_survivor_near_its_line_wins_and_says_so() -> None:
    board = board_with_a_task(east_m=60)
    assert board.tasks.survivor == 1
    assert [type(record) for record in board.out.records] == [Located, Approaching]
    board.tasks.close(1, now_ns=NOW_NS)
    assert board.tasks.survivor is None


@pytest.mark.parametrize(("ahead_m", "task"), [(120, None), (90, 1)])
def test_better_bids_take_a_task_away_but_from_who_is_nearly_there(ahead_m: float, task: int | None) -> None:
    at = lane_of(LINE, NOW_NS)
    board = Board(LINE, at)
    board.hear(1, Enu(at.east + 60, at.north + ahead_m, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.merge([Bid(1, bidder, 1, 1) for bidder in (30, 31)], now_ns=NOW_NS)
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor == 1, "three are wanted"
    board.tasks.merge([Bid(1, 32, 1, 1)], now_ns=NOW_NS)
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor == task
    board.approach.arrived_ns[1] = NOW_NS
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor is None, "it was there, and found nobody"


@pytest.mark.parametrize("reporters", [range(1, 2), range(FOLLOWER, FOLLOWER + 1)])
def test_where_reporters_are_too_few_the_nearest_uav_goes_at_once_and_later_a_second_one(reporters: range) -> None:
    at = lane_of(FOLLOWER, NOW_NS)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + 60, at.north + (80 if at.north > 0 else -80), 0), reporters, now_ns=NOW_NS)
    board.tasks.merge([Bid(1, 30, 1, 1)], now_ns=NOW_NS)
    board.tasks.bid(NOW_NS + 3 * S)
    assert [bid.bidder for bid in board.tasks.bids_to_tell(now_ns=NOW_NS)] == [30], "one is enough, and nearer"
    board.tasks.bid(NOW_NS + 5 * S)
    board.tasks.choose(NOW_NS + 5 * S)
    assert board.tasks.survivor == 1


def test_who_has_no_plan_yet_goes_to_a_survivor_nearby_and_not_far_from_the_swarm() -> None:
    for east_m, task in ((60, 1), (170, None)):
        board = Board(LINE, Enu(0, 0, UP_M), plan=None)
        board.hear(1, Enu(east_m, 0, 0), range(1, 5), now_ns=0)
        board.tasks.bid(0)
        board.tasks.choose(0)
        assert board.tasks.survivor == task
        goal, _ = board.goal.at(task, 0)
        assert (goal.minus(Enu(60, 0, 0)).horizontal() < 30) == (task is not None)


def test_before_the_sweep_a_uav_responds_that_is_not_led_away_from_the_survivor_by_the_plan() -> None:
    place = lane_of(LINE, TAKEN_UP_NS)
    board = Board(LINE, place._replace(north=place.north + 300))
    truth = Enu(place.east + 130, place.north + 280, 0)
    board.hear(1, truth, range(1, 5), now_ns=S)
    board.tasks.bid(TAKEN_UP_NS - 10 * S)
    assert board.tasks.bids_to_tell(now_ns=S) == [], "by then its place is far away"
    board.tasks.bid(S)
    board.tasks.choose(S)
    assert board.tasks.survivor == 1
    assert board.goal.at(1, S)[0].minus(truth).horizontal() < 30, "no lane limits it yet"
    board.approach.arrived_ns[1] = 20 * S
    for left_s, task in ((30, 1), (14, 1), (13, None)):
        board.tasks.choose(TAKEN_UP_NS - left_s * S)
        assert board.tasks.survivor == task, "300 m at 9 m/s, and at most 20 s late"


def test_before_the_sweep_a_responder_that_is_held_back_soon_takes_its_bid_back() -> None:
    first = lane_of(LINE, TAKEN_UP_NS)
    board = Board(LINE, first)
    board.hear(1, Enu(first.east, first.north + 75, 0), range(1, 5), now_ns=S)
    board.tasks.bid(S)
    for after_s, task in ((0, 1), (24, 1), (27, None)):
        board.tasks.choose((1 + after_s) * S)
        assert board.tasks.survivor == task, "75 m at 7.5 m/s, and 15 s"


@pytest.mark.parametrize(
    ("east_m", "north_m", "left_s", "is_first", "stays"),
    [
        (0, 370, 2, True, True),  # 70 m from the survivor, and it will be 39 s late at its place
        (0, 230, 2, False, False),
        (160, 300, 2, True, False),  # farther than 120 m
        (0, 380, 1, True, False),  # more than 40 s late
    ],
)
def test_before_the_sweep_the_first_responder_that_is_nearly_there_goes_on_though_it_will_be_late(
    east_m: float, north_m: float, left_s: int, is_first: bool, stays: bool
) -> None:
    first = lane_of(LINE, TAKEN_UP_NS)
    board = Board(LINE, first)
    board.hear(1, Enu(first.east, first.north + 300, 0), range(1, 5), now_ns=8 * S)
    board.tasks.bid(8 * S)
    board.tasks.choose(8 * S)
    assert board.tasks.survivor == 1
    now_ns = TAKEN_UP_NS - left_s * S
    board.tasks.merge([] if is_first else [Bid(1, 7, 0, 1, 0)], now_ns=now_ns)
    board.own_motion.position = Enu(first.east + east_m, first.north + north_m, UP_M)
    board.tasks.choose(now_ns)
    assert (board.tasks.survivor == 1) is stays


@pytest.mark.parametrize("is_placed", [True, False])
def test_who_sought_a_vague_place_in_vain_bids_again_at_once_when_the_phone_is_placed(*, is_placed: bool) -> None:
    first = lane_of(LINE, TAKEN_UP_NS)
    board, survivor = Board(LINE, first), Enu(first.east, first.north + 40, 0)
    board.hear(1, survivor, range(1, 2), now_ns=S)
    board.tasks.bid(S)
    board.tasks.choose(S)
    board.tasks.choose(50 * S)
    assert board.tasks.survivor == 1, "it goes round for 30 s, until powers tell the place"
    board.tasks.choose(57 * S)
    assert board.tasks.survivor is None, "it was held back, and has taken its bid back"
    if is_placed:
        board.hear(1, survivor, range(2, 6), now_ns=58 * S)
    board.tasks.bid(58 * S)
    board.tasks.choose(58 * S)
    assert board.tasks.survivor == (1 if is_placed else None)


def test_before_the_sweep_a_uav_goes_as_far_aside_of_its_way_as_it_is_back_in_time() -> None:
    first = lane_of(LINE, TAKEN_UP_NS)
    for left_s, bids in ((50, True), (26, False)):  # 20 s there, 22 s back, and 8 s to look
        board = Board(LINE, first)
        board.hear(1, Enu(first.east, first.north + 200, 0), range(1, 5), now_ns=S)
        board.tasks.bid(TAKEN_UP_NS - left_s * S)
        assert bool(board.tasks.bids_to_tell(now_ns=S)) == bids


def test_who_still_takes_off_comes_later_than_who_is_in_the_air() -> None:
    board = Board(LINE, Enu(0, 0, UP_M), plan=None)
    board.hear(1, Enu(60, 0, 0), range(1, 5), now_ns=0)
    board.tasks.bid(0, delay_s=20.0)
    assert board.tasks.bids_to_tell(now_ns=0)[0].eta_ds == pytest.approx(260, abs=25)


def test_a_responder_that_finds_nobody_takes_its_bid_back_and_does_not_bid_again_at_once() -> None:
    board = board_with_a_task(east_m=0)
    board.goal.at(board.tasks.survivor, NOW_NS)
    assert [type(record) for record in board.out.records] == [Located, Approaching, Arrived]
    later_ns = NOW_NS + 46 * S
    board.tasks.choose(later_ns)
    board.tasks.bid(later_ns)
    assert board.tasks.survivor is None
    assert [bid.eta_ds for bid in board.tasks.bids_to_tell(now_ns=later_ns)] == [0xFFFF]
    board.tasks.reopen(1)
    assert board.approach.arrived_ns == {}, "what it came to was not the place"


@pytest.mark.parametrize(("behind_m", "stays_s"), [(125, 1), (60, 25)])
def test_a_responder_whose_lane_leaves_a_survivor_behind_takes_its_bid_back(behind_m: float, stays_s: int) -> None:
    """A line of 7.5 m/s keeps its UAVs within 140 m, and who is within 120 m of somebody within 200 m."""
    at = lane_of(LINE, NOW_NS)
    board = Board(LINE, at)
    board.hear(1, Enu(at.east, at.north - behind_m, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    goes = board.goal.at(1, NOW_NS + stays_s * S)[0]
    assert goes.north == pytest.approx(at.north - behind_m, abs=20), "to the place, not as far as the lag"
    for after_s, task in ((0, 1), (stays_s, 1), (stays_s + 3, None)):
        board.tasks.choose(NOW_NS + after_s * S)
        assert board.tasks.survivor == task
    assert [bid.eta_ds for bid in board.tasks.bids_to_tell(now_ns=NOW_NS + 22 * S)] == [0xFFFF]


@pytest.mark.parametrize(("aside_m", "near_m", "goes"), [(250, 60, True), (250, 150, False), (340, 60, False)])
def test_who_passes_near_somebody_on_its_way_to_its_lane_goes_there(
    aside_m: float, near_m: float, *, goes: bool
) -> None:
    early_ns = TAKEN_UP_NS + 10 * S
    at = lane_of(LINE, early_ns)
    here = Enu(at.east + aside_m, at.north, UP_M)
    board = Board(LINE, here)
    board.hear(1, Enu(here.east, here.north - near_m, 0), range(1, 5), now_ns=early_ns)
    board.tasks.bid(early_ns)
    board.tasks.choose(early_ns)
    assert (board.tasks.survivor == 1) == goes
    assert (board.goal.at(board.tasks.survivor, early_ns)[0].minus(here).north < -near_m / 2) == goes


def test_a_uav_of_a_line_looks_for_who_is_vaguely_placed_ahead_and_not_for_who_is_so_behind() -> None:
    at = lane_of(LINE, NOW_NS)
    for ahead_m, bids in ((150, True), (-60, False)):
        board = Board(LINE, at)
        board.hear(1, Enu(at.east + 40, at.north + ahead_m, 0), range(1, 2), now_ns=NOW_NS)
        place = board.survivors.by_id[1].place()
        assert place is not None
        assert place.sigma_m > 50, "one bearing is vague"
        board.tasks.bid(NOW_NS)
        assert bool(board.tasks.bids_to_tell(now_ns=NOW_NS)) == bids


def test_who_looks_for_somebody_goes_on_behind_as_its_lane_permits() -> None:
    at = lane_of(LINE, NOW_NS)
    board = Board(LINE, at)
    board.hear(1, Enu(at.east + 40, at.north + 20, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor == 1
    for second in range(0, 30, 3):
        lane = lane_of(LINE, NOW_NS + second * S)
        vague = Estimate(at.east + 40, at.north + 20, 70.0**2, 0.0, 70.0**2)
        board.survivors.by_id[1].filter.on_sighting(vague)
        board.tasks.choose(NOW_NS + second * S)
        assert (board.tasks.survivor == 1) == (lane.north - at.north - 20 <= 140), second


def test_a_responder_that_does_not_come_in_time_takes_its_bid_back() -> None:
    board = Board(LINE, Enu(0, 0, UP_M), plan=None)
    board.hear(1, Enu(60, 0, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor == 1
    board.tasks.choose(NOW_NS + 46 * S)
    assert board.tasks.survivor == 1, "it has the time of the flight, too"
    later_ns = NOW_NS + 90 * S
    board.tasks.choose(later_ns)
    board.tasks.bid(later_ns)
    assert board.tasks.survivor is None
    assert [bid.eta_ds for bid in board.tasks.bids_to_tell(now_ns=later_ns)] == [0xFFFF]


@pytest.mark.parametrize(("north_m", "stays"), [(None, False), (90, True), (10, False)])
def test_a_responder_that_is_told_of_another_place_has_the_time_of_that_way(north_m: float | None, stays: bool) -> None:
    board = Board(LINE, Enu(0, 0, UP_M), plan=None)
    board.hear(1, Enu(10, 0, 0), range(1, 5), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.choose(NOW_NS)
    board.goal.at(board.tasks.survivor, NOW_NS)
    if north_m is not None:
        told = Found(NOW_NS // US + 1, 1, 10, north_m, 4, 0, 4, NodeId(3), Standing.ESTIMATED)
        board.survivors.on_found(told, now_ns=NOW_NS + 44 * S)
    for after_s in (44, 50):
        board.tasks.choose(NOW_NS + after_s * S)
    assert (board.tasks.survivor == 1) == stays


@pytest.mark.parametrize(("plan", "located", "most"), [(False, False, 6), (False, True, 3), (True, False, 3)])
def test_before_the_sweep_twice_as_many_go_to_a_vague_place(plan: bool, located: bool, most: int) -> None:
    at, now_ns = lane_of(FOLLOWER, NOW_NS), NOW_NS if plan else 0
    for others in (most - 1, most):
        board = Board(FOLLOWER, at) if plan else Board(FOLLOWER, at, plan=None)
        for reporter, east_m in ((2, -60), (3, 60), (4, 20), (5, -20)) if located else ((2, 0), (3, 0), (4, 0)):
            board.survivors.take_report(
                Survivor(now_ns // US, 1, reporter, Enu(at.east + east_m, at.north + 5 * reporter, UP_M), -79.0),
                now_ns=now_ns,
            )
        place = board.survivors.by_id[1].place()
        assert place is not None
        assert (place.sigma_m <= 50) == located
        board.tasks.merge([Bid(1, 30 + other, 1, 1) for other in range(others)], now_ns=now_ns)
        board.tasks.bid(now_ns)
        assert (FOLLOWER in {bid.bidder for bid in board.tasks.bids_to_tell(now_ns=now_ns)}) == (others < most)


TURNED_NS = TAKEN_UP_NS + 200 * S
"""The line flies back: a place that it reaches now it passed 70 s ago on its way out."""


def board_of_one_that_was_there_before() -> Board:
    """A follower where it is at `TURNED_NS`, and a survivor below it that was reported when the line passed on its way
    out.
    """
    at = lane_of(FOLLOWER, TURNED_NS)
    board = Board(FOLLOWER, at)
    board.hear(1, at, range(1, 5), now_ns=TURNED_NS - 70 * S)
    return board


def board_of_one_that_searched_in_vain() -> Board:
    """It won the task on the way out, and took its bid back 24 s before `TURNED_NS`."""
    board = board_of_one_that_was_there_before()
    board.tasks.bid(TURNED_NS - 70 * S)
    board.tasks.choose(TURNED_NS - 70 * S)
    board.goal.at(board.tasks.survivor, TURNED_NS - 70 * S)
    board.tasks.choose(TURNED_NS - 24 * S)
    assert board.tasks.survivor is None
    return board


def assert_that_it_searches(board: Board) -> None:
    for after_s in (0, 1, 30):
        board.tasks.bid(TURNED_NS + after_s * S)
        board.tasks.choose(TURNED_NS + after_s * S)
        assert board.tasks.survivor == 1, after_s
        board.goal.at(1, TURNED_NS + after_s * S)


def test_a_responder_that_took_its_bid_back_waits_before_it_bids_again() -> None:
    board = board_of_one_that_searched_in_vain()
    for after_s, bids in ((-24, False), (-5, False), (-4, True)):
        now_ns = TURNED_NS + after_s * S
        board.tasks.bid(now_ns)
        assert (board.tasks.bids_to_tell(now_ns=now_ns)[0].eta_ds != 0xFFFF) is bids, after_s


def test_one_that_wins_a_task_once_more_has_its_time_once_more() -> None:
    assert_that_it_searches(board_of_one_that_searched_in_vain())


def test_one_that_came_by_a_minute_before_it_won_the_task_searches_as_any_other() -> None:
    board = board_of_one_that_was_there_before()
    place = board.survivors.by_id[1].place()
    assert place is not None
    board.approach.next_point(1, place, TURNED_NS - 70 * S, responding=False)
    assert_that_it_searches(board)


def test_one_that_loses_a_task_for_a_moment_gains_no_time_by_that() -> None:
    at = lane_of(FOLLOWER, NOW_NS + 20 * S)
    board = Board(FOLLOWER, at)
    board.hear(1, at, range(1, 5), now_ns=NOW_NS - 18 * S)
    board.tasks.bid(NOW_NS - 18 * S)
    board.tasks.choose(NOW_NS - 18 * S)
    board.goal.at(1, NOW_NS - 18 * S)
    board.tasks.survivor = None
    for after_s, survivor in ((20, 1), (26, 1), (28, None)):
        board.tasks.choose(NOW_NS + after_s * S)
        assert board.tasks.survivor == survivor, after_s
