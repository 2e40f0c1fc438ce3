"""Losses over edges, against ITU-R P.526-15: the curve of J(nu), and hills and buildings laid out by hand."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emulator.faults import Faults
from emulator.kernel.state import LINK_POWER
from emulator.kernel_interface import KernelInterface
from fanet_mw.bus.messages import Obstructions
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import config
from sim.world.environment.layout import positions
from sim.world.environment.line_of_sight import knife_edge_db, loss_db
from sim.world.environment.obstacles import obstacles
from sim.world.environment.solids import Solids
from sim.world.world import WorldActor

WAVE_M = 299_792_458 / 2.412e9


def solids(**world: Any) -> Solids:
    scenario = config.build({"world": {"area_m": 1000, **world}})
    return Solids(obstacles(scenario, np.array([[-400.0, -400.0, 200.0]])))


def lost_db(of: Solids, first: tuple[float, float, float], second: tuple[float, float, float]) -> float:
    return float(loss_db(of, np.array([first]), np.array([second]), wavelength_m=WAVE_M)[0])


@pytest.mark.parametrize(
    ("nu", "db"),
    [(-0.78, 0.0), (-0.5, 1.9), (0.0, 6.0), (0.5, 10.3), (1.0, 13.9), (2.0, 19.1), (2.4, 20.5), (3.0, 22.4)],
)
def test_the_loss_of_an_edge_is_that_of_figure_9_of_p_526(nu: float, db: float) -> None:
    """Read from the curve to 0.15 dB, and the exact Fresnel integral, which it approximates: 6.02 dB at 0."""
    t = np.linspace(nu, 200.0, 4_000_001)
    if nu > -0.78:
        step, phase = t[1] - t[0], math.pi / 2 * t**2
        whole = np.trapezoid(np.cos(phase), dx=step) + 1j * np.trapezoid(np.sin(phase), dx=step)
        assert db == pytest.approx(-20 * math.log10(abs(whole) / math.sqrt(2)), abs=0.3)
    assert float(knife_edge_db(np.array([nu]))[0]) == pytest.approx(db, abs=0.15)


@pytest.mark.parametrize(("height_m", "db"), [(20.0, 6.0), (22.5, 12.7), (30.0, 23.2), (60.0, 35.2)])
def test_a_wide_wall_in_the_middle_costs_what_its_roof_is_above_the_line(height_m: float, db: float) -> None:
    """600 m apart, 20 m up, and a wall 1 km wide and thin: nu = h sqrt(2 / 0.1243 (1 / 300 + 1 / 300))."""
    wall = solids(buildings=[[0, 0, 0.2, 1000, height_m]])
    nu = (height_m - 20) * math.sqrt(2 / WAVE_M * 2 / 300)
    expected = 6.9 + 20 * math.log10(math.sqrt((nu - 0.1) ** 2 + 1) + nu - 0.1)
    found = lost_db(wall, (-300, 0, 20), (300, 0, 20))
    assert found == pytest.approx(expected, abs=0.05)
    assert found == pytest.approx(db, abs=0.2)
    assert lost_db(wall, (300, 0, 20), (-300, 0, 20)) == pytest.approx(found, abs=1e-9)


def test_an_edge_near_an_end_costs_more() -> None:
    wall = solids(buildings=[[0, 0, 0.2, 1000, 30]])
    nu = 10 * math.sqrt(2 / WAVE_M * (1 / 30 + 1 / 400))
    expected = 6.9 + 20 * math.log10(math.sqrt((nu - 0.1) ** 2 + 1) + nu - 0.1)
    assert lost_db(wall, (-30, 0, 20), (400, 0, 20)) == pytest.approx(expected, abs=0.05)
    assert expected > 29


def test_a_tower_costs_the_easiest_way_around_it() -> None:
    tower = solids(buildings=[[0, 0, 10, 10, 100]])
    nu = 2.0 * math.sqrt(2 / WAVE_M * (1 / 305 + 1 / 295))  # the line passes 3 m north of the middle
    expected = 6.9 + 20 * math.log10(math.sqrt((nu - 0.1) ** 2 + 1) + nu - 0.1)
    assert lost_db(tower, (-300, 3, 20), (300, 3, 20)) == pytest.approx(expected, abs=0.15)
    assert lost_db(tower, (-300, 30, 20), (300, 30, 20)) == 0.0
    assert lost_db(tower, (-300, 0, 120), (300, 0, 120)) == 0.0
    assert lost_db(tower, (12, 0, 20), (100, 0, 20)) == 0.0, "it stands behind one of them"


def test_a_slope_is_no_edge_and_a_ridge_is(tmp_path: Any) -> None:
    def grid(heights: Any) -> Solids:
        rows = "\n".join(" ".join(f"{heights(10 * x - 500):g}" for x in range(101)) for _ in range(101))
        (tmp_path / "a.asc").write_text(f"ncols 101\nnrows 101\nxllcorner 0\nyllcorner 0\ncellsize 10\n{rows}\n")
        found = solids(heightmap=str(tmp_path / "a.asc"))
        (tmp_path / "a.asc").unlink()
        return found

    slope = grid(lambda east: 50 + east / 10)
    assert lost_db(slope, (-300, 0, 21), (300, 0, 81)) == 0.0, "a metre above it"
    ridge = grid(lambda east: max(0.0, 40 - abs(east) / 2))
    nu = 20 * math.sqrt(2 / WAVE_M * 2 / 300)
    expected = 6.9 + 20 * math.log10(math.sqrt((nu - 0.1) ** 2 + 1) + nu - 0.1)
    assert lost_db(ridge, (-300, 0, 20), (300, 0, 20)) == pytest.approx(expected, abs=0.1)


@given(st.floats(-40, 40), st.floats(5, 60))
def test_the_loss_does_not_jump_as_a_node_moves(north: float, up: float) -> None:
    """A decimetre changes it by less than 1.5 dB, behind a house with corners as beside it."""
    house = solids(buildings=[[0, 0, 20, 12, 30]])
    before = lost_db(house, (-200, north, up), (200, 0, 20))
    assert abs(lost_db(house, (-200, north + 0.1, up + 0.1), (200, 0, 20)) - before) < 1.5
    assert 0 <= before < 45


def test_the_world_tells_the_loss_and_the_medium_takes_it_off(make_scenario: Any) -> None:
    scenario = make_scenario(**{
        "nodes.count": 3, "nodes.layout": "explicit",
        "nodes.positions_m": ((-300, 0, 20), (300, 0, 20), (0, 0, 80)), "radio.channel": "friis",
        "world.area_m": 1000, "world.buildings": ((0, 0, 0.2, 1000, 30),),
    })  # fmt: skip
    world = WorldActor(scenario, "test")
    world.start(0)
    (told,) = [message for topic, message in world.outbox if topic == Topics("test").obstruction]
    assert isinstance(told, Obstructions)
    assert (told.pairs.tolist(), told.losses_ddb.tolist()) == ([1, 2], [232])
    world.stop(0)


@pytest.mark.parametrize("channel", ["two_ray", "air_to_ground", "uma_av"])
def test_a_hill_does_not_raise_antennas_above_the_ground_they_stand_on(make_scenario: Any, channel: str) -> None:
    """Two antennas 2 m above a plateau, 1 km apart, lose what they lose on the plain; so the world says how high the
    ground is.
    """
    scenario = make_scenario(**{"nodes.count": 2, "radio.channel": channel, "radio.interference_floor_dbm": -170.0,
                                "radio.sensitivity_dbm": -90.0})  # fmt: skip

    def power_mw(hill_m: float) -> float:
        kernel = KernelInterface(scenario, stations=2, faults=Faults(scenario.radio, stations=2, uavs=2))
        none = np.zeros((0, 2), np.int64), np.zeros(0)
        kernel.obstruct(*none, np.full(2, hill_m))
        kernel.place(np.array([[0.0, 0, hill_m + 2], [1000, 0, hill_m + 2]]), np.zeros((2, 3)), 0)
        return float(kernel.arrays.lp[LINK_POWER, 0])

    assert power_mw(60.0) == pytest.approx(power_mw(0.0)) != 0

    hilly = make_scenario(**{"nodes.count": 3, "radio.channel": channel, "world.terrain_m": 30.0,
                             "nodes.altitude_m": 60.0, "world.area_m": 800.0})  # fmt: skip
    world = WorldActor(hilly, "test")
    world.start(0)
    (told,) = [message for topic, message in world.outbox if topic == Topics("test").obstruction]
    at = np.array(positions(hilly))
    assert isinstance(told, Obstructions)
    assert told.ground_m.tolist() == pytest.approx(Solids(obstacles(hilly, at)).ground_m(at).tolist(), abs=1e-4)
    assert max(told.ground_m) > 1
    world.stop(0)
