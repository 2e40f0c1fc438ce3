"""The heights at which flight controllers return over uneven ground, without a world."""

import numpy as np
import pytest
from kit import MakeScenario

from fanet_mw.units import Enu
from sim.world.mobility.return_mode import ReturnMode

GROUND_M = (5.0, 40.0, 12.0)
"""The height of the ground at the homes of three UAVs."""


@pytest.fixture
def mode(make_scenario: MakeScenario) -> ReturnMode:
    scenario = make_scenario(**{
        "nodes.count": 3, "mobility.model": "onboard", "mobility.return_after_s": 2,
        "mobility.return_height_m": 30, "mobility.return_step_m": 4,
    })  # fmt: skip
    starts = np.array([[0.0, 0.0, 70.0], [100.0, 0.0, 70.0], [200.0, 0.0, 70.0]])
    return ReturnMode(starts, scenario, surface_m=lambda _places: np.array(GROUND_M))


def test_heights_count_from_the_highest_home(mode: ReturnMode) -> None:
    """A UAV that flies home from a valley must not fly into the hill on which another one has its home."""
    assert [mode.way(row, Enu(50.0, 50.0, 6.0)).home.up for row in range(3)] == [70.0, 74.0, 78.0]


def test_a_uav_lands_above_its_own_home(mode: ReturnMode) -> None:
    way = mode.way(2, Enu(50.0, 50.0, 6.0))
    assert way.goal(Enu(50.0, 50.0, 6.0)) == Enu(50.0, 50.0, 78.0), "it climbs where it is"
    assert way.goal(Enu(50.0, 50.0, 77.6)) == Enu(200.0, 0.0, 78.0)
    assert way.goal(Enu(199.0, 0.0, 78.0)) is None


def test_silence_counts_from_the_take_off(mode: ReturnMode) -> None:
    """A UAV that stood on its pad for long after its last setpoint does not return as soon as it flies."""
    at, beyond = np.array([[0.0, 0.0, 70.0]] * 3), np.zeros(3, dtype=bool)
    for row in range(3):
        mode.on_setpoint(row, 1.0)
    assert [list(mode.due((0, 1), at, beyond, t_s)) for t_s in (1.5, 2.0, 2.9)] == [[], [], []]
    assert [row for row, _ in mode.due((0, 1, 2), at, beyond, 3.0)] == [0, 1], "2 has been flying for a moment"
    assert [row for row, _ in mode.due((0, 1, 2), at, beyond, 4.9)] == [0, 1, 2]
