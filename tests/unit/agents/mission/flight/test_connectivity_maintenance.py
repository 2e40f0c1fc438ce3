"""A UAV stays within radio reach of those it is tied to."""

import pytest
from search_board import COUNT, FOLLOWER, LINE, REACH_M, TAKEN_UP_NS, UP_M, Board, lane_of

from agents.mission.flight.connectivity_maintenance import ConnectivityMaintenance, tether_plane
from agents.mission.navigation.half_planes import nearest
from fanet_mw.motion import Motion
from fanet_mw.units import STILL, Enu, NodeId, S
from fanet_mw.wire.search_messages import WITHDRAWN, Bid


def test_who_is_tied_does_not_fly_out_of_reach() -> None:
    east, other = 0.0, Enu(-100, 0, 0)
    for _ in range(400):
        plane = tether_plane(Enu(other.east - east, 0, 0), (0.0, 0.0), tether_m=237, within_s=4)
        velocity = nearest((9.0, 0.0), [] if plane is None else [plane], limit=10, hard=0)
        east += 0.1 * velocity[0]
    assert 130 < east <= 137.5


def test_a_uav_of_a_line_is_tied_to_those_beside_it_and_a_follower_to_the_nearest_of_its_line() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    for node, ties in ((LINE, 2), (FOLLOWER, 1)):
        board = Board(node, lane_of(node, now_ns))
        for other in range(1, COUNT + 1):
            if other != node:
                board.neighbors.on_hello(other, Motion(lane_of(other, now_ns), Enu(0, 0, 0), now_ns))
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        assert len(tied.planes(now_ns)) == ties


def test_who_waits_for_a_plan_stays_within_reach_of_the_two_nearest() -> None:
    now_ns = 20 * S
    board = Board(LINE, Enu(0.0, 0.0, 65.0), plan=None)
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert tied.planes(now_ns) == []
    for other, east in ((1, 230.0), (2, -200.0), (3, 240.0)):
        board.neighbors.on_hello(other, Motion(Enu(east, 0.0, 65.0), Enu(0, 0, 0), now_ns))
    assert sorted(plane.east for plane in tied.planes(now_ns)) == [-1.0, 1.0]
    assert not board.place.is_taken_up(now_ns)


