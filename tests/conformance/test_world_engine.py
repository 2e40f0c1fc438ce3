"""The engine contract, run against every engine."""

from collections.abc import Iterator

import numpy as np
import pytest

from fanet_mw.units import Enu
from sim.scenarios import catalog
from sim.world.arrays import Rows
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.pybullet import Physics
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import CRAZYFLIE, IRIS
from sim.world.environment.obstacles import Box, Obstacles
from sim.world.environment.survivors import place
from sim.world.mobility.guidance import Guidance
from sim.world.sensors.phone import PhoneSensor

FAR_AWAY = Obstacles(hills=None, boxes=(Box(400, 400, 30, 30, 60),))


@pytest.fixture(
    params=[
        "kinematic",
        "pybullet",
        "pybullet with a building",
        "rotors",
        pytest.param("crazyflies", marks=pytest.mark.slow),
    ]
)
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    made: Engine
    if request.param == "kinematic":
        made = Kinematic()
    elif request.param == "crazyflies":
        made = Rotors(CRAZYFLIE)
    elif request.param == "rotors":
        made = Rotors(IRIS)
    else:
        made = Physics(physics_hz=240, obstacles=FAR_AWAY if "building" in request.param else None)
    yield made
    made.close()


def fly(engine: Engine, wanted: Rows, seconds: float) -> None:
    for _ in range(round(seconds / 0.05)):
        engine.advance(0.05, wanted)


def test_bodies_at_rest_stay_where_they_were_put(engine: Engine) -> None:
    start = np.array([[0.0, 0, 50], [10, 0, 50]])
    engine.reset(start)
    fly(engine, np.zeros_like(start), 5)
    assert np.abs(engine.positions() - start).max() < 0.1
    assert engine.contacts() == []


def test_bodies_that_are_put_in_flight_fly_on(engine: Engine) -> None:
    start, velocity = np.array([[0.0, 0, 50], [50, 0, 50]]), np.array([[5.0, 0, 0], [0, -3, 0]])
    engine.reset(start, velocity)
    assert (engine.positions() == start).all()
    assert (engine.velocities() == velocity).all()
    fly(engine, velocity, 1)
    assert np.abs(engine.positions() - start - velocity).max() < 0.3


def test_a_wanted_velocity_is_reached_and_held(engine: Engine) -> None:
    engine.reset(np.array([[0.0, 0, 50]]))
    wanted = np.array([[8.0, -3.0, 1.0]])
    fly(engine, wanted, 6)
    assert np.abs(engine.velocities() - wanted).max() < 0.3


def test_acceleration_is_limited_as_thrust_is(engine: Engine) -> None:
    engine.reset(np.array([[0.0, 0, 50]]))
    fly(engine, np.array([[100.0, 0, 0]]), 1)
    assert 2 < engine.velocities()[0, 0] < 20


def test_nobody_is_told_to_fall_as_fast_as_without_power(engine: Engine) -> None:
    """Rotors go on turning, so that a UAV can be tilted: the thrust is never nothing."""
    engine.reset(np.array([[0.0, 0, 500]]))
    fly(engine, np.array([[0.0, 0, -100]]), 1)
    assert -8.5 < engine.velocities()[0, 2] < -2


def test_the_ground_stops_a_fall_and_is_noticed_once(engine: Engine) -> None:
    engine.reset(np.array([[0.0, 0, 5]]))
    fly(engine, np.array([[0.0, 0, -4]]), 5)
    assert engine.positions()[0, 2] >= -0.05
    assert engine.contacts() == [(0, 1)]
    fly(engine, np.array([[0.0, 0, -4]]), 1)
    assert engine.contacts() == []


def test_bodies_that_meet_are_noticed(engine: Engine) -> None:
    engine.reset(np.array([[0.0, 0, 50], [6, 0, 50]]))
    fly(engine, np.array([[2.0, 0, 0], [-2, 0, 0]]), 3)
    assert engine.contacts() == [(1, 2)]


def test_bodies_that_are_put_elsewhere_have_met_nobody_yet(engine: Engine) -> None:
    for _ in range(2):
        engine.reset(np.array([[0.0, 0, 50], [1.6, 0, 50]]))
        assert engine.contacts() == [], "nobody asked for those of before"
        fly(engine, np.array([[2.0, 0, 0], [-2, 0, 0]]), 1)
    assert engine.contacts()[0] == (1, 2)


def test_who_has_no_power_falls_whatever_is_wanted_of_it(engine: Engine) -> None:
    engine.reset(np.array([[0.0, 0, 50], [20, 0, 50]]))
    engine.fall(0)
    fly(engine, np.array([[0.0, 0, 5], [0, 0, 0]]), 1)
    assert engine.positions()[0] == pytest.approx([0, 0, 50 - 9.81 / 2], abs=1.5), "straight down"
    fly(engine, np.array([[0.0, 0, 5], [0, 0, 0]]), 6)
    assert engine.positions()[0] == pytest.approx([0, 0, 0], abs=0.3)
    assert engine.positions()[1, 2] == pytest.approx(50, abs=0.2)
    assert set(engine.contacts()) == {(0, 1)}, "more than once where bodies bounce"


def test_the_same_calls_give_the_same_bytes(engine: Engine) -> None:
    def run() -> bytes:
        engine.reset(np.array([[0.0, 0, 50], [3, 0, 50]]))
        fly(engine, np.array([[2.0, 1, 0], [-2, 0, 1]]), 2)
        return engine.positions().tobytes()

    assert run() == run()


def test_ten_uavs_sent_to_one_point_settle_around_it_and_never_touch(engine: Engine) -> None:
    scenario = catalog.find("quick", ["nodes.count=10", "mobility.model=static"])
    start = np.array([[60.0 * np.cos(i), 60.0 * np.sin(i), 50.0] for i in range(10)])
    guidance = Guidance(start, scenario)
    engine.reset(start)
    for node in range(1, 11):
        guidance.steer(node, Enu(0, 0, 50), speed_m_s=10)
    for step in range(300):  # 15 s; the flight takes 6 s
        engine.advance(0.05, guidance.wanted(step * 0.05, engine.positions()))
        assert engine.contacts() == []
    assert np.linalg.norm(engine.positions() - [0, 0, 50], axis=1).max() < 40


def test_random_waypoints_keep_the_speed_and_the_area() -> None:
    scenario = catalog.find("quick", ["mobility.model=random_waypoint", "mobility.speed_m_s=20"])
    start = np.array([[0.0, 0, 50]] * 9)
    guidance = Guidance(start, scenario)
    before = guidance.track(0).places.copy()
    for tenth in range(1, 2000):
        places, velocities = guidance.track(tenth / 10)
        moved = np.linalg.norm(places[1:] - before[1:], axis=1)
        assert (moved <= 2.0 + 1e-6).all()
        assert np.abs(places).max() <= 400
        assert np.allclose(np.linalg.norm(velocities[1:], axis=1), 20)
        before = places.copy()
    assert (places[0] == start[0]).all(), "the leader stays"


def test_shadowing_of_a_place_is_the_same_every_time_and_power_falls_with_distance() -> None:
    scenario = catalog.find("rescue", ["mission.survivors=1", "mission.phone_rice_db=100", "mission.rssi_sigma_db=0"])
    phone = place(scenario)[0]
    sensor = PhoneSensor(scenario)
    above = np.array([phone.east, phone.north, 50.0])
    assert sensor.scan(above) == sensor.scan(above) == PhoneSensor(scenario).scan(above)
    assert sensor.scan(above)[0][0] == 1
    assert sensor.scan(above + np.array([5000.0, 0, 0])) == ()
