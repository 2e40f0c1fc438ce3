"""The estimate of the wind: how fast it follows the air."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from fanet_mw.bus.messages import WindEstimate
from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment.wind import Wind
from sim.world.sensors.contract import Truth
from sim.world.sensors.wind import WindSensor


@pytest.mark.parametrize("wind_hz", [1, 4])
def test_an_estimate_follows_a_steady_wind_with_a_time_constant_of_ten_seconds(
    make_scenario: Callable[..., Scenario], wind_hz: int
) -> None:
    scenario = make_scenario(**{"nodes.count": 1, "sensors.wind_hz": wind_hz, "sensors.wind_sigma_m_s": 0})
    engine = Rotors(IRIS, wind=Wind(np.random.default_rng(1), 1, mean_m_s=(8.0, -2.0), w20_m_s=0.0))
    engine.reset(np.array([[0.0, 0.0, 50.0]]))
    engine.advance(0.1, np.zeros((1, 3)))
    sensor = WindSensor(scenario, engine)
    at_rest = np.zeros((1, 3))
    for reading in range(10 * wind_hz):
        ((_, told),) = sensor.read(Truth(reading * S // wind_hz, at_rest, at_rest), [0])
    assert isinstance(told, WindEstimate)
    share = 1 - math.exp(-1)
    assert (told.velocity.east, told.velocity.north) == pytest.approx((8 * share, -2 * share), rel=1e-6)
