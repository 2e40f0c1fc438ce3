"""A swarm takes up a formation in one piece."""

import math
from collections.abc import Sequence
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from agents.mission.hungarian import assign
from agents.mission.search_formation.lasting_links import keep_together
from agents.mission.search_formation.pattern import fitted
from agents.mission.search_formation.shapes.contract import Demands
from fanet_mw.units import Enu
from sim.results.links_over_time import parts

REACH_M = 250.0
GRID = [Enu(200.0 * (i % 9) - 800, 200.0 * (i // 9) - 400, 65) for i in range(45)]
RANDOM_SWARM = st.tuples(st.integers(2, 40), st.integers(0, 3), st.floats(60, 220), st.integers(0, 2**32))


def torn(starts: Sequence[Enu], goals: Sequence[Enu], chosen: Sequence[int]) -> list[float]:
    """The shares of the way at which the swarm is not in one piece."""
    begin = np.array([at[:2] for at in starts])
    end = np.array([goals[goal][:2] for goal in chosen])
    found = []
    for share in np.linspace(0, 1, 41):
        at = begin + share * (end - begin)
        near = np.hypot(*(at[:, None] - at).transpose(2, 0, 1)) <= REACH_M
        found += [] if (parts(near) == 0).all() else [float(share)]
    return found


def ways_m(starts: Sequence[Enu], goals: Sequence[Enu], chosen: Sequence[int]) -> list[float]:
    return [goals[goal].minus(start).horizontal() for start, goal in zip(starts, chosen, strict=True)]


def nearest(starts: Sequence[Enu], goals: Sequence[Enu]) -> list[int]:
    return assign([[start.minus(goal).horizontal() ** 2 for goal in goals] for start in starts])


@examples(10)
@given(RANDOM_SWARM)
def test_who_is_said_to_stay_together_does_so_all_the_way_and_nobody_flies_much_farther(
    drawn: tuple[int, int, float, int],
) -> None:
    count, more, apart_m, seed = drawn
    random = Random(seed)
    grid = [Enu(apart_m * (i % 6) + random.random(), apart_m * (i // 6), 65) for i in range(count)]
    row = [Enu(200.0 * i - 400, 300 + 40 * random.random(), 65) for i in range(count + more)]
    chosen, is_one = keep_together(grid, row, lambda *_: 0.0, reach_m=REACH_M, random=random.random)
    assert len(set(chosen)) == count
    least = nearest(grid, row)
    assert max(ways_m(grid, row, chosen)) <= 1.08 * max(ways_m(grid, row, least)) + 1e-6
    if is_one:
        assert not torn(grid, row, chosen)
    else:
        assert chosen == least


@pytest.mark.parametrize("seed", range(4))
def test_45_uavs_that_stand_in_a_grid_reach_lines_far_out_in_one_piece_and_no_way_is_much_longer_for_it(
    seed: int,
) -> None:
    pattern = fitted(45, Demands(2500, 131, REACH_M, 65, 7.5))
    assert pattern is not None
    random = Random(seed)
    starts = [at._replace(east=at.east + 5 * random.random()) for at in GRID]
    for begun in pattern.begun_around(starts):
        goals = [begun.at(place, 0.0) for place in range(45)]
        chosen, is_one = keep_together(starts, goals, lambda *_: 0.0, reach_m=REACH_M, random=random.random)
        if is_one:
            break
    assert is_one
    assert begun.dimensions.first_m >= 350
    assert not torn(starts, goals, chosen)
    assert max(ways_m(starts, goals, chosen)) <= 1.08 * max(ways_m(starts, goals, nearest(starts, goals))) + 1e-6


def test_a_goal_that_is_dear_for_a_uav_goes_to_another() -> None:
    starts, goals = [Enu(0, 0, 65), Enu(100, 0, 65)], [Enu(0, 50, 65), Enu(100, 50, 65)]
    cheap = keep_together(starts, goals, lambda *_: 0.0, reach_m=REACH_M, random=Random(1).random)
    dear = keep_together(
        starts, goals, lambda uav, goal: 1e6 * (uav == goal == 0), reach_m=REACH_M, random=Random(1).random
    )
    assert (cheap, dear) == (([0, 1], True), ([1, 0], True))


def test_whom_links_do_not_join_at_the_start_nothing_is_tried_for() -> None:
    starts = [Enu(300.0 * i, 0, 65) for i in range(40)]
    goals = [Enu(10.0 * i, 0, 65) for i in range(40)]
    drawn: list[None] = []
    chosen, is_one = keep_together(
        starts, goals, lambda *_: 0.0, reach_m=REACH_M, random=lambda: drawn.append(None) or 0.5
    )
    assert (chosen, is_one) == (list(range(40)), True)
    assert not drawn


def test_who_is_joined_with_nobody_at_the_start_does_not_stop_the_others_from_staying_together() -> None:
    pattern = fitted(45, Demands(2500, 131, REACH_M, 65, 7.5))
    assert pattern is not None
    begun = pattern.begun_around(GRID)[0]
    goals = [begun.at(place, 0.0) for place in range(45)]
    starts = [*GRID[:-1], Enu(3000, 3000, 65)]
    chosen, is_one = keep_together(starts, goals, lambda *_: 0.0, reach_m=REACH_M, random=Random(1).random)
    assert is_one
    assert not torn(starts[:-1], goals, chosen[:-1])


def test_where_no_link_can_last_everybody_has_the_shortest_way() -> None:
    starts = [Enu(0, 0, 65), Enu(100, 0, 65)]
    goals = [Enu(1000, 0, 65), Enu(-1000, 0, 65)]
    assert keep_together(starts, goals, lambda *_: 0.0, reach_m=REACH_M, random=Random(1).random) == ([1, 0], False)
    assert math.isclose(max(ways_m(starts, goals, [1, 0])), 1000)
