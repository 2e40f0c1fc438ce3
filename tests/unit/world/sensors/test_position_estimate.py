"""Flight controllers fly on what they have measured: GPS with its errors, and without GPS as a Pixhawk does."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fanet_mw.bus.messages import SetpointKind
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, S
from sim.world.sensors.contract import Truth
from sim.world.sensors.gps import GpsReceiver
from sim.world.sensors.position_estimate import PositionEstimate
from tests.unit.world.mobility.test_setpoints import Flying

MakeScenario = Callable[..., Scenario]
OUT = {"sensors.gps_outages": ((0, 0, 9000, 10, 9000),)}


def flying(make_scenario: MakeScenario, seed: int = 1, **keys: Any) -> Flying:
    made = Flying(make_scenario, seed=seed, **{"world.navigation": "estimated", **keys})
    for node in (1, 2):
        made.ask(node, SetpointKind.POSITION, Enu(100.0 * node, 20.0, 40.0), speed_m_s=8.0)
    return made


def misses_m(make_scenario: MakeScenario, **keys: Any) -> np.ndarray:
    """By how much UAVs miss the places to which they were sent [runs, 3]; one UAV of each run."""
    return np.array([flying(make_scenario, seed, **keys).fly(22).at(1) - [100, 20, 40] for seed in range(10)])


def test_a_uav_flies_to_where_its_gps_says_that_the_place_is(make_scenario: MakeScenario) -> None:
    """2.5 m CEP: half of all UAVs are farther from the place than that; the height is that of a barometer."""
    missed = misses_m(make_scenario)
    assert 1.5 < np.median(np.hypot(missed[:, 0], missed[:, 1])) < 3.8
    assert 0.4 < missed[:, 2].std() < 1.8


def test_the_perfect_one_is_a_choice(make_scenario: MakeScenario) -> None:
    made = flying(make_scenario, **{"world.navigation": "perfect"}).fly(60)
    assert made.at(1) == pytest.approx([100, 20, 40], abs=0.05)


def test_fixes_that_are_far_off_take_a_uav_far_off(make_scenario: MakeScenario) -> None:
    missed = misses_m(make_scenario, **{"sensors.gps_common_m": 60.0})
    assert 30 < np.sqrt((missed[:, :2] ** 2).mean()) < 100


def test_a_uav_that_holds_its_place_drifts_with_its_fixes(make_scenario: MakeScenario) -> None:
    keys = {"sensors.gps_common_time_s": 60.0, "sensors.gps_common_m": 5.0}
    made = flying(make_scenario, **keys).fly(40)
    made.ask(1, SetpointKind.HOLD)
    places = np.array([made.fly(1).at(1) for _ in range(60)])
    assert np.ptp(places, axis=0)[:2].min() > 1.0


def test_without_gps_a_uav_lands_after_five_seconds_and_drifts_as_it_does(make_scenario: MakeScenario) -> None:
    made = flying(make_scenario, **OUT).fly(14)
    assert (1, "failsafe") not in made.modes
    made.fly(3)
    assert (1, "failsafe") in made.modes
    made.fly(40)
    assert made.at(1)[2] < 0.5
    assert made.velocity(1) == pytest.approx([0, 0, 0], abs=0.01)


@pytest.mark.slow
def test_without_gps_the_wind_takes_a_uav_along_as_it_sinks(make_scenario: MakeScenario) -> None:
    """FlightTaskDescend of PX4 stays level: the velocity of the air is reached within m / (4 lambda w) = 7 s."""
    out = {"sensors.gps_outages": ((0, 0, 9000, 16, 9000),)}
    wind = {"world.engine": "rotors", "world.area_m": 2000.0, "world.wind_m_s": (8.0, 0.0)}
    made = flying(make_scenario, **out, **wind).fly(21.1)
    before, sinks_s = made.at(1), 40 / 2 + 2
    made.fly(30)
    assert made.at(1)[2] < 0.5
    assert (made.at(1) - before)[:2] == pytest.approx([8 * (sinks_s - 7), 0], abs=40)


def test_with_optical_flow_a_uav_flies_on_without_gps(make_scenario: MakeScenario) -> None:
    made = flying(make_scenario, **OUT, **{"sensors.inertial_hz": 5}).fly(70)
    assert (1, "failsafe") not in made.modes
    assert np.linalg.norm(made.at(1)[:2] - [100, 20]) < 25


@pytest.mark.parametrize("flow", [False, True])
def test_dead_reckoning_drifts_as_integrals_of_gauss_markov_processes_do(
    make_scenario: MakeScenario, flow: bool
) -> None:
    """After t s: 0.05 m/s2 t^2 / 2 with inertial sensors alone; with flow 0.05 m/s times t, for t well below 100 s."""
    keys = {"sensors.inertial_hz": 5 if flow else 0, "sensors.gps_outages": ((0, 0, 9000, 0.05, 9000),)}
    scenario = make_scenario(**{"nodes.count": 800, **keys})
    estimate, at = PositionEstimate(scenario, GpsReceiver(scenario)), np.zeros((800, 3))
    estimate.advance(Truth(0, at, at))
    before = estimate.off_m.copy()
    for tick in range(1, 201):
        estimate.advance(Truth(tick * S // 10, at, at))
    spread = float((estimate.off_m - before)[:, :2].std())
    law = 0.05 * 20 * math.sqrt(1 - 20 / 300) if flow else 0.05 * 20**2 / 2 * math.sqrt(1 - 20 / 250)
    assert spread == pytest.approx(law, rel=0.08 if not flow else 0.15)


@pytest.mark.slow
def test_a_return_and_the_geofence_go_by_the_estimate(make_scenario: MakeScenario) -> None:
    keys = {"sensors.gps_common_m": 40.0, "mobility.geofence": "return", "mobility.return_height_m": 30.0}
    off = []
    for seed in range(4):
        made = flying(make_scenario, seed, **keys).fly(20)
        made.ask(1, SetpointKind.RETURN)
        off.append(made.fly(80).at(1) - [-50, 0, 0])
    assert np.abs(off)[:, 2].max() < 0.5
    assert np.sqrt((np.array(off)[:, :2] ** 2).mean()) > 12, "beside its pad, by as much as its fixes are off"
