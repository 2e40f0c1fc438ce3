"""The fastest formation uses every UAV that helps: one more is never slower, and many come near the physical bound."""

import math
from itertools import pairwise

import pytest

from agents.mission.search_formation.pattern import fastest
from agents.mission.search_formation.shapes.contract import Demands
from fanet_mw.wire.search_plan import MOST_PLACES

DEMANDS = Demands(area_m=1000, seen_m=131, reach_m=250, height_m=65, speed_m_s=7.5)


def sweep_s(count: int) -> float:
    pattern = fastest(count, DEMANDS)
    assert pattern is not None
    assert pattern.places == min(count, MOST_PLACES), "every UAV has a place"
    return pattern.shape.sweep_s


def test_one_more_uav_is_never_slower() -> None:
    times = [sweep_s(count) for count in range(1, 101)]
    assert all(more <= fewer for fewer, more in pairwise(times))


@pytest.mark.parametrize("area_m", [1000, 1600, 2500])
def test_any_number_of_uavs_is_near_the_bound_of_area_over_swath_and_speed(area_m: float) -> None:
    demands = DEMANDS._replace(area_m=area_m)
    for count in range(1, MOST_PLACES + 1):
        pattern = fastest(count, demands)
        assert pattern is not None
        bound_s = area_m**2 / (count * demands.apart_m(math.inf) * demands.speed_m_s)
        assert pattern.shape.sweep_s <= 1.2 * bound_s, count


def test_80_uavs_sweep_a_square_kilometre_in_a_fifth_of_the_time_of_two_lines() -> None:
    assert sweep_s(79) < 61 / 5
