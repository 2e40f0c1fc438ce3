"""The parts of the planned search, each by its law."""

import itertools
import math
from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from agents.mission.finding.finds import ground_place
from agents.mission.finding.phone_filter import REFERENCE_LOSS_DB, PhoneFilter, PhoneModel
from agents.mission.flight.constraints import avoiding, staying_near
from agents.mission.formation.formation_planner import FormationPlanner
from agents.mission.formation.pattern import Pattern, fitted
from agents.mission.formation.shape import Demands
from agents.mission.hungarian import assign
from agents.mission.navigation.half_planes import HalfPlane, nearest
from agents.mission.tasking.auction import Auction
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.search import WITHDRAWN, Bid, Search, SearchStatus

MODEL = PhoneModel(power_dbm=15, exponent=3, shadowing_db=4, offset_db=1, threshold_dbm=-90)
REACH_M = 250.0
DEMANDS = Demands(area_m=2500, seen_m=137, reach_m=REACH_M, height_m=50, speed_m_s=7.5)


def formation(count: int = 45) -> Pattern:
    made = fitted(count, DEMANDS)
    assert made is not None
    return made


# --- assignment ---------------------------------------------------------------------------------------------------


@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(st.lists(st.integers(0, 50), min_size=6, max_size=6), min_size=n, max_size=n)
    )
)
def test_no_other_assignment_costs_less(costs: list[list[int]]) -> None:
    chosen = assign(costs)
    assert len(set(chosen)) == len(costs)
    least = min(
        sum(row[column] for row, column in zip(costs, columns, strict=True))
        for columns in itertools.permutations(range(6), len(costs))
    )
    assert sum(row[column] for row, column in zip(costs, chosen, strict=True)) == least


# --- the formation ------------------------------------------------------------------------------------------------


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
            for other in pattern.shape.tethers(place):
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
    assert fitted(20, DEMANDS) is None


# --- the plan -----------------------------------------------------------------------------------------------------


