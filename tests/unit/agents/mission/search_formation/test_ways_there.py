"""Detours on the way to the places of a search: cameras show what lies among the swarm."""

from collections.abc import Mapping
from itertools import pairwise
from random import Random

import pytest

from agents.mission.search_formation.lasting_links import keep_together
from agents.mission.search_formation.pattern import Pattern, fitted
from agents.mission.search_formation.shapes.contract import Demands
from agents.mission.search_formation.ways_there import detours
from fanet_mw.units import Enu

REACH_M, VIEW_M, MOST_M = 250.0, 58.0, 370.0
GRID = [Enu(200.0 * (i % 9) - 800, 200.0 * (i // 9) - 400, 65) for i in range(45)]


def planned() -> tuple[Pattern, dict[int, Enu]]:
    """Lines that begin around 45 UAVs, and where the UAV of each place is."""
    made = fitted(45, Demands(2500, 131, REACH_M, 65, 7.5))
    assert made is not None
    begun = made.begun_around(GRID)[0]
    goals = [begun.at(place, 0.0) for place in range(45)]
    chosen, _ = keep_together(GRID, goals, lambda *_: 0.0, reach_m=REACH_M, random=Random(1).random)
    return begun, {place: GRID[uav] for uav, place in enumerate(chosen)}


def unseen(pattern: Pattern, starts: Mapping[int, Enu], over: Mapping[int, Enu]) -> float:
    """The share of the swarm's rectangle, where it is not swept later, that no camera shows on these ways."""
    shown = []
    for place, start in starts.items():
        stops = [start, *([over[place]] if place in over else []), pattern.at(place, 0.0)]
        for a, b in pairwise(stops):
            shown += [(a.east + k / 20 * (b.east - a.east), a.north + k / 20 * (b.north - a.north)) for k in range(21)]
    spots = [(east, north) for east in range(-780, 800, 40) for north in range(-280, 300, 40)]
    missed = [s for s in spots if min(max(abs(s[0] - at[0]), abs(s[1] - at[1])) for at in shown) > VIEW_M + 20]
    return len(missed) / len(spots)


def test_detours_show_most_of_what_straight_ways_leave_out_and_nobody_comes_late() -> None:
    pattern, starts = planned()
    over = detours(pattern, starts, view_m=VIEW_M, most_m=MOST_M)
    assert unseen(pattern, starts, {}) == pytest.approx(0.2)
    assert unseen(pattern, starts, over) < 0.08
    for place, at in over.items():
        goal = pattern.at(place, 0.0)
        way_m = starts[place].horizontal_to(at) + at.horizontal_to(goal)
        assert way_m <= min(MOST_M, starts[place].horizontal_to(goal) + 220) + 30, "starts are known to 20 m"
        assert at.up == goal.up


def test_all_find_the_same_detours_although_each_knows_the_others_a_little_otherwise() -> None:
    pattern, starts = planned()
    random = Random(2)
    moved = {
        place: Enu(at.east + random.uniform(-9, 9), at.north + random.uniform(-9, 9), 60)
        for place, at in starts.items()
    }
    assert detours(pattern, moved, view_m=VIEW_M, most_m=MOST_M) == detours(
        pattern, starts, view_m=VIEW_M, most_m=MOST_M
    )


@pytest.mark.parametrize("most_m", [0.0, 60.0])
def test_whoever_has_no_time_flies_straight(most_m: float) -> None:
    pattern, starts = planned()
    ways_m = {place: at.horizontal_to(pattern.at(place, 0.0)) for place, at in starts.items()}
    over = detours(pattern, starts, view_m=VIEW_M, most_m=most_m)
    assert all(ways_m[place] <= most_m + 30 for place in over)


def test_uavs_that_stand_side_by_side_fly_straight() -> None:
    pattern, starts = planned()
    packed = {place: Enu(at.east / 14, at.north / 14 - 1350, 65) for place, at in starts.items()}
    assert detours(pattern, packed, view_m=VIEW_M, most_m=5000.0) == {}


def test_a_forged_position_far_away_changes_nothing_and_a_forged_plan_costs_no_time() -> None:
    pattern, starts = planned()
    known = detours(pattern, {place: at for place, at in starts.items() if place != 3}, view_m=VIEW_M, most_m=MOST_M)
    assert detours(pattern, {**starts, 3: Enu(1e6, -1e6, 0)}, view_m=VIEW_M, most_m=MOST_M) == known
    far = {**starts, 3: Enu(9e3, 9e3, 0), 4: Enu(-9e3, -9e3, 0)}
    assert detours(pattern, far, view_m=VIEW_M, most_m=1e6) == {}
    slow = Pattern(pattern.dimensions._replace(speed_m_s=0.1), reach_m=REACH_M)
    assert detours(slow, starts, view_m=VIEW_M, most_m=MOST_M) == {}
