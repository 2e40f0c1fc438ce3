"""Contacts are found by the closest approach within a step, in every engine, at any speed and in any crowd."""

import numpy as np
import pytest
from kit import slow

from sim.world.engines.contacts import approaches
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.pybullet import Physics
from sim.world.engines.quiet_pybullet import pybullet
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import CRAZYFLIE, IRIS
from sim.world.environment.obstacles import Box, Obstacles
from sim.world.environment.solids import Solids

WALLS = Obstacles(None, (Box(40, 0, 0.1, 400, 90),))
ENGINES = ("kinematic", "rotors", "pybullet")


def engine_of(name: str, solid: Obstacles | None = None) -> Engine:
    if name == "pybullet":
        return Physics(physics_hz=240, obstacles=solid)
    return Kinematic(Solids(solid)) if name == "kinematic" else Rotors(IRIS, solids=Solids(solid))


def test_the_reach_of_a_vehicle_is_that_of_its_blades() -> None:
    """An Iris: rotors 0.256 m from its middle, with propellers of 10 inches."""
    assert IRIS.reach_m == pytest.approx(0.256 + 0.127, abs=0.001)
    assert CRAZYFLIE.reach_m == pytest.approx(0.043 + 0.023, abs=0.001)


@pytest.mark.parametrize("count", [2, 30, *slow(450)])
def test_approaches_are_those_that_a_fine_scan_finds(count: int) -> None:
    random = np.random.default_rng(count)
    before = random.uniform(-20, 20, (count, 3))
    after = before + random.normal(0, 2, (count, 3))
    first, second, distance = approaches(before, after, within_m=1.5)
    share = np.linspace(0, 1, 400)[:, None, None]
    way = before + (after - before) * share
    a, b = np.triu_indices(count, k=1)
    least = np.full(len(a), np.inf)
    for at in way:
        np.minimum(least, np.linalg.norm(at[a] - at[b], axis=1), out=least)
    found = dict(zip(zip(first.tolist(), second.tolist(), strict=True), distance.tolist(), strict=True))
    for i, j, near in zip(a.tolist(), b.tolist(), least.tolist(), strict=True):
        assert found.get((i, j), 1.5) == pytest.approx(min(near, 1.5), abs=0.01)


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("speed_m_s", [15, 30, *slow(5, 25)])
def test_of_head_on_meetings_all_contacts_are_seen_whatever_the_phase(name: str, speed_m_s: float) -> None:
    """Sixty pairs, each apart from the others, with all offsets from 0 to 1.2 m across their ways."""
    across = np.linspace(0.0, 1.2, 60)
    rows = 10.0 * np.arange(60)
    phase = np.random.default_rng(1).uniform(20, 26, 60)
    west = np.stack([-phase, rows, np.full(60, 50.0)], axis=1)
    east = np.stack([phase, rows + across, np.full(60, 50.0)], axis=1)
    engine = engine_of(name)
    velocity = np.zeros((120, 3))
    velocity[:60, 0], velocity[60:, 0] = speed_m_s, -speed_m_s
    engine.reset(np.vstack([west, east]), velocity)
    for _ in range(round(30 / speed_m_s / 0.05)):
        engine.advance(0.05, velocity)
    touched = {(a, b) for a, b in engine.contacts() if b - a == 60}
    least = across if name != "rotors" else across - 0.02  # the control loops leave the ways by some millimetres
    sure = {(i + 1, i + 61) for i in np.flatnonzero(least < 2 * IRIS.reach_m - 0.05)}
    never = {(i + 1, i + 61) for i in np.flatnonzero(least > 2 * IRIS.reach_m + 0.05)}
    assert sure <= touched
    assert not never & touched
    engine.close()


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("speed_m_s", [30, *slow(5, 15)])
def test_no_wall_is_flown_through_or_past_without_a_contact(name: str, speed_m_s: float) -> None:
    starts = np.stack([np.linspace(0, 5, 20), 10.0 * np.arange(20) - 95, np.full(20, 50.0)], axis=1)
    velocity = np.tile([float(speed_m_s), 0, 0], (20, 1))
    engine = engine_of(name, WALLS)
    engine.reset(starts, velocity)
    for _ in range(round(60 / speed_m_s / 0.05)):
        engine.advance(0.05, velocity)
    assert {node for first, node in engine.contacts() if first == 0} == set(range(1, 21))
    assert (engine.positions()[:, 0] < 40).all()
    engine.close()


@pytest.mark.parametrize("name", ENGINES)
def test_a_wall_that_is_only_grazed_within_a_step_is_a_contact(name: str) -> None:
    """UAVs pass the end of a wall 0.1 m thick at 0.3 m, which is less than the reach of their blades, and at 0.6 m."""
    engine = engine_of(name, Obstacles(None, (Box(0, -50, 0.1, 100, 90),)))
    starts, velocity = np.array([[-21.3, 0.3, 50], [-30, 0.6, 50]]), np.tile([30.0, 0, 0], (2, 1))
    engine.reset(starts, velocity)
    for _ in range(40):
        engine.advance(0.05, velocity)
    assert engine.contacts() == [(0, 1)]
    engine.close()


def test_above_400_uavs_contacts_are_seen_as_below() -> None:
    def contacts(count: int) -> int:
        starts = np.random.default_rng(5).uniform(-8, 8, (401, 3))[:count] + np.array([0, 0, 50])
        engine = Kinematic()
        engine.reset(starts)
        engine.advance(0.05, np.zeros_like(starts))
        return len(engine.contacts())

    assert 2 * contacts(400) > contacts(401) >= contacts(400) > 10


def test_a_body_that_was_hit_is_not_turned_over() -> None:
    engine = engine_of("pybullet")
    velocity = np.array([[12.0, 0, 0], [-12.0, 0, 0]])
    engine.reset(np.array([[-10.0, 0, 50], [10, 0.4, 50]]), velocity)
    assert isinstance(engine, Physics)
    for _ in range(60):
        engine.advance(0.05, velocity)
    assert engine.contacts()[0] == (1, 2)
    for body in engine._bodies:
        assert pybullet.getBasePositionAndOrientation(body, engine._client)[1] == (0.0, 0.0, 0.0, 1.0)
    engine.close()