@pytest.mark.parametrize(
    ("now_ns", "tied_to_follower"), [(30 * S, True), (TAKEN_UP_NS + 10 * S, True), (TAKEN_UP_NS + 30 * S, False)]
)
def test_until_all_are_at_their_places_a_uav_keeps_every_link_that_lasts(now_ns: int, tied_to_follower: bool) -> None:
    """The follower's place is in reach of the UAV's, and that of the other line's end is not; one beside it is, too."""
    here = lane_of(LINE, now_ns)
    near, far = Motion(here.minus(Enu(120.0, 0, 0)), STILL, now_ns), Motion(here.minus(Enu(0, 150.0, 0)), STILL, now_ns)
    follower = next(
        node
        for node in range(41, COUNT + 1)
        if lane_of(node, TAKEN_UP_NS).minus(lane_of(LINE, TAKEN_UP_NS)).norm() < 200
    )
    board = Board(LINE, here)
    board.neighbors.on_hello(follower, near)
    board.neighbors.on_hello(30, far)
    board.neighbors.on_hello(LINE + 1, Motion(here.minus(Enu(-170.0, 0, 0)), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    ties = sorted(plane.east for plane in tied.planes(now_ns))
    assert ties == ([-1.0, 1.0] if tied_to_follower else [1.0])


@pytest.mark.parametrize(
    ("swept_s", "said_to_be_m", "stays"),
    [(10, 300.0, True), (10, None, False), (10, 90.0, False), (30, 300.0, False)],
    ids=["late", "never heard of", "nearer to this UAV than to the other one", "all have settled"],
)
def test_who_does_not_hear_one_beside_it_that_comes_late_stays_with_the_neighbor_nearest_to_that(
    swept_s: int, said_to_be_m: float | None, *, stays: bool
) -> None:
    """A row that flew away without it came apart from the others (hills, seed 5, 71 s)."""
    now_ns = TAKEN_UP_NS + swept_s * S
    here = lane_of(LINE, now_ns)
    board = Board(LINE, here)
    board.neighbors.on_hello(LINE - 1, Motion(here.minus(Enu(150.0, 0, 0)), STILL, now_ns))
    board.neighbors.on_hello(30, Motion(here.minus(Enu(0, 200.0, 0)), STILL, now_ns))  # of the other line
    if said_to_be_m is not None:
        board.place.see(LINE + 1, here.minus(Enu(0, said_to_be_m, 0)), now_ns)
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert ((0.0, -1.0) in [(plane.east, plane.north) for plane in tied.planes(now_ns)]) is stays


@pytest.mark.parametrize(("aside_m", "ties"), [(100.0, 1), (163.0, 2)])
def test_on_the_way_a_uav_needs_no_tie_to_whom_a_third_one_has_strong_links(aside_m: float, ties: int) -> None:
    """The places of all three are near each other; two UAVs are 200 m apart, and the third 141 or 191 m from both."""
    now_ns, (node, far, third) = 30 * S, (NodeId(34), NodeId(35), NodeId(36))
    places = [lane_of(one, TAKEN_UP_NS) for one in (node, far, third)]
    assert max(a.minus(b).horizontal() for a in places for b in places) < 0.75 * REACH_M
    board = Board(node, Enu(0, 0, UP_M))
    board.neighbors.on_hello(far, Motion(Enu(-200, 0, UP_M), STILL, now_ns))
    board.neighbors.on_hello(third, Motion(Enu(-100, aside_m, UP_M), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert len(tied.planes(now_ns)) == ties


@pytest.mark.parametrize("apart_m", [230.0, 244.0, 252.0])
def test_on_the_way_a_link_that_was_stretched_is_drawn_in_again_and_not_given_up(apart_m: float) -> None:
    """One of two whose places are near each other has gone aside: as long as the other one is known, both come back."""
    now_ns = 30 * S
    board = Board(LINE, Enu(0, 0, UP_M))
    board.neighbors.on_hello(LINE + 1, Motion(Enu(apart_m, 0, UP_M), STILL, now_ns))
    board.neighbors.on_hello(30, Motion(Enu(0, -150.0, UP_M), STILL, now_ns))  # of the other line
    board.neighbors.on_hello(LINE - 1, Motion(Enu(-150.0, 0, UP_M), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert sorted(plane.east for plane in tied.planes(now_ns)) == [-1.0, 1.0]


@pytest.mark.parametrize(("goes", "stays"), [(LINE - 1, LINE + 1), (LINE + 1, LINE - 1)])
def test_who_goes_away_does_not_draw_a_uav_off_one_that_stays_and_is_farther_away(goes: int, stays: int) -> None:
    """A relay that went for somebody drew the next one along until the chain broke (rescue, seed 95, 180 s)."""
    now_ns = TAKEN_UP_NS + 40 * S
    board = Board(LINE, lane_of(LINE, now_ns))
    at, side = board.own_motion.position, goes - LINE
    board.neighbors.on_hello(goes, Motion(at.plus(Enu(233.0 * side, 0, 0)), Enu(4.0 * side, 0, 0), now_ns))
    board.neighbors.on_hello(stays, Motion(at.plus(Enu(-240.0 * side, 0, 0)), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    east, _ = nearest((0.0, 0.0), tied.planes(now_ns), limit=10, hard=0)
    assert east * side < 0
    assert tied.held(Enu(east, 0, 0)) == [stays]


def test_who_hears_nobody_to_whom_it_is_tied_stays_with_the_nearest() -> None:
    now_ns = TAKEN_UP_NS + 40 * S
    here = lane_of(LINE, now_ns)
    board = Board(LINE, here)
    board.neighbors.on_hello(30, Motion(here.minus(Enu(0, 150.0, 0)), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert [plane.north for plane in tied.planes(now_ns)] == [-1.0]
    board.neighbors.on_hello(LINE + 1, Motion(here.minus(Enu(-170.0, 0, 0)), STILL, now_ns))
    assert [plane.east for plane in tied.planes(now_ns)] == [1.0]


def test_a_follower_that_hears_none_of_its_team_stays_with_whom_it_hears() -> None:
    now_ns = TAKEN_UP_NS + 40 * S
    here = lane_of(FOLLOWER, now_ns)
    board = Board(FOLLOWER, here)
    board.neighbors.on_hello(35, Motion(here.minus(Enu(0, 200.0, 0)), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert [plane.north for plane in tied.planes(now_ns)] == [-1.0]


@pytest.mark.parametrize(("now_ns", "drawn"), [(30 * S, True), (TAKEN_UP_NS + S, False)])
def test_before_the_sweep_a_uav_without_a_task_follows_a_neighbor_who_responds(now_ns: int, drawn: bool) -> None:
    node, responder = NodeId(34), NodeId(35)
    at = lane_of(node, now_ns)
    board = Board(node, at)
    board.hear(1, at.plus(Enu(60, 0, -at.up)), range(35, 37), now_ns=now_ns)
    board.neighbors.on_hello(responder, Motion(at.plus(Enu(215, 0, 0)), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )

    def flies_m_s() -> float:
        return nearest((-9.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0]

    alone_m_s = flies_m_s()
    assert alone_m_s < 0, "a little of the link is left"
    board.tasks.merge([Bid(1, responder, 900, serial=1)], now_ns=now_ns)
    assert (flies_m_s() > 8) == drawn
    board.tasks.bid(now_ns)
    board.tasks.choose(now_ns)
    assert board.tasks.is_first(now_ns), "it arrives sooner"
    assert flies_m_s() == pytest.approx(alone_m_s), "who responds itself before others does not"


@pytest.mark.parametrize(
    ("apart_m", "responder_m", "flies"),
    [
        (215.0, 400.0, True),
        (215.0, -400.0, False),
        (205.0, 400.0, False),
        (215.0, 700.0, False),
        (235.0, 900.0, True),
        (235.0, 1100.0, False),
    ],
    ids=["drawn along", "to the other side", "near enough", "far away: a little", "farther: less", "too far away"],
)
def test_before_the_sweep_a_row_gives_way_to_a_responder_at_its_end(
    apart_m: float, responder_m: float, *, flies: bool
) -> None:
    """Those beside a responder were held by those behind them: it hovered 70 m beside somebody (rescue, seed 4)."""
    node, beside, responder, now_ns = NodeId(34), NodeId(35), NodeId(36), 30 * S
    board = Board(node, Enu(0, 0, UP_M))
    board.hear(1, Enu(responder_m, 0, 0), range(36, 38), now_ns=now_ns)
    board.neighbors.on_hello(beside, Motion(Enu(apart_m, 0, UP_M), STILL, now_ns))
    board.place.see(responder, Enu(responder_m, 0, UP_M), now_ns)
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    assert nearest((0.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0] == 0, "nobody responds"
    board.tasks.merge([Bid(1, responder, 900, serial=1)], now_ns=now_ns)
    assert (nearest((0.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0] > 0) is flies


def test_before_the_sweep_who_comes_second_for_somebody_does_not_hold_back_who_is_first_for_another() -> None:
    node, first, now_ns = NodeId(34), NodeId(35), 30 * S
    board = Board(node, Enu(0, 0, UP_M))
    for survivor in (1, 2):
        board.hear(survivor, Enu(600 * survivor - 900, 0, 0), range(35, 38), now_ns=now_ns)
    board.neighbors.on_hello(first, Motion(Enu(215, 0, UP_M), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    board.tasks.survivor = 1

    def flies_m_s() -> float:
        return nearest((-9.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0]

    board.tasks.merge([Bid(1, 36, 50, serial=1)], now_ns=now_ns)
    alone_m_s = flies_m_s()
    board.tasks.merge([Bid(2, 37, 50, serial=1), Bid(2, first, 90, serial=1)], now_ns=now_ns)
    assert flies_m_s() == pytest.approx(alone_m_s), "the other one comes second as well"
    board.tasks.merge([Bid(2, 37, WITHDRAWN, serial=2)], now_ns=now_ns)
    assert flies_m_s() > 8


def test_before_the_sweep_who_is_first_at_somebody_gives_way_to_nobody() -> None:
    node, beside, now_ns = NodeId(34), NodeId(35), 30 * S
    board = Board(node, Enu(0, 0, UP_M))
    for survivor in (1, 2):
        board.hear(survivor, Enu(600 * survivor - 900, 0, 0), range(35, 38), now_ns=now_ns)
    board.neighbors.on_hello(beside, Motion(Enu(215, 0, UP_M), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    board.tasks.survivor = 1
    board.tasks._auction.bid(1, eta_s=9.0, now_ns=now_ns)
    board.tasks.merge([Bid(1, 36, 50, serial=1), Bid(2, beside, 50, serial=1)], now_ns=now_ns)
    assert nearest((-9.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0] > 8, "another one is there sooner"
    board.tasks.merge([Bid(1, 36, WITHDRAWN, serial=2)], now_ns=now_ns)
    assert nearest((-9.0, 0.0), tied.planes(now_ns), limit=10, hard=0)[0] < 0


def test_who_closes_ranks_over_a_lost_uav_may_use_up_a_little_more_of_its_reach_in_half_of_the_time() -> None:
    now_ns = TAKEN_UP_NS + 20 * S
    board = Board(LINE, lane_of(LINE, now_ns))
    for other in range(1, COUNT + 1):
        if other != LINE:
            board.neighbors.on_hello(other, Motion(lane_of(other, now_ns), Enu(0, 0, 0), now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    before = {(plane.east, plane.north): plane.least for plane in tied.planes(now_ns)}
    board.place.close_ranks({FOLLOWER}, now_ns)
    assert {(plane.east, plane.north): plane.least for plane in tied.planes(now_ns)} == before, "of another row"
    board.place.close_ranks({LINE + 7}, now_ns)
    after = {(plane.east, plane.north): plane.least for plane in tied.planes(now_ns)}
    for way, least in before.items():
        assert after[way] == pytest.approx(2 * least - 0.02 * REACH_M / 2)


def test_who_is_too_far_away_is_approached_as_fast_as_a_uav_flies() -> None:
    plane = tether_plane(Enu(339, 0, 0), (0.0, 7.5), tether_m=237, within_s=2, haste_m_s=9.0)
    assert plane is not None
    assert nearest((0.0, 7.5), [plane], limit=10, hard=0)[0] == pytest.approx(9.0)


def test_the_two_beside_a_gap_fly_to_where_the_other_one_was_until_they_would_hear_it_there() -> None:
    for node, way in ((LINE, 1), (NodeId(LINE + 2), -1)):
        behind, beyond = NodeId(node - way), []
        board = Board(node, lane_of(node, TAKEN_UP_NS))
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        for since_s in (0, 8, 12):
            now_ns = TAKEN_UP_NS + (60 + since_s) * S
            board.own_motion.position = lane_of(node, now_ns).minus(Enu(-9.0 * since_s * way, 0, 0))
            board.neighbors.on_hello(behind, Motion(lane_of(behind, now_ns), Enu(0, 7.5, 0), now_ns))
            assert since_s or tied.beyond_gap(now_ns) is None, "nobody is lost"
            if not since_s:
                board.place.close_ranks({LINE + 1}, now_ns)
            mate = tied.beyond_gap(now_ns)
            beyond.append(None if mate is None else mate.position)
        there = NodeId(node + 2 * way)
        assert beyond == [lane_of(there, TAKEN_UP_NS + 60 * S), lane_of(there, TAKEN_UP_NS + 68 * S), None]


def test_before_the_sweep_the_two_beside_a_gap_fly_to_where_the_other_one_is_likely_to_be() -> None:
    """Its place has changed since it was heard last, and it may be late: who is out of reach there is not lost."""
    now_ns, seen_ns, beyond = 35 * S, 33 * S, NodeId(LINE + 2)
    for apart_m, meets in ((300.0, True), (180.0, False)):
        board = Board(LINE, Enu(0, 0, UP_M))
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        board.place.see(beyond, Enu(apart_m, 0, UP_M), seen_ns)
        assert tied.beyond_gap(now_ns) is None, "nobody is lost"
        board.place.close_ranks({LINE + 1}, now_ns)
        assert board.place.pattern is not None
        goal, left_s = board.place.pattern.at(beyond - 1, 0.0), (TAKEN_UP_NS - seen_ns) / S
        mate = tied.beyond_gap(now_ns)
        assert (mate is not None) is meets
        if mate is not None:
            assert mate.position.east == pytest.approx(apart_m + 2.0 * (goal.east - apart_m) / left_s)
            assert mate.velocity.east == pytest.approx((goal.east - apart_m) / left_s)
        assert tied.missed(now_ns + 8 * S) is None
        board.neighbors.on_hello(beyond, Motion(Enu(300.0, 0, UP_M), STILL, now_ns))
        assert tied.beyond_gap(now_ns) is None, "it is heard"


@pytest.mark.parametrize(
    ("parted", "east_m", "nearer", "lost", "sought"),
    [
        (LINE + 1, 300.0, None, 29, True),
        (LINE + 1, 200.0, None, 29, True),  # it is not heard there: it may be late
        (LINE + 1, 170.0, None, 29, False),
        (LINE + 3, 300.0, None, 29, False),  # the places are out of reach of each other: the link would not last
        (LINE + 1, 300.0, LINE + 2, 29, False),  # a neighbor is nearer to it
        (LINE + 1, 300.0, LINE + 4, 29, True),  # whose place is out of its reach
        (LINE + 1, 300.0, LINE + 2, LINE + 2, True),  # which is lost
    ],
)
def test_on_the_way_whoever_is_nearest_to_another_part_flies_to_meet_it(
    parted: int, east_m: float, nearer: int | None, lost: int, sought: bool
) -> None:
    now_ns, here = 35 * S, Enu(0, 0, UP_M)
    board = Board(LINE, here)
    there = here._replace(east=east_m)
    board.place.see(parted, there, now_ns)
    board.place.close_ranks({lost}, now_ns, parted={parted})
    if nearer is not None:
        board.neighbors.on_hello(nearer, Motion(Enu(100.0, 0, UP_M), STILL, now_ns))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    motion = tied.beyond_gap(now_ns)
    assert (motion is not None and motion.position == there) is sought
    for apart_m in (240.0, 244.0) if sought else ():
        board.neighbors.on_hello(parted, Motion(here._replace(east=apart_m), STILL, now_ns))
        assert (tied.beyond_gap(now_ns) is not None) is (apart_m > 0.97 * REACH_M), "it is heard"
    assert tied.missed(now_ns) is None


def test_who_hears_one_of_another_part_keeps_in_reach_of_it_and_of_several_of_the_nearest() -> None:
    now_ns = TAKEN_UP_NS + 40 * S
    here = lane_of(LINE, now_ns)
    for parted, ways in ((set[int](), [(1, 0)]), ({30, 31}, [(1, 0), (0, -1)]), ({31}, [(1, 0), (-1, 0)])):
        board = Board(LINE, here)
        for node, off in (
            (LINE + 1, Enu(-170, 0, 0)),
            (30, Enu(0, 150, 0)),
            (31, Enu(200, 0, 0)),
            (32, Enu(0, -260, 0)),
        ):
            board.neighbors.on_hello(node, Motion(here.minus(off), STILL, now_ns))
        board.place.close_ranks({29}, now_ns, parted=parted)
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        assert sorted((plane.east, plane.north) for plane in tied.planes(now_ns)) == sorted(ways)
    board.place.close_ranks({29}, now_ns, parted={32})
    assert {(plane.east, plane.north) for plane in tied.planes(now_ns)} == {(1, 0)}, "out of reach"


def test_who_does_not_come_to_meet_this_uav_over_a_gap_is_lost_as_well() -> None:
    missed = []
    board = Board(LINE, lane_of(LINE, TAKEN_UP_NS))
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    board.place.close_ranks({LINE + 1}, TAKEN_UP_NS + 60 * S)
    for since_s in range(12):
        now_ns = TAKEN_UP_NS + (60 + since_s) * S
        board.neighbors.on_hello(LINE - 1, Motion(lane_of(NodeId(LINE - 1), now_ns), Enu(0, 7.5, 0), now_ns))
        board.own_motion.position = lane_of(LINE, now_ns).minus(Enu(-9.0 * max(0, since_s - 2), 0, 0))
        missed.append(tied.missed(now_ns))
        if since_s == 10:
            there = board.own_motion.position.minus(Enu(-0.9 * REACH_M, 0, 0))
            board.neighbors.on_hello(LINE + 2, Motion(there, Enu(0, 7.5, 0), now_ns))
    assert missed[:8] == [None] * 8, "it has noticed the loss after 2 s, and flies at 8.6 m/s"
    assert missed[8:11] == [LINE + 2] * 3
    assert missed[11] is None, "it was only late"


def test_who_is_beyond_a_gap_is_sought_where_it_flew_after_earlier_losses() -> None:
    now_ns, beyond = TAKEN_UP_NS + 60 * S, NodeId(LINE + 2)
    at = {}
    for earlier in ([], [1, 2, 3]):
        board = Board(LINE, lane_of(LINE, now_ns))
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        board.place.close_ranks(earlier, now_ns - 20 * S)
        assert board.place.pattern is not None
        at[len(earlier)] = there = board.place.pattern.at(beyond - 1, 60.0)
        board.own_motion.position = board.place.lane(now_ns)[0]
        board.place.close_ranks([*earlier, LINE + 1], now_ns)
        mate = tied.beyond_gap(now_ns)
        assert mate is not None
        assert mate.position == there
    assert at[0] == lane_of(beyond, now_ns)
    assert at[3].minus(at[0]).norm() > 100


def test_who_flies_within_its_limits_keeps_those_to_whom_it_is_tied_and_are_in_reach() -> None:
    now_ns = TAKEN_UP_NS + 60 * S
    here = lane_of(LINE, now_ns)
    for apart_m, held in ((220.0, True), (245.0, False)):
        board = Board(LINE, here)
        tied = ConnectivityMaintenance(
            board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
        )
        board.neighbors.on_hello(NodeId(LINE + 1), Motion(here.minus(Enu(apart_m, 0, 0)), Enu(0, 7.5, 0), now_ns))
        (plane,) = tied.planes(now_ns)
        assert (tied.held(Enu(plane.east * plane.least, 7.5, 0.0)) == [LINE + 1]) is held
        assert tied.held(Enu(plane.east * (plane.least - 0.5), 7.5, 0.0)) == [], "a limit was dropped for another one"


def test_who_cannot_follow_as_close_as_a_gap_asks_stays_in_reach_all_the_same() -> None:
    now_ns = TAKEN_UP_NS + 60 * S
    here = lane_of(LINE, now_ns)
    board = Board(LINE, here)
    tied = ConnectivityMaintenance(
        board.own_motion, board.neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=10.0
    )
    board.place.close_ranks({LINE + 2}, now_ns, parted=range(LINE + 3, COUNT + 1))
    board.neighbors.on_hello(LINE - 1, Motion(here.minus(Enu(230, 0, 0)), STILL, now_ns))
    board.neighbors.on_hello(LINE + 1, Motion(here.minus(Enu(-235, 0, 0)), Enu(3, 0, 0), now_ns))  # leads to the gap
    planes = tied.planes(now_ns)
    assert max(plane.least for plane in planes) > 9, "nearer than 88 % of the reach: not without leaving the other one"
    velocity = nearest((-5.0, 0.0), planes, limit=10.0, hard=0)
    assert sorted(tied.held(Enu(*velocity, 0.0))) == [LINE - 1, LINE + 1]
