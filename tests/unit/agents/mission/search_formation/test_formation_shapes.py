"""The shapes in which a search is flown: laws that hold for any number of UAVs, and what each of them promises."""

import itertools
import math
import random
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from agents.mission.search_formation.formation_planner import pattern_of, plan_of
from agents.mission.search_formation.pattern import Pattern, fitted
from agents.mission.search_formation.shapes.contract import Demands, RowKind, RowOfPlaces, ShapeName
from agents.mission.search_formation.shapes.fan import Fan
from agents.mission.search_formation.shapes.sectors import rows_of
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import Enu
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.search_plan import MOST_PLACES, Search
from sim.results.coherence import coherence
from sim.results.mission import PhotographedCells
from sim.scenarios import catalog

REACH_M, SEEN_M, SPEED_M_S = 250.0, 131.0, 7.5


def demands(area_m: float, base: tuple[float, float] = (0.0, -0.54)) -> Demands:
    """`base`: where the swarm starts, in sides of the area from its middle."""
    return Demands(
        area_m=area_m, seen_m=SEEN_M, reach_m=REACH_M, height_m=65, speed_m_s=SPEED_M_S,
        base_m=(base[0] * area_m, base[1] * area_m),
    )  # fmt: skip


def formed(
    shape: ShapeName, count: int = 45, area_m: float = 2500, sectors: int = 4, base: tuple[float, float] = (0.0, -0.54)
) -> Pattern:
    made = fitted(count, demands(area_m, base), shape=shape, sectors_wanted=sectors)
    assert made is not None
    return made


def pieces(places: Sequence[Enu]) -> int:
    """Into how many pieces a swarm falls whose radios reach 250 m."""
    left, found = set(range(len(places))), 0
    while left:
        found, waiting = found + 1, [left.pop()]
        while waiting:
            here = places[waiting.pop()]
            near = {other for other in left if places[other].minus(here).norm() <= REACH_M}
            left -= near
            waiting += near
    return found


anyone = st.builds(
    lambda shape, count, area_m, sectors, base: fitted(
        count, demands(area_m, base), shape=shape, sectors_wanted=sectors
    ),
    st.sampled_from(ShapeName), st.integers(1, 120), st.floats(200, 3000), st.integers(1, 9),
    st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)),
).filter(lambda made: made is not None)  # fmt: skip


@given(anyone)
def test_who_is_tied_to_a_place_has_that_place_tied_to_its_own(pattern: Pattern) -> None:
    ties = {place: set(pattern.shape.tethers(place)) for place in range(pattern.dimensions.fixed)}
    assert {(here, there) for here in ties for there in ties[here]} == {
        (here, there) for there in ties for here in ties[there]
    }


@pytest.mark.parametrize("shape", ShapeName)
def test_nobody_is_tied_to_a_follower_nor_a_follower_to_anybody(shape: ShapeName) -> None:
    pattern = formed(shape, 50)
    for follower in range(pattern.dimensions.fixed, pattern.places):
        assert not pattern.shape.tethers(follower)


@given(anyone, st.floats(0, 2000))
def test_nobody_jumps_and_whoever_sweeps_flies_no_faster_than_a_way_back(pattern: Pattern, swept_s: float) -> None:
    for place in range(pattern.places):
        step = pattern.at(place, swept_s + 0.1).minus(pattern.at(place, swept_s)).norm()
        most_m_s = SPEED_M_S * (1.2 if pattern.kind(place) == "line" else 3.0)
        assert step <= 0.1 * most_m_s + 1e-6, (place, pattern.kind(place))


@given(anyone, st.floats(0, 2000))
def test_a_place_has_the_velocity_at_which_its_lane_just_moved(pattern: Pattern, swept_s: float) -> None:
    begun_s = max(swept_s, 0.05)
    for place in range(pattern.places):
        moved = pattern.shape.at(place, begun_s).minus(pattern.shape.at(place, begun_s - 0.05))
        assert pattern.velocity(place, swept_s).minus(Enu(*(20 * part for part in moved))).norm() < 1e-6, place
        assert pattern.velocity(place, -0.01) == Enu(0, 0, 0), "nobody moves before the sweep"


@given(anyone, st.floats(0, 2000))
def test_neighbors_of_a_line_stay_in_reach_of_each_other(pattern: Pattern, swept_s: float) -> None:
    for place in range(pattern.dimensions.fixed - pattern.dimensions.relays):
        for other in set(pattern.shape.tethers(place)) & set(pattern.line(place)):
            apart = pattern.at(place, swept_s).minus(pattern.at(other, swept_s)).norm()
            assert apart <= 0.9 * REACH_M + 1e-6, (place, other)


