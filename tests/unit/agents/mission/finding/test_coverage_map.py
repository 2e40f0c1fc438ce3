"""The shared map of what has been searched: how maps merge, and what a free UAV makes of one."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.mission.finding.coverage_map import TELL_NS, CoverageMap
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.search_formation.formation_place import FormationPlace
from agents.mission.search_formation.formation_planner import plan_of
from agents.mission.search_formation.missed_cells import MissedCells
from agents.mission.search_formation.pattern import Pattern, fitted
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire import COVERED, HEADER_BYTES
from fanet_mw.wire.frame import encode_inner
from fanet_mw.wire.searched_cells import COVERED_SIDE, Covered

AREA_M, SEEN_M = 2500.0, 131.0
cells = st.integers(0, (1 << COVERED_SIDE * COVERED_SIDE) - 1)
spots = st.builds(Enu, st.floats(-1400, 1400), st.floats(-1400, 1400), st.just(65.0))


def empty() -> CoverageMap:
    return CoverageMap(area_m=AREA_M, seen_m=SEEN_M)


@given(cells)
def test_cells_come_through_the_air_as_they_are(known: int) -> None:
    covered = Covered(known)
    assert Covered.decode_frame(bytes(HEADER_BYTES) + covered.encode_frame(3)) == covered


def test_cells_of_another_version_are_refused() -> None:
    frame = encode_inner(COVERED, COVERED.layout.pack(*bytes(128), 2), node=3)
    with pytest.raises(MalformedFrameError):
        Covered.decode_frame(bytes(HEADER_BYTES) + frame)


@given(cells, cells, spots)
def test_maps_merge_in_any_order_with_copies_and_never_forget(one: int, other: int, spot: Enu) -> None:
    first, second = empty(), empty()
    first.fly_over(spot)
    for told in (one, other, one):
        first.merge(Covered(told))
    for told in (other, one):
        second.merge(Covered(told))
    second.fly_over(spot)
    assert first.cells == second.cells
    assert first.cells & one == one


@given(spots)
def test_who_flies_over_a_spot_searches_what_its_receiver_reaches_within_the_area(spot: Enu) -> None:
    searched, cell_m = empty(), AREA_M / COVERED_SIDE
    searched.fly_over(spot)
    for index in range(COVERED_SIDE * COVERED_SIDE):
        row, column = divmod(index, COVERED_SIDE)
        middle = (column + 0.5) * cell_m - AREA_M / 2, (row + 0.5) * cell_m - AREA_M / 2
        apart_m = math.hypot(middle[0] - spot.east, middle[1] - spot.north)
        assert bool(searched.cells >> index & 1) == (apart_m <= SEEN_M), index


def test_a_map_is_told_every_4_s() -> None:
    searched = empty()
    told = [second for second in range(12) if searched.news(second * S) is not None]
    assert told == [0, TELL_NS // S, 2 * TELL_NS // S]


class Follower:
    """A free UAV of a formation, and a map to which everyone in a lane has told what it searched."""

    def __init__(self, shape: ShapeName, *lost: int) -> None:
        made = fitted(45, Demands(AREA_M, SEEN_M, 250.0, 65.0, 7.5), shape=shape, sectors_wanted=4)
        assert made is not None
        self.pattern: Pattern = made
        plan = plan_of(made, tuple(range(1, made.places + 1)), planner=1, start_us=0, deploy_ds=0)
        here = made.at(made.followers.start, 0.0)
        self.place = FormationPlace(
            NodeId(made.followers.start + 1), OwnMotion(here, KnownObstacles(NO_MAP)), reach_m=250.0
        )
        self.place.adopt(plan, 0)
        assert plan.start_us * US == 0
        self.map, self.lost = empty(), lost
        self.gaps = MissedCells(self.map, self.place)

    def gap_after(self, seconds: int, *, late_s: int = 0) -> tuple[float, float] | None:
        """What it would fly to at last, when the formation has swept for so long, and others tell it so late."""
        found = None
        for second in range(seconds + 1):
            for place in range(self.pattern.dimensions.teams * self.pattern.dimensions.lanes):
                if place not in self.lost:
                    self.map.fly_over(self.pattern.at(place, second - late_s))
            here = self.pattern.at(self.pattern.followers.start, second)
            found = self.gaps.nearest(here, second * S)
        return found


@pytest.mark.parametrize("shape", ShapeName)
def test_there_is_no_gap_behind_a_formation_that_flies_as_planned_though_it_tells_so_late(shape: ShapeName) -> None:
    for second in range(80, 101, 4):
        assert Follower(shape).gap_after(second, late_s=20) is None


@pytest.mark.parametrize("lost", [(0,), (1, 2), (3, 4)])
def test_a_follower_flies_where_lost_uavs_of_its_line_would_have_been(lost: tuple[int, ...]) -> None:
    follower = Follower(ShapeName.LINES, *lost)
    gap = follower.gap_after(60)
    assert gap is not None
    lanes = [follower.pattern.at(place, 60.0) for place in lost]
    assert min(abs(gap[0] - lane.east) for lane in lanes) <= follower.pattern.shape.lane_m
    assert 0 < lanes[0].north - gap[1] <= 250, "behind the line, and in reach of it"


def test_a_gap_that_somebody_is_told_to_have_searched_is_none_any_more() -> None:
    follower = Follower(ShapeName.LINES, 1, 2)
    assert follower.gap_after(60) is not None
    follower.map.merge(Covered((1 << COVERED_SIDE * COVERED_SIDE) - 1))
    assert follower.gap_after(60) is None
