"""The parts of one UAV's search that act in time: its place, its tasks, what it announces, and how it steers."""

import math

import pytest

from agents.mission.finding.announcing import Announcing
from agents.mission.finding.finds import Finds
from agents.mission.finding.phone_filter import REFERENCE_LOSS_DB, Estimate, PhoneModel
from agents.mission.flight.goal import Goal
from agents.mission.flight.velocity_choice import ClearOfOthers, InReach, VelocityChoice
from agents.mission.formation.formation_place import FormationPlace
from agents.mission.formation.formation_planner import plan_of
from agents.mission.formation.pattern import fitted
from agents.mission.formation.shape import Demands
from agents.mission.navigation.half_planes import HalfPlane
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.navigation import Navigation
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.outbox import Outbox
from agents.mission.tasking.approach import Approach
from agents.mission.tasking.bidding import Bidding
from fanet_mw.motion import Motion
from fanet_mw.scenario import config
from fanet_mw.trace import Approaching, Arrived, Confirmed
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.inner import Survivor
from fanet_mw.wire.search import Bid, Found, Search, told_in

MODEL = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
REACH_M = 250.0
COUNT = 45
UP_M = 65.0
SCENARIO = config.build(
    {"nodes": {"count": COUNT}, "clusters": {"count": 1}, "mission": {"survivors": 3}, "world": {"area_m": 2500}}
)


def a_plan() -> Search:
    pattern = fitted(COUNT, Demands(area_m=2500, seen_m=131, reach_m=REACH_M, height_m=UP_M, speed_m_s=7.5))
    assert pattern is not None
    return plan_of(pattern, tuple(range(1, COUNT + 1)), planner=1, start_us=10_000_000, deploy_ds=500)


OPEN = KnownObstacles(NO_MAP)
PLAN = a_plan()
TAKEN_UP_NS = 60 * S
FOLLOWER, LINE = NodeId(COUNT), NodeId(5)


