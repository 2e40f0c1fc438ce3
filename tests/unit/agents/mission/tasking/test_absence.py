"""Who may leave the formation for a survivor, and what the others do meanwhile (`mission.connection`)."""

import pytest
from search_board import FOLLOWER, LINE, PLAN, TAKEN_UP_NS, UP_M, Board, lane_of

from agents.mission.finding.phone_localization import Estimate
from agents.mission.tasking.absence import Absence, Connection
from agents.mission.tasking.bidding import Bidding
from fanet_mw.units import Enu, NodeId, S

NOW_NS = TAKEN_UP_NS + 40 * S


def behind(node: int, metres: float) -> Enu:
    """A place so far behind that of a UAV in line 0, which flies north."""
    lane = lane_of(node, NOW_NS)
    return Enu(lane.east, lane.north - metres, 0.0)


def bids_of(board: Board, truth: Enu, now_ns: int) -> Bidding:
    board.hear(1, truth, range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    return board.tasks


@pytest.mark.parametrize(("connection", "stays_s"), [("always", 2), (10, 14), (30, 19), ("none", 60)])
def test_a_uav_of_a_line_stays_with_a_survivor_as_long_as_the_scenario_lets_it(
    connection: Connection, stays_s: int
) -> None:
    """A line of 7.5 m/s keeps its UAVs within 140 m, and receives them 210 m off; it flies back at 9 m/s."""
    board = Board(LINE, lane_of(LINE, NOW_NS), connection=connection)
    tasks = bids_of(board, behind(LINE, 125), NOW_NS)
    assert not tasks.is_absent(NOW_NS)
    stayed_s = 0
    while tasks.survivor is not None and stayed_s < 60:
        stayed_s += 1
        if stayed_s == 10 and tasks.survivor is not None:
            assert tasks.is_absent(NOW_NS + 10 * S)
            goal, feed = board.goal.at(1, NOW_NS + 10 * S)
            assert goal.north < lane_of(LINE, NOW_NS + 10 * S).north - 140, "off its leash"
            assert feed == Enu(0, 0, 0)
        board.tasks.choose(NOW_NS + stayed_s * S)
    assert stayed_s == pytest.approx(stays_s, abs=2)


def test_a_uav_of_a_line_turns_back_for_a_survivor_where_no_connection_is_asked() -> None:
    for connection, goes in (("always", False), (30, False), ("none", True)):
        board = Board(LINE, lane_of(LINE, NOW_NS), connection=connection)  # type: ignore[arg-type]
        assert (bids_of(board, behind(LINE, 300), NOW_NS).survivor == 1) == goes


def test_however_few_seconds_a_uav_may_be_out_of_reach_that_is_a_permission() -> None:
    board = Board(LINE, lane_of(LINE, NOW_NS))
    for connection, permitted in (("always", False), (0.5, True), (30, True), ("none", True)):
        assert Absence(board.place, connection, speed_m_s=10.0).is_permitted == permitted  # type: ignore[arg-type]


@pytest.mark.parametrize("connection", ["always", 30, "none"])
def test_who_goes_to_nobody_is_not_absent_wherever_it_is(connection: Connection) -> None:
    board = Board(LINE, behind(LINE, 400), connection=connection)
    assert board.tasks.survivor is None
    assert not board.tasks.is_absent(NOW_NS)


def test_who_may_not_be_absent_never_is_even_out_of_bounds() -> None:
    board = Board(LINE, lane_of(LINE, NOW_NS), connection="always")
    tasks = bids_of(board, behind(LINE, 60), NOW_NS)
    assert tasks.survivor == 1
    assert not tasks.is_absent(NOW_NS + 60 * S), "the line is 450 m farther, and it has not yet reconsidered"


def test_whom_the_line_will_pass_nobody_leaves_it_for() -> None:
    board = Board(LINE, lane_of(LINE, NOW_NS), connection="none")
    tasks = bids_of(board, behind(LINE, -300), NOW_NS)
    assert not tasks.is_absent(NOW_NS)


def test_only_the_nearest_leaves_the_formation_once_the_place_is_known() -> None:
    board = Board(LINE, lane_of(LINE, NOW_NS), connection="none")
    board.hear(1, behind(LINE, 200), range(1, 5), now_ns=NOW_NS)
    other = Board(FOLLOWER, behind(LINE, 180)._replace(up=UP_M), connection="none")
    other.hear(1, behind(LINE, 200), range(1, 5), now_ns=NOW_NS)
    other.tasks.bid(NOW_NS)
    board.tasks.merge(other.tasks.bids_to_tell(now_ns=NOW_NS), now_ns=NOW_NS)
    board.tasks.bid(NOW_NS)
    board.tasks.choose(NOW_NS)
    assert board.tasks.survivor is None


def test_before_the_sweep_a_uav_may_be_as_late_at_its_place_as_the_scenario_says() -> None:
    now_ns = TAKEN_UP_NS - 20 * S
    first = lane_of(LINE, TAKEN_UP_NS)
    board = Board(LINE, first)
    absence = Absence(board.place, 30, speed_m_s=10.0)
    for metres, may in ((400, True), (460, False)):  # 20 s are left, and 30 s; it flies at 9 m/s
        place = Estimate(first.east, first.north - metres, 1.0, 0.0, 1.0)
        assert absence.permits(place, now_ns) == may
        assert absence.late_s(place.at, now_ns, after_s=0.0) == pytest.approx(metres / 9 - 20)
    assert Absence(Board(FOLLOWER, first).place, 30, speed_m_s=10.0).late_s(place.at, now_ns, after_s=0.0) == 0.0


def test_a_follower_is_waited_for_where_nobody_may_be_out_of_reach() -> None:
    now_ns, first = TAKEN_UP_NS - 20 * S, lane_of(FOLLOWER, TAKEN_UP_NS)
    far = Enu(first.east, first.north - 270, 0.0)  # 30 s at 9 m/s
    for connection, late_s in (("always", 10), (30, 0), ("none", 0)):
        absence = Absence(Board(FOLLOWER, first).place, connection, speed_m_s=10.0)  # type: ignore[arg-type]
        assert absence.late_s(far, now_ns, after_s=0.0) == pytest.approx(late_s), connection


def test_a_line_can_do_without_as_many_as_its_others_can_close_up_for_and_a_late_chain_without_nobody() -> None:
    late_ns = TAKEN_UP_NS + 160 * S
    for lost, spared in ((0, True), (2, True), (3, False)):  # 14 hops of 169 m may become 11 of 215 m
        board = Board(LINE, lane_of(LINE, late_ns))
        board.place.close_ranks(set(range(6, 6 + lost)), late_ns)
        assert board.place.can_be_spared(late_ns) == spared, lost
    relay = NodeId(PLAN.nodes[2 * PLAN.lanes + 1])
    assert not Board(relay, lane_of(relay, late_ns)).place.can_be_spared(late_ns)
    assert not Board(LINE, lane_of(LINE, late_ns)).place.can_be_spared(TAKEN_UP_NS - 1), "nobody sweeps yet"
