"""Bodies at walls: nobody hangs on one, and nobody lands on one."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from kit import slow

from fanet_mw.bus.messages import SetpointKind
from fanet_mw.scenario import Scenario
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment.obstacles import Box, Obstacles
from sim.world.environment.solids import Solids
from tests.unit.world.mobility.test_setpoints import Flying

MakeScenario = Callable[..., Scenario]
WALL = Solids(Obstacles(None, (Box(20.0, 0.0, 10.0, 40.0, 60.0),)))


def at_wall(engine: Engine, up_m_s: float, seconds: float) -> np.ndarray:
    """Where a body is that was flown against a wall at 5 m/s, and on into it and up or down."""
    engine.reset(np.array([[5.0, 0.0, 12.0]]))
    for _ in range(70):
        engine.advance(0.05, np.array([[5.0, 0.0, 0.0]]))
    assert engine.positions()[0, 0] == pytest.approx(15, abs=0.1)
    for _ in range(round(20 * seconds)):
        engine.advance(0.05, np.array([[5.0, 0.0, up_m_s]]))
    return engine.positions()[0]


@pytest.mark.parametrize("engine", [Kinematic(WALL), *slow(Rotors(IRIS, solids=WALL))])
def test_a_body_at_a_wall_sinks_beside_it(engine: Engine) -> None:
    assert at_wall(engine, -3.0, 7)[2] < 0.5


@pytest.mark.parametrize("engine", [Kinematic(WALL), *slow(Rotors(IRIS, solids=WALL))])
def test_a_wreck_falls_from_a_wall(engine: Engine) -> None:
    at_wall(engine, 0.0, 0)
    engine.fall(0)
    for _ in range(80):
        engine.advance(0.05, np.array([[5.0, 0.0, 0.0]]))
    assert engine.positions()[0, 2] < 0.5


@pytest.mark.parametrize("solids", [None, Solids(Obstacles(None, (Box(80.0, 0.0, 10.0, 10.0, 20.0),)))])
def test_whoever_has_come_down_lies_level_and_still(solids: Solids | None) -> None:
    """It lost its power while it turned to the side."""
    engine = Rotors(IRIS, solids=solids)
    engine.reset(np.array([[0.0, 0.0, 3.0]]))
    for _ in range(4):
        engine.advance(0.05, np.array([[8.0, 3.0, 0.0]]))
    assert abs(engine._attitude[1:, 0]).max() > 0.05
    engine.fall(0)
    for _ in range(60):
        engine.advance(0.05, np.zeros((1, 3)))
    assert engine.positions()[0, 2] == pytest.approx(0.0, abs=0.05)
    assert engine._attitude[:, 0].tolist() == pytest.approx([1, 0, 0, 0], abs=1e-3)
    assert abs(engine._rates).max() < 0.1


def test_a_body_without_power_turns_less_by_e_in_each_half_second() -> None:
    engine = Rotors(IRIS)
    engine.reset(np.array([[0.0, 0.0, 900.0]]))
    for _ in range(3):
        engine.advance(0.05, np.array([[8.0, 3.0, 0.0]]))
    engine.fall(0)
    engine.advance(0.05, np.zeros((1, 3)))
    before = engine._rates[:, 0].copy()
    assert abs(before).max() > 0.1
    for _ in range(10):
        engine.advance(0.05, np.zeros((1, 3)))
    assert engine._rates[:, 0] == pytest.approx(before / np.e, rel=0.02)


@pytest.mark.slow
def test_who_is_blown_against_a_wall_while_it_lands_has_not_landed(make_scenario: MakeScenario) -> None:
    keys: dict[str, Any] = {
        "nodes.count": 1, "nodes.altitude_m": 40, "world.area_m": 2000.0, "world.navigation": "estimated",
        "world.buildings": ((40, 0, 20, 300, 90),), "world.crash": "falls",
        "world.engine": "rotors", "world.wind_m_s": (12.0, 0.0), "sensors.gps_outages": ((0, 0, 9000, 1, 9000),),
    }  # fmt: skip
    flying = Flying(make_scenario, **keys)
    flying.ask(1, SetpointKind.HOLD)
    flying.fly(20)
    assert (1, "failsafe") in flying.modes
    assert flying.collisions == [(1, 0)]
    assert flying.at(1) == pytest.approx([30, 0, 0], abs=12)