@given(anyone)
def test_a_plan_names_no_more_than_it_can_hold_and_is_the_same_formation_after_the_air(pattern: Pattern) -> None:
    assert pattern.places <= MOST_PLACES
    plan = plan_of(pattern, tuple(range(1, pattern.places + 1)), planner=1, start_us=7, deploy_ds=10)
    heard = pattern_of(told_in(bytes(HEADER_BYTES) + plan.encode_frame(1))[0], reach_m=REACH_M)
    for place in range(pattern.places):
        assert heard.at(place, 30.0).minus(pattern.at(place, 30.0)).norm() < 0.1
        assert heard.shape.tethers(place) == pattern.shape.tethers(place)


@pytest.mark.parametrize("shape", ShapeName)
@pytest.mark.parametrize(("count", "area_m"), [(45, 2500), (20, 1000)])
def test_one_sweep_brings_a_lane_near_every_spot_of_the_area(shape: ShapeName, count: int, area_m: float) -> None:
    pattern = formed(shape, count, area_m)
    lanes = [place for place in range(pattern.places) if pattern.kind(place) != "relay"]
    sweep_s = pattern.shape.sweep_s
    tracks = [pattern.at(place, 4.0 * step) for place in lanes for step in range(math.ceil(sweep_s / 4.0) + 1)]
    if shape is ShapeName.FAN:  # the way to the places is a part of it
        base = -0.54 * area_m
        first = [pattern.at(place, 0.0) for place in lanes]
        tracks += [
            Enu(s * at.east, base + s * (at.north - base), 65) for at in first for s in (0.0, 0.2, 0.4, 0.6, 0.8)
        ]
    half = round(area_m / 2) - 5
    for east, north in itertools.product(range(-half, half + 1, half // 8), repeat=2):
        assert any(math.hypot(at.east - east, at.north - north) <= SEEN_M for at in tracks), (east, north)


@given(st.integers(2, 120), st.floats(50, 3000))
def test_a_circuit_has_as_many_lanes_out_as_back(count: int, area_m: float) -> None:
    pattern = formed(ShapeName.CIRCUIT, count, area_m)
    lanes = area_m / 2 / pattern.dimensions.first_m
    assert lanes / 2 == pytest.approx(round(lanes / 2)), "else it would end at the other side"


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_a_spiral_of_a_few_winds_outward_until_all_is_seen_and_is_one_piece_all_the_time(count: int) -> None:
    pattern = formed(ShapeName.SPIRAL, count, 1000)
    sweep_s = pattern.shape.sweep_s
    track = [[pattern.at(place, 2.0 * step) for place in range(count)] for step in range(math.ceil(sweep_s / 2.0) + 1)]
    assert all(pieces(places) == 1 for places in track)
    flown = [at for places in track for at in places]
    for east, north in itertools.product(range(-495, 500, 90), repeat=2):
        assert any(math.hypot(at.east - east, at.north - north) <= SEEN_M for at in flown), (east, north)
    assert all(max(abs(at.east), abs(at.north)) <= 500 for at in flown)


@given(anyone, st.floats(0, 1000), st.floats(-1500, 1500), st.floats(-1500, 1500))
def test_a_place_is_as_far_from_a_team_as_from_its_nearest(
    pattern: Pattern, swept_s: float, east_m: float, north_m: float
) -> None:
    """Lines and rings are taken to be whole; of the others each UAV counts."""
    for team in range(pattern.dimensions.teams):
        places = [pattern.shape.at(place, swept_s) for place in pattern.dimensions.line(team)]
        nearest_m = min(math.hypot(at.east - east_m, at.north - north_m) for at in places)
        found_m = pattern.shape.apart_m(team, east_m, north_m, swept_s)
        if pattern.dimensions.shape in (ShapeName.LINES, ShapeName.RING):
            assert found_m <= nearest_m + 1e-6
        else:
            assert found_m == pytest.approx(nearest_m)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_winding_spiral_flies_back_the_way_it_came_and_out_again(count: int) -> None:
    pattern = formed(ShapeName.SPIRAL, count, 1000)
    sweep_s = pattern.shape.sweep_s
    for share in (0.0, 0.02, 0.3, 0.77, 0.999):
        for place in range(pattern.dimensions.fixed):
            there = pattern.at(place, share * sweep_s)
            for way in (2 - share, 2 + share, 4 - share, 4 + share):
                assert pattern.at(place, way * sweep_s).minus(there).norm() < 0.01, (place, share, way)


def test_the_outermost_lane_of_a_spiral_flies_at_the_speed_of_the_sweep_and_no_lane_faster() -> None:
    pattern = formed(ShapeName.SPIRAL, 2, 1000)
    fastest = [
        max(pattern.velocity(place, second + 0.5).norm() for place in range(2))
        for second in range(int(pattern.shape.sweep_s) - 1)
    ]
    assert max(fastest) <= SPEED_M_S + 1e-6
    assert min(fastest) > 0.6 * SPEED_M_S


@pytest.mark.parametrize("count", [2, 5, 20, 45])
def test_a_sweep_of_a_spiral_lasts_until_an_arm_is_where_the_next_one_began(count: int) -> None:
    shape = formed(ShapeName.SPIRAL, count, 1000).shape
    arms = shape.rows()
    outermost = arms[0].places[-1]
    track = [shape.at(outermost, shape.sweep_s * step / 1000) for step in range(1001)]
    way_m = sum(there.minus(here).norm() for here, there in itertools.pairwise(track))
    assert 0.95 * SPEED_M_S * shape.sweep_s < way_m < 1.001 * SPEED_M_S * shape.sweep_s
    if len(arms) > 1:
        assert track[-1].minus(shape.at(arms[1].places[-1], 0.0)).norm() < 0.01


def test_a_spiral_of_few_has_seen_the_middle_first() -> None:
    pattern = formed(ShapeName.SPIRAL, 2, 1000)
    eighth_s = pattern.shape.sweep_s / 8
    early = [pattern.at(place, step) for place in range(2) for step in range(int(eighth_s))]
    assert max(max(abs(at.east), abs(at.north)) for at in early) < 250


def test_arms_of_a_spiral_turn_as_one_piece_and_nobody_meets() -> None:
    pattern = formed(ShapeName.SPIRAL)
    assert pattern.dimensions.teams == 5
    for second in range(0, 600, 3):
        places = [pattern.at(place, second) for place in range(pattern.places)]
        assert pieces(places) == 1, second
        assert min(a.minus(b).norm() for a, b in itertools.combinations(places, 2)) > 8.0, second


def test_teams_of_four_sectors_part_in_two_rows_and_meet_again_and_nobody_meets() -> None:
    pattern = formed(ShapeName.SECTORS)
    seen = []
    for second in range(0, 2 * round(pattern.shape.sweep_s) + 20, 3):
        places = [pattern.at(place, second) for place in range(pattern.places)]
        seen.append(pieces(places))
        assert min(a.minus(b).norm() for a, b in itertools.combinations(places, 2)) > 8.0, second
    assert [number for number, _ in itertools.groupby(seen)] == [1, 2, 1, 2]


def test_sectors_leave_more_uavs_free_than_lines_do() -> None:
    assert len(formed(ShapeName.SECTORS).followers) > len(formed(ShapeName.LINES).followers)


@pytest.mark.parametrize(("teams", "rows"), [(1, 1), (2, 1), (4, 2), (6, 2), (7, 1), (9, 3)])
def test_sectors_lie_in_rows_that_leave_none_over(teams: int, rows: int) -> None:
    assert rows_of(teams) == rows


@pytest.mark.parametrize(("count", "area_m"), [(32, 1000), (41, 1000), (76, 1000), (73, 2500)])
def test_more_than_two_lines_move_as_one_piece_and_nobody_meets(count: int, area_m: float) -> None:
    pattern = formed(ShapeName.LINES, count, area_m)
    assert pattern.dimensions.teams > 2
    for second in range(2 * round(pattern.shape.sweep_s) + 20):
        places = [pattern.at(place, second) for place in range(pattern.places)]
        assert pieces(places) == 1, second
        assert min(a.minus(b).norm() for a, b in itertools.combinations(places, 2)) > 8.0, second


@pytest.mark.parametrize("shape", [ShapeName.LINES, ShapeName.SPIRAL])
def test_one_more_uav_is_never_slower(shape: ShapeName) -> None:
    times = [made.shape.sweep_s for n in range(1, 90) if (made := fitted(n, demands(1000), shape=shape)) is not None]
    assert all(after <= before + 1e-9 for before, after in itertools.pairwise(times))


@pytest.mark.parametrize(
    ("shape", "count", "area_m"),
    [(ShapeName.LINES, 45, 2500), (ShapeName.LINES, 20, 1000), (ShapeName.LINES, 41, 1000), (ShapeName.RING, 20, 1000)],
)
def test_lines_and_rings_show_on_their_way_back_what_no_camera_has_shown_on_their_way_out(
    shape: ShapeName, count: int, area_m: float
) -> None:
    pattern = formed(shape, count, area_m)
    keys = [f"world.area_m={area_m}", f"nodes.count={count}", "nodes.spacing_m=50"]
    cells, shown = PhotographedCells(catalog.find("rescue", keys)), []
    for second in range(math.ceil(2 * pattern.shape.sweep_s) + 30):
        cells.add(pattern.at(place, second) for place in range(pattern.dimensions.fixed))
        shown.append(cells.share)
    assert shown[math.ceil(pattern.shape.sweep_s)] < 0.9
    assert shown[-1] > (0.98 if shape is ShapeName.LINES else 0.92), "neighbors in a ring are farther apart"


@pytest.mark.parametrize("count", [6, 9, 14])
def test_who_is_too_few_for_two_lines_flies_in_one(count: int) -> None:
    pattern = formed(ShapeName.LINES, count, 1000)
    assert (pattern.dimensions.teams, len(pattern.followers)) == (1, count - 6)
    assert pattern.shape.sweep_s < 128
    for second in range(0, 2 * round(pattern.shape.sweep_s) + 20, 4):
        assert pieces([pattern.at(place, second) for place in range(count)]) == 1, second


def test_who_is_just_too_few_for_lines_to_the_edge_turns_where_all_beyond_is_heard() -> None:
    pattern = formed(ShapeName.LINES, 15, 1000)
    assert (pattern.dimensions.teams, pattern.dimensions.relays, pattern.dimensions.last_m) == (2, 3, 440.0)
    assert formed(ShapeName.LINES, 16, 1000).dimensions.last_m == 475.0
    assert formed(ShapeName.LINES, 30, 1000).dimensions.teams == 4
    flown = [pattern.at(place, second) for second in range(round(pattern.shape.sweep_s) + 1) for place in range(15)]
    corners = [(east, north) for east in range(-500, 501, 50) for north in (-500, 500)]
    assert all(min(math.hypot(at.east - e, at.north - n) for at in flown) < SEEN_M for e, n in corners)


def test_twice_the_uavs_sweep_in_lines_in_half_the_time() -> None:
    times = [formed(ShapeName.LINES, count, 1000).shape.sweep_s for count in (20, 40, 80)]
    assert times == pytest.approx([61.2, 30.6, 10.2], abs=0.1)


def test_a_ring_is_so_large_that_it_hangs_by_no_single_uav() -> None:
    pattern = formed(ShapeName.RING)
    for second in range(0, 2 * round(pattern.shape.sweep_s) + 20, 3):
        places = [pattern.at(place, second) for place in range(45)]
        apart = np.array([[a.minus(b).norm() for a in places] for b in places])
        assert coherence(apart <= REACH_M).biconnected, second
        assert np.sort(apart, axis=1)[:, 1].min() > 20.0, second


AROUND = [Enu(200.0 * (i % 9) - 800, 200.0 * (i // 9) - 400, 65) for i in range(45)]
"""45 UAVs that stand over the middle of the area, as those of `rescue` do."""


def test_a_ring_of_uavs_enough_turns_where_cameras_show_the_edge() -> None:
    assert formed(ShapeName.RING, 20, 1000).dimensions.last_m == 475.0
    assert formed(ShapeName.RING).dimensions.last_m == 1190.0, "a ring with losses still comes there"


def test_a_ring_begins_as_large_as_the_swarm_that_stands_around_the_middle_and_waits_at_the_edge() -> None:
    ring, fan = formed(ShapeName.RING), formed(ShapeName.FAN)
    (begun,) = ring.begun_around(AROUND)
    assert begun.dimensions == ring.dimensions._replace(first_m=595.0), "half of where it ends, 600 m at most"
    assert ring.begun_around([at._replace(north=at.north / 4) for at in AROUND])[0].dimensions.first_m == 450.0
    beside = [at._replace(north=at.north - 1350) for at in AROUND]
    assert ring.begun_around(beside)[0].dimensions == ring.dimensions, "from a base it draws together in the middle"
    assert fan.begun_around(AROUND) == [fan]
    end_s = begun.shape.sweep_s
    for since_s, waits in ((0.1, True), (29, True), (31, False)):
        at = begun.at(3, end_s + since_s)
        assert (max(abs(at.east), abs(at.north)) == pytest.approx(1190)) == waits, "who was heard last is to be seen"


def test_lines_begin_a_little_beyond_the_swarm_and_leave_out_only_what_it_has_heard() -> None:
    lines = formed(ShapeName.LINES)
    begun, *nearer = lines.begun_around(AROUND)
    assert begun.dimensions == lines.dimensions._replace(first_m=520.0, narrower_m=20.625), (
        "where neighbors hear each other"
    )
    assert [other.dimensions.first_m for other in nearer] == [pytest.approx(16 + 504 * k / 8) for k in range(7, 0, -1)]
    assert nearer[-1].dimensions.narrower_m == 165.0, "1.3 of how wide it stands"
    assert begun.shape.sweep_s < lines.shape.sweep_s - 24
    flown = [begun.at(place, second) for second in range(round(begun.shape.sweep_s) + 1) for place in range(45)]
    heard_from = np.array([(at.east, at.north) for at in (*AROUND, *flown)])
    unheard = [
        (east, north)
        for east in range(-1225, 1226, 50)
        for north in range(-1225, 1226, 50)
        if np.hypot(*(heard_from - (east, north)).T).min() > SEEN_M
    ]
    assert len(unheard) <= 0.01 * 50 * 50


def test_cameras_of_lines_that_begin_around_the_swarm_show_the_sides_of_the_middle() -> None:
    begun = formed(ShapeName.LINES).begun_around(AROUND)[0]
    ends = [begun.at(place, second) for place in (0, 14, 15, 29) for second in (0, 5)]
    for east, north in itertools.product((-1240, 1240), range(-100, 101, 10)):
        assert min(max(abs(at.east - east), abs(at.north - north)) for at in ends) <= 65, "what a camera shows"


def test_the_outermost_lanes_fly_to_the_sides_while_the_middle_sweeps_and_waits_at_the_edge() -> None:
    begun = formed(ShapeName.LINES).begun_around(AROUND)[0]
    aside_s = begun.dimensions.narrower_m / 9
    east_m, north_m = (
        [
            [getattr(begun.at(lane, second), axis) for lane in (7, 14)]
            for second in (0, aside_s, 125, begun.shape.sweep_s)
        ]
        for axis in ("east", "north")
    )
    assert [east for _, east in east_m] == pytest.approx([1184.375, 1205, 1205, 1205])
    assert [north for _, north in north_m] == pytest.approx([60, 60, 60 + 9 * (125 - aside_s), 1225], abs=1)
    assert [north for north, _ in north_m] == pytest.approx([520, 520 + 7.5 * aside_s, 1225, 1225], abs=1)


def test_lines_begin_wider_and_nearer_where_neighbors_would_lose_each_other() -> None:
    packed = [at._replace(east=at.east / 16) for at in AROUND]
    begun = formed(ShapeName.LINES).begun_around(packed)[0]
    for second in range(round(begun.shape.sweep_s)):
        hops_m = [begun.at(lane, second).minus(begun.at(lane + 1, second)).horizontal() for lane in range(14)]
        assert max(hops_m) <= 0.92 * REACH_M, second


def test_lines_that_begin_around_the_swarm_hang_together_all_the_way_and_come_back_to_the_middle() -> None:
    begun = formed(ShapeName.LINES).begun_around(AROUND)[0]
    end_s = begun.shape.sweep_s
    for second in range(0, 4 * round(end_s), 3):
        places = [begun.at(place, second) for place in range(45)]
        assert pieces(places) == 1, second
        assert max(begun.velocity(place, second).norm() for place in range(40)) < 1.37 * 7.5, second
        for place in range(40):
            for tied in begun.shape.tethers(place):
                assert places[place].minus(places[tied]).horizontal() <= 0.95 * REACH_M, (second, place, tied)
    middle = [abs(begun.at(7, end_s + since_s).north) for since_s in (0, 10, 10 + 1209 / 9)]
    assert middle == pytest.approx([1225, 1225, 16], abs=1), "out, a turn, and back to the middle at 9 m/s"


def test_cameras_of_the_outermost_lanes_show_the_edge_where_that_takes_no_further_lane() -> None:
    wide, small = formed(ShapeName.LINES), formed(ShapeName.LINES, 20, 1000)
    assert (wide.dimensions.lanes, wide.dimensions.half_width_m) == (15, 1250 - 45)
    assert small.dimensions.lanes == 6, "seven would leave too few UAVs for four lines"
    assert 500 - 65 < small.dimensions.half_width_m < 500 - 45


def test_only_the_line_whose_uavs_are_missing_becomes_narrower() -> None:
    lines = formed(ShapeName.LINES)
    closed = lines.shape.drawn_in(frozenset(range(2, 8)), 0.91 * REACH_M)
    for second in (0.0, 60.0, 400.0):
        assert [closed.at(lane, second).east for lane in (0, 14)] == pytest.approx([-910, 910])
        assert [closed.at(lane, second).east for lane in (15, 29)] == pytest.approx([-1205, 1205])
        joined = [closed.at(place, second) for place in range(30, 40)]
        assert all(a.horizontal_to(b) <= 0.91 * REACH_M for a, b in itertools.pairwise(joined))


@pytest.mark.parametrize(
    ("swarm", "why"),
    [
        ([at._replace(north=at.north - 1350) for at in AROUND], "it comes from a base"),
        ([at._replace(east=at.east * 1.4, north=at.north * 1.4) for at in AROUND], "it does not hear all between it"),
        ([at._replace(north=at.north / 40) for at in AROUND], "it stands in the middle anyway"),
    ],
)
def test_lines_of_another_swarm_begin_in_the_middle(swarm: list[Enu], why: str) -> None:
    lines = formed(ShapeName.LINES)
    assert [begun.dimensions for begun in lines.begun_around(swarm)] == [lines.dimensions], why


def test_where_uavs_are_too_few_for_a_ring_they_fly_in_lines() -> None:
    assert formed(ShapeName.RING, 44).dimensions.shape is ShapeName.RING
    assert formed(ShapeName.RING, 43).dimensions.shape is ShapeName.LINES


@pytest.mark.parametrize("base", [(0.0, -0.54), (0.6, 0.1), (0.54, -0.54)])
def test_a_fan_spreads_from_its_base_in_one_piece_and_nobody_is_long_on_the_way(base: tuple[float, float]) -> None:
    pattern = formed(ShapeName.FAN, base=base)
    assert pattern.dimensions.shape is ShapeName.FAN
    start, end_s = Enu(2500 * base[0], 2500 * base[1], 65), pattern.shape.sweep_s
    for place in range(45):
        first, last = (pattern.at(place, second).minus(start).horizontal() for second in (0, end_s))
        assert first <= last / 4, "it begins near the base"
    for second in range(0, round(end_s) + 20, 5):
        front = [pattern.at(place, second) for place in range(45)]
        assert pieces(front) == 1, second
        assert min(a.minus(b).horizontal() for a, b in itertools.pairwise(front[:42])) > 20, second


def test_a_fan_shows_cameras_more_on_its_way_than_lines_in_a_sweep() -> None:
    scenario = catalog.find("rescue-base", [])
    shown = {}
    for shape in (ShapeName.LINES, ShapeName.FAN):
        pattern, cells = formed(shape), PhotographedCells(scenario)
        for step in range(round(pattern.shape.sweep_s / 3)):
            cells.add([tuple(pattern.at(place, 3.0 * step)) for place in range(45)])
        shown[shape] = cells.share
    assert shown[ShapeName.FAN] > shown[ShapeName.LINES] + 0.1


def test_uavs_that_are_too_few_for_a_fan_or_whose_base_is_in_the_area_fly_in_lines() -> None:
    assert formed(ShapeName.FAN, 42).dimensions.shape is ShapeName.FAN
    assert formed(ShapeName.FAN, 41).dimensions.shape is ShapeName.LINES
    assert formed(ShapeName.FAN, base=(0.1, -0.4)).dimensions.shape is ShapeName.LINES


lost_ones = st.builds(
    lambda pattern, seed, share: (
        pattern, frozenset(random.Random(seed).sample(range(pattern.places), int(share * (pattern.places - 1))))
    ),
    anyone, st.integers(0, 2**32), st.floats(0, 0.9),
)  # fmt: skip


@given(lost_ones, st.floats(0, 2000))
def test_whoever_is_left_of_a_row_closes_ranks_and_keeps_the_order(
    case: tuple[Pattern, frozenset[int]], swept_s: float
) -> None:
    pattern, vacant = case
    closed = pattern.closed(vacant)
    for row in pattern.shape.rows():
        left = [place for place in row.places if place not in vacant]
        flown = [row.shared(vacant).get(place, float(place)) for place in left]
        turns = sum(after < before for before, after in itertools.pairwise(flown))
        assert turns <= (row.kind is RowKind.AROUND)
        assert all(row.first - 1 < at < row.first + row.size for at in flown) or row.kind is RowKind.AROUND
        for place, other in itertools.pairwise(left):
            joined = (ShapeName.LINES, ShapeName.RING, ShapeName.FAN)
            if closed.dimensions.shape in joined and row.kind is not RowKind.BETWEEN:
                apart = closed.at(place, swept_s).minus(closed.at(other, swept_s)).norm()
                assert apart <= 0.96 * REACH_M or len(left) < 8, (place, other)
        for place in left:
            assert not set(closed.tethers(place, swept_s)) & vacant


def test_no_rounding_takes_the_last_uav_of_a_row_beyond_its_end() -> None:
    for size in range(2, 100):
        row = RowOfPlaces(0, size, RowKind.SPAN)
        for lost in range(1, size - 1):
            last = list(row.shared(frozenset(range(lost))).values())[-1]
            assert last <= size - 1
            assert last == pytest.approx(size - 1)


def test_the_front_of_a_fan_goes_as_far_as_those_who_are_left_span_it() -> None:
    for count in (30, 32, 36):
        shape = formed(ShapeName.FAN, count, 1800).shape
        assert isinstance(shape, Fan)
        lanes = shape.rows()[0].size
        for left in range(2, lanes):
            few = shape.drawn_in(frozenset(range(left, lanes)), 150.0)
            flown = list(shape.rows()[0].shared(frozenset(range(left, lanes))).values())
            front = [few.at(place, few.sweep_s) for place in flown]
            most_m = max(a.minus(b).horizontal() for a, b in itertools.pairwise(front))
            assert most_m <= 150.001
            assert most_m > 140 or left > lanes / 2, "it goes as far as it can"


@pytest.mark.parametrize("lost", [[3], [0, 7], [14]])
def test_a_line_that_has_closed_ranks_is_as_wide_as_before(lost: list[int]) -> None:
    whole = formed(ShapeName.LINES)
    left = [place for place in whole.line(0) if place not in lost]
    easts = [whole.closed(frozenset(lost)).at(place, 30.0).east for place in (left[0], left[-1])]
    assert easts == [whole.at(place, 30.0).east for place in (0, 14)]


@pytest.mark.parametrize("lost", [[2], [61], [64], [68, 20], [3, 17, 36, 60, 65]])
def test_more_than_two_lines_without_some_of_their_uavs_are_one_piece(lost: list[int]) -> None:
    whole = formed(ShapeName.LINES, 73, 2500)
    pattern = whole.closed(frozenset(lost))
    left = [place for place in range(73) if place not in lost]
    for second in range(45, 2 * round(whole.shape.sweep_s) + 20, 5):
        assert pieces([pattern.at(place, second) for place in left]) == 1, second


@pytest.mark.parametrize("shape", [ShapeName.LINES, ShapeName.RING, ShapeName.FAN])
@pytest.mark.parametrize("lost", [[7], [31], [34], [0, 31, 36], [3, 12, 20, 32, 35]])
def test_a_swarm_without_some_of_its_uavs_is_one_piece_that_turns_back_before_it_breaks(
    shape: ShapeName, lost: list[int]
) -> None:
    whole = formed(shape)
    pattern = whole.closed(frozenset(lost))
    left = [place for place in range(45) if place not in lost]
    for second in range(45, 2 * round(whole.shape.sweep_s) + 20, 5):
        assert pieces([pattern.at(place, second) for place in left]) == 1, second


@given(lost_ones)
def test_when_ranks_are_closed_who_is_tied_to_another_has_that_one_tied_to_it(
    case: tuple[Pattern, frozenset[int]],
) -> None:
    pattern, vacant = case
    closed = pattern.closed(vacant)
    ties = {place: set(closed.tethers(place, 1e6)) for place in range(pattern.places) if place not in vacant}
    assert all(place in ties[other] for place, others in ties.items() for other in others)


@pytest.mark.parametrize("count", [45, 73])
def test_tied_uavs_of_lines_that_have_closed_ranks_are_in_reach_of_each_other(count: int) -> None:
    """Where a chain ends nobody may fly in the middle of the line any more."""
    whole, draw = formed(ShapeName.LINES, count), random.Random(1)
    for _ in range(12):
        vacant = frozenset(draw.sample(range(count), draw.randint(1, 8)))
        closed = whole.closed(vacant)
        for second in range(45, 2 * round(whole.shape.sweep_s) + 20, 10):
            at = {place: closed.at(place, second) for place in range(count) if place not in vacant}
            for place, here in at.items():
                assert all(at[o].minus(here).norm() <= REACH_M for o in closed.tethers(place, second)), (vacant, second)


def test_a_chain_ends_at_whoever_flies_nearest_once_its_line_has_closed_ranks() -> None:
    whole, middle = formed(ShapeName.LINES), 7
    first, last = 30, 39
    assert first in whole.tethers(middle, 60.0)
    for lost, ends in (([middle], 6), ([0, 1, 2, 3], 9), ([11, 12, 13, 14], 5)):
        closed = whole.closed(frozenset(lost))
        left = [place for place in whole.line(0) if place not in lost]
        assert [place for place in left if first in closed.tethers(place, 60.0)] == [ends]
        assert closed.tethers(first, 60.0) == (ends, first + 1)
        assert abs(closed.at(ends, 60.0).east - closed.at(first, 60.0).east) < 20
        assert closed.tethers(last, 60.0) == (22, last - 1), "that of the other line is the same"
    chainless = whole.closed(frozenset([3, *range(first, last + 1)]))
    assert 22 in chainless.tethers(middle, 0.0), "without relays the lines are tied to each other"


@pytest.mark.parametrize(
    "impossible",
    [
        {"shape": 6}, {"shape": 5, "teams": 1, "lanes": 4, "last_m": 99.0}, {"teams": 3},
        {"shape": 1, "teams": 0}, {"shape": 2, "relays": 1}, {"shape": 1, "first_m": 0.5},
        {"shape": 2, "half_width_m": 0.5}, {"shape": 2, "teams": 101}, {"lanes": 1},
    ],
)  # fmt: skip
def test_a_formation_that_nobody_could_fly_is_refused(impossible: dict[str, float]) -> None:
    plan = Search(7, 100.0, 16.0, 400.0, 65.0, 7.5, 30, 1, 1, (1, 2, 3, 4), 2, 0, 0)
    fan = plan._replace(shape=5, teams=1, lanes=4, first_m=0.0, last_m=-100.0)
    for possible in (plan, plan._replace(shape=1), plan._replace(shape=2, teams=1, lanes=4), fan):
        assert told_in(bytes(HEADER_BYTES) + possible.encode_frame(1))[0] == possible
    with pytest.raises(MalformedFrameError):
        told_in(bytes(HEADER_BYTES) + plan._replace(**impossible).encode_frame(1))[0]  # type: ignore[arg-type]


@given(
    st.integers(2, 9), st.floats(0, 600), st.floats(0, 1), st.floats(0, 400), st.floats(1, 900), st.integers(1, 3),
    st.sets(st.integers(0, 40)),
)  # fmt: skip
@example(2, 100.0, 0.0, 50.0, 400.0, 1, set())
@example(3, 100.0, 1.0, 50.0, 400.0, 1, set())
@example(3, 0.0, 0.0, 50.0, 400.0, 1, {1})
def test_whatever_lines_a_plan_off_the_air_may_name_each_place_is_somewhere(
    lanes: int, half_width_m: float, narrower: float, first_m: float, more_m: float, pairs: int, vacant: set[int]
) -> None:
    named = Search(
        7, half_width_m, first_m, first_m + more_m, 65.0, 7.5, 30, 1, 1, tuple(range(1, 2 * pairs * lanes + 9)),
        lanes, 6, 2, 0, 2 * pairs, narrower * half_width_m,
    )  # fmt: skip
    plan = told_in(bytes(HEADER_BYTES) + named.encode_frame(1))[0]
    whole = pattern_of(plan, reach_m=REACH_M)
    for pattern in (whole, whole.closed(frozenset(vacant.intersection(range(whole.places - 3))))):
        for swept_s in (0.0, 7.0, 0.5 * pattern.shape.sweep_s, pattern.shape.sweep_s, 1.5 * pattern.shape.sweep_s):
            assert all(math.isfinite(pattern.at(place, swept_s).norm()) for place in range(pattern.places))
            assert math.isfinite(pattern.shape.apart_m(0, 10.0, 20.0, swept_s))
