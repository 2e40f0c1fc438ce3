"""Bodies of the pybullet engine by hand: a fall with drag, and how hard thrust and tilt can push."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from sim.world.engines.pybullet import MASS_KG, Physics

G, DRAG_PER_S = 9.81, 0.25 / MASS_KG


@pytest.fixture
def engine() -> Iterator[Physics]:
    made = Physics(physics_hz=240)
    made.reset(np.array([[0.0, 0, 500], [40, 0, 500]]))
    yield made
    made.close()


def flown(engine: Physics, wanted: tuple[float, float, float], seconds: float) -> np.ndarray:
    for _ in range(round(20 * seconds)):
        engine.advance(0.05, np.array([wanted, (0.0, 0.0, 0.0)]))
    return engine.velocities()[0]


def test_a_wreck_falls_as_gravity_and_drag_have_it_and_nobody_else(engine: Physics) -> None:
    engine.fall(0)
    for second in (1, 2, 3):
        fallen_m_s = G / DRAG_PER_S * (1 - math.exp(-DRAG_PER_S * second))
        assert flown(engine, (0, 0, 0), 1.0) == pytest.approx([0, 0, -fallen_m_s], rel=0.01)
    assert engine.positions()[1] == pytest.approx([40, 0, 500], abs=0.01)


@pytest.mark.parametrize(
    ("wanted", "push_m_s2"),
    [
        ((0, 0, 50), (0, 0, G)),  # thrust is twice the weight at most
        ((0, 0, -50), (0, 0, -0.8 * G)),  # and a fifth of it at least
        ((50, 0, 0), (G * math.tan(math.radians(35)), 0, 0)),  # no steeper than 35 degrees
        ((-30, -40, 0), (-0.6 * G * math.tan(math.radians(35)), -0.8 * G * math.tan(math.radians(35)), 0)),
        ((50, 0, 3), (math.sqrt(4 * G * G - (2.5 * 3 + G) ** 2), 0, 2.5 * 3)),  # all thrust, climbing first
    ],
)
def test_thrust_and_tilt_push_so_hard_and_no_harder(
    engine: Physics, wanted: tuple[float, float, float], push_m_s2: tuple[float, float, float]
) -> None:
    pushed = flown(engine, wanted, 0.05)
    assert pushed == pytest.approx(np.array(push_m_s2) * 0.05, rel=0.08, abs=1e-6)


def test_a_velocity_within_its_power_is_reached_by_e_in_each_four_tenths_of_a_second_and_held(engine: Physics) -> None:
    """The gain of the loop is 2.5 per second, and drag is made up for."""
    assert flown(engine, (2, -1, 1), 0.4) == pytest.approx(np.array([2, -1, 1]) * (1 - 1 / math.e), rel=0.03)
    assert flown(engine, (2, -1, 1), 5.0) == pytest.approx([2, -1, 1], rel=0.001)
    at = engine.positions()[0].copy()
    flown(engine, (2, -1, 1), 1.0)
    assert engine.positions()[0] - at == pytest.approx([2, -1, 1], rel=0.001)
