"""Where each UAV should be, by mobility model and setpoint."""

from collections.abc import Callable

import numpy as np
import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu
from sim.world.mobility.geofence import FLOOR_M
from sim.world.mobility.guidance import Guidance

STARTS = np.array([[0.0, 0, 50], [100, 0, 50], [0, 100, 50]])
MakeScenario = Callable[..., Scenario]


def guidance(make_scenario: MakeScenario, model: str, **keys: object) -> Guidance:
    given = {"nodes.count": 3, "mobility.model": model, "mobility.speed_m_s": 10, "world.area_m": 1000}
    return Guidance(STARTS, make_scenario(**given, **keys))


def flown_to(found: Guidance, place: Enu) -> np.ndarray:
    """Where a UAV that follows a setpoint ends up."""
    found.steer(2, place, speed_m_s=20)
    at = STARTS.copy()
    for step in range(4000):
        wanted = found.wanted(0.05 * step, at)
        at = at + 0.05 * wanted
    return at[1]


@pytest.mark.parametrize(
    ("place", "end"),
    [
        (Enu(300, -200, 80), (300, -200, 80)),
        (Enu(9000, 0, 80), (500, 0, 80)),
        (Enu(0, -9000, 80), (0, -500, 80)),
        (Enu(300, 300, -10), (300, 300, FLOOR_M)),
    ],
)
def test_nobody_is_sent_out_of_the_area_or_into_the_ground(
    make_scenario: MakeScenario, place: Enu, end: tuple[float, float, float]
) -> None:
    assert flown_to(guidance(make_scenario, "static"), place) == pytest.approx(end, abs=0.5)


def test_a_speed_of_0_sends_a_uav_back(make_scenario: MakeScenario) -> None:
    found = guidance(make_scenario, "static")
    assert found.still
    found.steer(2, Enu(300, 300, 60), speed_m_s=8)
    assert not found.still
    found.steer(2, Enu(300, 300, 60), speed_m_s=0)
    assert found.still


def test_a_formation_goes_round_the_area_again_and_again_at_its_speed(make_scenario: MakeScenario) -> None:
    found = guidance(make_scenario, "formation")
    offsets = [found.track(t_s).places - STARTS for t_s in range(0, 3000, 5)]
    for offset in offsets:
        assert np.abs(offset - offset[0]).max() < 1e-9, "the layout moves as one"
    way = np.array([offset[0, :2] for offset in offsets])
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    assert steps.max() <= 50 + 1e-6
    assert np.median(steps) == pytest.approx(50)
    assert (steps > 30).all(), "it never stops, whatever the round"


def test_a_formation_flies_from_its_base_to_the_middle_and_then_goes_round_within_the_area(
    make_scenario: MakeScenario,
) -> None:
    base = np.array([0.0, -1750.0, 0.0])
    scenario = make_scenario(**{
        "nodes.count": 3, "mobility.model": "formation", "mobility.speed_m_s": 10, "world.area_m": 1000,
        "world.base_m": (0, -1750),
    })  # fmt: skip
    found = Guidance(STARTS + base, scenario)
    for t_s in (0, 50, 175):
        assert found.track(t_s).places == pytest.approx(STARTS + base + [0, 10 * t_s, 0], abs=1e-9)
    way = np.array([found.track(t_s).places[:, :2] for t_s in range(175, 3000, 5)])
    assert np.abs(way).max() <= 500 + 1e-6
    assert (way[:, 0] == 0).all(axis=1).sum() == 1, "it comes to the middle once only"


def test_who_crosses_goes_to_the_opposite_point_and_back(make_scenario: MakeScenario) -> None:
    found = guidance(make_scenario, "crossing")
    east = [found.track(t_s).places[1, 0] for t_s in (0, 10, 20, 30, 40, 50)]
    assert east == pytest.approx([100, 0, -100, 0, 100, 0], abs=1e-6)
    assert [found.track(t_s).velocities[1, 0] for t_s in (5, 25, 45)] == pytest.approx([-10, 10, -10])


def test_two_that_are_near_are_pushed_apart(make_scenario: MakeScenario) -> None:
    found = guidance(make_scenario, "static", **{"mobility.see_m": 50})
    at = np.array([[0.0, 0, 50], [2, 0, 50], [0, 100, 50]])
    wanted = found.wanted(0.0, at)
    toward_home = found.wanted(0.0, np.array([[0.0, 0, 50], [2, 500, 50], [0, 100, 50]]))
    assert wanted[0, 0] < toward_home[0, 0] - 1, "pushed back by the one at 2 m"