class Board:
    """The parts of one UAV, wired as in a search."""

    def __init__(self, node: NodeId, at: Enu, *, planned: bool = True) -> None:
        self.out = Outbox()
        self.finds = Finds(MODEL)
        self.navigation, self.neighbors = Navigation(at, OPEN), NeighborMotions()
        self.place = FormationPlace(node, self.navigation, reach_m=REACH_M)
        if planned:
            self.place.adopt(PLAN, 0)
        self.approach = Approach(node, self.finds, self.navigation, self.out, arrival_m=30)
        self.tasks = Bidding(
            SCENARIO, node, finds=self.finds, navigation=self.navigation, formation=self.place,
            approach=self.approach, outbox=self.out, speed_m_s=10.0,
        )  # fmt: skip
        self.goal = Goal(self.finds, self.navigation, self.place, self.approach, None)
        self.announcing = Announcing(node, self.finds, self.out)

    def hear(self, survivor: int, truth: Enu, reporters: range, *, now_ns: int) -> None:
        """Each of these nodes reports a phone from three places on two sides of it."""
        for node in reporters:
            for step in (-60, 0, 60):
                at = Enu(truth.east + (40 if node % 2 else -60), truth.north + step + node, UP_M)
                rssi_dbm = MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(truth).norm())
                report = Survivor(now_ns // US, survivor, node, at, rssi_dbm)
                self.finds.report(report, now_ns=now_ns)


def lane_of(node: int, at_ns: int) -> Enu:
    place = FormationPlace(NodeId(node), Navigation(Enu(0, 0, UP_M), OPEN), reach_m=REACH_M)
    place.adopt(PLAN, 0)
    return place.lane(at_ns)[0]


# --- the place in the formation -----------------------------------------------------------------------------------


def test_who_has_no_plan_waits_where_it_is_and_may_go_nowhere_for_the_swarm() -> None:
    board = Board(LINE, Enu(7, 8, UP_M), planned=False)
    assert board.place.lane(5 * S) == (Enu(7, 8, UP_M), Enu(0, 0, 0))
    board.hear(1, Enu(20, 20, 0), range(1, 5), now_ns=5 * S)
    board.tasks.bid(5 * S)
    assert board.tasks.told(now_ns=5 * S) == []


def test_a_place_is_taken_up_on_a_straight_way_that_begins_and_ends_with_the_plan() -> None:
    board = Board(LINE, Enu(0, -400, UP_M))
    end = board.place.lane(TAKEN_UP_NS)[0]
    assert board.place.lane(9 * S)[0] == Enu(0, -400, UP_M), "the plan begins after 10 s"
    half = board.place.lane(35 * S)[0]
    assert (half.east, half.north) == pytest.approx((end.east / 2, (end.north - 400) / 2))
    assert (board.place.is_taken_up(TAKEN_UP_NS - 1), board.place.is_taken_up(TAKEN_UP_NS)) == (False, True)


def test_a_uav_of_a_line_stays_near_its_lane_and_a_follower_goes_anywhere() -> None:
    lane, moves = Enu(0, 500, UP_M), Enu(0, 7.5, 0)
    line, follower = Board(LINE, lane).place, Board(FOLLOWER, lane).place
    assert follower.bounded(300, 100, lane, moves)[0] == Enu(300, 100, UP_M)
    assert line.bounded(300, 450, lane, moves)[0] == Enu(58, 450, UP_M), "aside by the leash"
    assert line.bounded(0, 100, lane, moves)[0] == Enu(0, 360, UP_M), "behind by the lag"
    assert line.bounded(20, 700, lane, moves) == (Enu(20, 500, UP_M), moves), "ahead: the line brings it there"


# --- tasks --------------------------------------------------------------------------------------------------------


def test_a_follower_bids_for_a_reported_survivor_near_its_line_wins_and_says_so() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + 60, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor == 1
    assert [type(record) for record in board.out.records] == [Approaching]
    board.tasks.close(1, now_ns=now_ns)
    assert board.tasks.survivor is None


def test_better_bids_take_a_task_away() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east + 60, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    board.tasks.merge([Bid(1, bidder, 1, 1) for bidder in (30, 31)], now_ns=now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor == 1, "three are wanted"
    board.tasks.merge([Bid(1, 32, 1, 1)], now_ns=now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.survivor is None


def test_one_who_has_not_reported_is_sent_where_reporters_are_too_few_and_one_who_has_is_not() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    for reporters, bids in ((range(1, 2), 1), (range(FOLLOWER, FOLLOWER + 1), 0)):
        board = Board(FOLLOWER, at)
        board.hear(1, Enu(at.east + 60, at.north + (80 if at.north > 0 else -80), 0), reporters, now_ns=now_ns)
        board.tasks.bid(now_ns + 3 * S)
        assert board.tasks.told(now_ns=now_ns) == [], "somebody may still come by"
        board.tasks.bid(now_ns + 5 * S)
        assert len(board.tasks.told(now_ns=now_ns + 5 * S)) == bids


def test_a_responder_that_finds_nobody_takes_its_bid_back_and_does_not_bid_again_at_once() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    at = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, at)
    board.hear(1, Enu(at.east, at.north, 0), range(1, 5), now_ns=now_ns)
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    board.goal.at(board.tasks.survivor, now_ns)
    assert [type(record) for record in board.out.records] == [Approaching, Arrived]
    later_ns = now_ns + 46 * S
    board.tasks.choose(later_ns)
    board.tasks.bid(later_ns)
    assert board.tasks.survivor is None
    assert [bid.eta_ds for bid in board.tasks.told(now_ns=later_ns)] == [0xFFFF]


def test_around_an_estimate_the_spiral_widens_until_somebody_is_seen() -> None:
    board = Board(FOLLOWER, Enu(0, 0, UP_M))
    board.hear(1, Enu(0, 0, 0), range(1, 5), now_ns=0)
    place = board.finds.known[1].place()
    assert place is not None

    def radius_m(second: int) -> float:
        east, north = board.approach.point(1, place, second * S, responding=True)
        return math.hypot(east - place.east_m, north - place.north_m)

    assert (round(radius_m(0)), round(radius_m(20)), round(radius_m(40))) == (14, 44, 74)
    board.finds.known[1].filter.sighted(Estimate(0, 0, 4, 0, 4))
    assert round(math.hypot(*board.approach.point(1, Estimate(0, 0, 4, 0, 4), 41 * S, responding=True))) == 40


# --- announcing ---------------------------------------------------------------------------------------------------


def confirmed(board: Board) -> list[Found]:
    """The confirmations that were flooded."""
    told = [message for packet in board.out.packets for message in told_in(bytes(36) + packet.frames)]
    return [message for message in told if isinstance(message, Found) and message.confirmed]


def seen() -> Board:
    board = Board(FOLLOWER, Enu(0, 0, UP_M))
    for node in range(1, 5):
        for east in (-60, 0, 60):
            at = Enu(east, 20.0 * node, UP_M)
            rssi_dbm = MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.norm())
            board.finds.report(Survivor(0, 1, node, at, rssi_dbm), now_ns=0)
    board.finds.known[1].filter.sighted(Estimate(1, 2, 4, 0, 4))
    return board


def test_a_confirmation_is_told_three_times_and_with_hellos_for_a_while() -> None:
    board = seen()
    board.announcing.confirm(1, 0)
    for second in range(30):
        board.announcing.tell(None, second * S)
    assert len(confirmed(board)) == 3
    assert [type(record) for record in board.out.records] == [Confirmed]
    assert len(told_in(bytes(36) + board.announcing.hello_frames(11 * S))) == 1
    assert board.announcing.hello_frames(13 * S) == b""


def test_who_still_reports_a_confirmed_survivor_is_told_by_one_in_four() -> None:
    board = seen()
    board.announcing.confirm(1, 0)
    report = Survivor(0, 1, 0, Enu(0, 0, UP_M), -70.0)
    for reporter in range(10, 14):
        board.announcing.reported(report._replace(reporter=reporter), reporter * 8 * S)
    assert len(confirmed(board)) == 1


# --- steering -----------------------------------------------------------------------------------------------------


class Wall:
    """Nobody flies east faster than this."""

    def __init__(self, most_m_s: float) -> None:
        self._most_m_s = most_m_s

    def planes(self, now_ns: int) -> list[HalfPlane]:
        return [HalfPlane(-1.0, 0.0, -self._most_m_s)]


def test_a_velocity_obeys_hard_constraints_and_gives_soft_ones_up() -> None:
    away = HalfPlane(1.0, 0.0, 5.0)

    class Tether:
        def planes(self, now_ns: int) -> list[HalfPlane]:
            return [away]

    steering = VelocityChoice(Navigation(Enu(0, 0, UP_M), OPEN), OPEN, most_m_s=10, hard=[Wall(2)], soft=[Tether()])
    flown = steering.velocity(Enu(1000, 0, UP_M), Enu(0, 0, 0), 0)
    assert flown.east == pytest.approx(2)


def test_neighbors_are_avoided_while_they_are_heard_at_their_level() -> None:
    navigation, neighbors = Navigation(Enu(0, 0, UP_M), OPEN), NeighborMotions()
    navigation.fix(Enu(0, 0, UP_M), Enu(5, 0, 0), now_ns=0)
    clear = ClearOfOthers(navigation, neighbors, OPEN)
    neighbors.on_hello(2, Motion(Enu(60, 0, UP_M), Enu(-5, 0, 0), 0))
    neighbors.on_hello(3, Motion(Enu(60, 0, UP_M + 12), Enu(0, 0, 0), 0))
    assert len(clear.planes(S)) == 1
    assert clear.planes(7 * S) == []


def test_a_uav_of_a_line_is_tied_to_those_beside_it_and_a_follower_to_the_nearest_of_its_line() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    for node, ties in ((LINE, 2), (FOLLOWER, 1)):
        board = Board(node, lane_of(node, now_ns))
        for other in range(1, COUNT + 1):
            if other != node:
                board.neighbors.on_hello(other, Motion(lane_of(other, now_ns), Enu(0, 0, 0), now_ns))
        tied = InReach(board.navigation, board.neighbors, board.place, reach_m=REACH_M)
        assert len(tied.planes(now_ns)) == ties