def planner_with(nodes: int, *, node: int = 1) -> FormationPlanner:
    made = FormationPlanner(NodeId(node), expected=nodes, deploy_speed_m_s=9)
    for other in range(1, nodes + 1):
        place = Enu(200.0 * ((other - 1) % 9 - 4), 200.0 * ((other - 1) // 9 - 2), 50)
        made.status(SearchStatus(0, place, other, 0, 100), now_ns=0)
    return made


def test_a_plan_gives_everyone_a_place_and_the_swarm_stays_in_one_piece_on_the_way() -> None:
    planner, pattern = planner_with(45), formation()
    assert planner.review(pattern, now_ns=S)
    plan = planner.plan
    assert plan is not None
    assert sorted(plan.nodes) == list(range(1, 46))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        places = []
        for place, node in enumerate(plan.nodes):
            start = Enu(200.0 * ((node - 1) % 9 - 4), 200.0 * ((node - 1) // 9 - 2), 50)
            way = pattern.at(place, 0.0).minus(start)
            places.append(Enu(start.east + share * way.east, start.north + share * way.north, 50))
        assert is_one(places), share


def test_the_place_of_a_lost_uav_in_a_line_goes_to_a_follower() -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    before = planner.plan
    assert before is not None
    lost, later_ns = before.nodes[3], 90 * S
    for node in range(1, 46):
        if node != lost:
            planner.status(SearchStatus(later_ns // US, Enu(0, 0, 50), node, 1, 100), now_ns=later_ns)
    assert planner.review(pattern, now_ns=later_ns)
    after = planner.plan
    assert after is not None
    assert lost not in after.nodes
    assert after.revision == before.revision + 1
    assert after.nodes[3] in before.nodes[pattern.followers.start :]


def test_only_the_lowest_id_that_is_alive_plans() -> None:
    assert not planner_with(45, node=2).review(formation(), now_ns=S)


def test_who_flies_home_holds_no_place_any_more_from_when_it_says_so() -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    before = planner.plan
    assert before is not None
    leaver, later_ns = before.nodes[3], 20 * S
    planner.status(SearchStatus(later_ns // US, Enu(0, 0, 50), leaver, 1, 0), now_ns=later_ns)
    planner.alive(leaver, Enu(0, 0, 50), now_ns=later_ns)  # its hellos are heard still
    assert planner.review(pattern, now_ns=later_ns)
    after = planner.plan
    assert after is not None
    assert leaver not in after.nodes
    assert after.nodes[3] in before.nodes[pattern.followers.start :]


def test_a_planner_that_flies_home_leaves_planning_to_the_next() -> None:
    first, second = planner_with(45, node=1), planner_with(45, node=2)
    gone = SearchStatus(S // US, Enu(0, 0, 50), 1, 0, 0)
    for planner in (first, second):
        planner.status(gone, now_ns=S)
    assert not first.review(formation(), now_ns=S)
    assert second.review(formation(), now_ns=S)
    assert second.plan is not None
    assert 1 not in second.plan.nodes


def test_the_smaller_part_of_a_swarm_that_came_apart_makes_no_plan_of_its_own() -> None:
    planner, pattern = planner_with(45), formation()
    planner.review(pattern, now_ns=S)
    later_ns = 90 * S
    for node in range(1, 20):
        planner.status(SearchStatus(later_ns // US, Enu(0, 0, 50), node, 1, 100), now_ns=later_ns)
    assert not planner.review(pattern, now_ns=later_ns)


def test_of_two_plans_the_newer_one_counts_and_of_equal_ones_that_of_the_lower_id() -> None:
    listener = FormationPlanner(NodeId(9), expected=9, deploy_speed_m_s=9)

    def plan(revision: int, planner: int) -> Search:
        return Search(1, 100.0, 10.0, 50.0, 50.0, 7.5, 10, revision, planner, (1, 2, 3, 4), 2, 0, 0)

    assert [listener.planned(plan(*which)) for which in ((1, 4), (1, 5), (1, 3), (2, 8), (1, 1), (2, 8))] == [
        True, False, True, True, False, False,
    ]  # fmt: skip


# --- the auction --------------------------------------------------------------------------------------------------

bids = st.lists(
    st.builds(Bid, st.just(1), st.integers(2, 9), st.integers(0, 500) | st.just(WITHDRAWN), st.integers(0, 4)),
    max_size=12, unique_by=lambda bid: (bid.bidder, bid.serial),
)  # fmt: skip


@given(bids, st.randoms(use_true_random=False))
def test_who_has_heard_the_same_bids_in_any_order_names_the_same_winners(heard: list[Bid], random: object) -> None:
    first, second = Auction(NodeId(1)), Auction(NodeId(1))
    first.merge(heard, now_ns=S)
    for bid in sorted(heard, key=lambda _: random.random()):  # type: ignore[attr-defined]
        second.merge([bid], now_ns=S)
    assert first.winners(1, count=3, now_ns=S) == second.winners(1, count=3, now_ns=S)


def test_exactly_as_many_win_as_the_task_needs_and_ties_go_to_the_lower_id() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 9, 40, 1), Bid(1, 2, 40, 1), Bid(1, 3, 10, 1)], now_ns=0)
    auction.bid(1, eta_s=4.0, now_ns=0)
    assert auction.winners(1, count=3, now_ns=0) == [3, 2, 5]
    assert not auction.would_win(1, eta_s=9.0, count=2, now_ns=0)


def test_a_winner_that_falls_silent_makes_room_for_the_next() -> None:
    auction = Auction(NodeId(5))
    auction.merge([Bid(1, 2, 10, 1), Bid(1, 3, 20, 1)], now_ns=0)
    auction.merge([Bid(1, 3, 20, 1)], now_ns=12 * S)
    assert auction.winners(1, count=1, now_ns=12 * S) == [2]
    assert auction.winners(1, count=1, now_ns=20 * S) == [3]


def test_a_bid_that_is_taken_back_no_longer_wins() -> None:
    auction = Auction(NodeId(5))
    auction.bid(1, eta_s=1.0, now_ns=0)
    auction.withdraw(1, now_ns=0)
    assert auction.winners(1, count=1, now_ns=0) == []
    assert [bid.eta_ds for bid in auction.told([1], now_ns=0)] == [WITHDRAWN]


# --- velocities ---------------------------------------------------------------------------------------------------

speeds = st.tuples(st.floats(-10, 10), st.floats(-10, 10))
planes = st.lists(
    st.builds(
        lambda angle, least: HalfPlane(math.cos(angle), math.sin(angle), least), st.floats(0, 6.28), st.floats(-9, 0)
    ),
    max_size=6,
)


@given(speeds, planes)
def test_a_velocity_that_obeys_every_constraint_is_found_where_standing_still_obeys_them(
    wanted: tuple[float, float], constraints: list[HalfPlane]
) -> None:
    east, north = nearest(wanted, constraints, limit=10, hard=len(constraints))
    assert math.hypot(east, north) <= 10 + 1e-6
    assert all(east * plane.east + north * plane.north >= plane.least - 1e-6 for plane in constraints)


@settings(max_examples=30)
@given(st.floats(-30, 30), st.floats(0, 6.28), st.floats(4, 10))
def test_two_that_both_avoid_never_come_nearer_than_the_clearance(aside_m: float, angle: float, speed: float) -> None:
    at = [
        [0.0, 0.0],
        [150 * math.cos(angle) - aside_m * math.sin(angle), 150 * math.sin(angle) + aside_m * math.cos(angle)],
    ]
    wanted = [(speed * math.cos(angle), speed * math.sin(angle)), (-speed * math.cos(angle), -speed * math.sin(angle))]
    flown = list(wanted)
    for _ in range(250):
        fresh = []
        for own, other in ((0, 1), (1, 0)):
            offset = Enu(at[other][0] - at[own][0], at[other][1] - at[own][1], 0)
            plane = avoiding(offset, flown[own], flown[other], clearance_m=10, horizon_s=6, share=0.5)
            fresh.append(nearest(wanted[own], [plane], limit=10, hard=1))
        flown = fresh
        for own in (0, 1):
            at[own][0] += 0.1 * flown[own][0]
            at[own][1] += 0.1 * flown[own][1]
        assert math.dist(*at) >= 9.5


def test_who_is_tied_does_not_fly_out_of_reach() -> None:
    east, other = 0.0, Enu(-100, 0, 0)
    for _ in range(400):
        plane = staying_near(Enu(other.east - east, 0, 0), (0.0, 0.0), tether_m=237, within_s=4)
        velocity = nearest((9.0, 0.0), [] if plane is None else [plane], limit=10, hard=0)
        east += 0.1 * velocity[0]
    assert 130 < east <= 137.5


# --- where a phone is ---------------------------------------------------------------------------------------------


def rssi_dbm(place: Enu, at: Enu) -> float:
    return MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.minus(place).norm())


def test_two_that_pass_on_either_side_find_the_phone_and_know_how_well() -> None:
    truth, phone = Enu(60, 10, 0), PhoneFilter(MODEL)
    for north in range(-120, 121, 30):
        for node, east in ((1, 0), (2, 180)):
            phone.heard(node, Enu(east, north, 50), rssi_dbm(truth, Enu(east, north, 50)))
    place = phone.estimate()
    assert place is not None
    assert place.distance_m(truth) < 12
    assert 5 < place.sigma_m < 40


def test_one_that_passes_straight_leaves_the_side_open_and_silence_elsewhere_settles_it() -> None:
    truth, phone = Enu(80, 0, 0), PhoneFilter(MODEL)
    for north in range(-90, 91, 30):
        phone.heard(1, Enu(0, north, 50), rssi_dbm(truth, Enu(0, north, 50)))
    open_sides = phone.estimate()
    assert open_sides is not None
    assert abs(open_sides.east_m) < 25
    assert open_sides.east_variance_m2 > 50**2
    for north in range(-90, 91, 30):
        phone.silent(Enu(-120, north, 50))
    settled = phone.estimate()
    assert settled is not None
    assert settled.east_m > 40


def test_the_same_place_counts_once_for_a_node() -> None:
    phone = PhoneFilter(MODEL)
    assert phone.heard(1, Enu(0, 0, 50), -70)
    assert not phone.heard(1, Enu(5, 5, 50), -60)
    assert phone.heard(2, Enu(5, 5, 50), -60)


@given(st.floats(-1000, 1000), st.floats(-1000, 1000), st.floats(20, 100), st.floats(-80, 80), st.floats(-80, 80))
def test_a_camera_looks_at_the_ground_where_its_angles_lead(
    east: float, north: float, up: float, along: float, across: float
) -> None:
    bearing, elevation = math.atan2(along, across), -math.atan2(up, math.hypot(along, across))
    looked = ground_place(Enu(east, north, up), bearing_rad=bearing, elevation_rad=elevation)
    assert looked is not None
    assert math.hypot(looked[0] - east - along, looked[1] - north - across) < 1e-6 * (1 + abs(east) + abs(north))
