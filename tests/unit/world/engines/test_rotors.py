"""Multirotors in full: rotors, power, batteries, gusts and control, against their laws and what is published."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from kit import slow

from fanet_mw.bus.messages import Battery, Poses, Setpoint, SetpointKind
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.world import FASTEST_AIR_M_S
from fanet_mw.units import Enu, S
from sim.world.arrays import Rows, Values
from sim.world.engines.battery_drain import Batteries, BatteryDrain
from sim.world.engines.contract import GRAVITY_M_S2
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.rotors.flight_control import allocation, body_up, conjugate, level_attitude, times
from sim.world.engines.rotors.power import induced_m_s, trimmed_w
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import (
    AIR_KG_M3,
    CRAZYFLIE,
    IRIS,
    VEHICLES,
    Cell,
    Vehicle,
    hover_rad_s,
)
from sim.world.environment.obstacles import Hills, Obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.wind import Wind, intensities_m_s, lengths_m
from sim.world.world import WorldActor

MakeScenario = Callable[..., Scenario]
EVERY = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=list(VEHICLES))
STEP_S = 0.05


def flown(engine: Rotors | Kinematic, wanted: Callable[[float, Rows], Rows], seconds: float) -> np.ndarray:
    """Positions and velocities of the first UAV, every 50 ms."""
    rows = []
    for step in range(round(seconds / STEP_S)):
        engine.advance(STEP_S, wanted(step * STEP_S, engine.positions()))
        rows.append(np.hstack([engine.positions()[0], engine.velocities()[0]]))
    return np.array(rows)


def hovering(vehicle: Vehicle, count: int = 1, wind: Wind | None = None) -> Rotors:
    engine = Rotors(vehicle, wind=wind)
    engine.reset(np.array([[20.0 * i, 0.0, 50.0] for i in range(count)]))
    return engine


# --- rotors and power -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("across", "through"), [(0.0, 0.0), (8.0, 0.0), (0.0, 4.0), (12.0, 3.0)])
def test_the_induced_velocity_solves_glauerts_equation(across: float, through: float) -> None:
    thrust, disc = np.array([3.7]), 0.05
    v = induced_m_s(thrust, np.array([across]), np.array([through]), disc_m2=disc)[0]
    assert v * math.hypot(across, through + v) == pytest.approx(3.7 / (2 * AIR_KG_M3 * disc), rel=0.01)


def test_a_climb_takes_at_least_the_weights_power_more() -> None:
    still, climbing = trimmed_w(IRIS, np.zeros(2), np.array([0.0, 5.0])).tolist()
    assert 1.0 < (climbing - still) * IRIS.drive_efficiency / (IRIS.mass_kg * GRAVITY_M_S2 * 5.0) * 2 < 2.0


def test_power_first_falls_with_speed_and_then_rises() -> None:
    """Rotors in clean air need less (translational lift), drag more: the valley of every helicopter."""
    hover, slow, fast = trimmed_w(IRIS, np.array([0.0, 5.0, 15.0]), np.zeros(3)).tolist()
    assert slow < 0.97 * hover
    assert fast > 1.2 * hover


@pytest.mark.parametrize(
    ("vehicle", "reserve", "least_min", "greatest_min"),
    [
        (IRIS, 0.2, 16 * (1.282 / 1.5) ** 1.5, 22 * (1.282 / 1.5) ** 1.5),  # 16 to 22 at 1.282 kg; power: mass^1.5
        (CRAZYFLIE, 0.0, 6.5, 7.5),
    ],
)
def test_the_battery_lasts_as_long_as_is_published(
    vehicle: Vehicle, reserve: float, least_min: float, greatest_min: float
) -> None:
    battery = Batteries(vehicle.battery, np.ones(1))
    hover_w = trimmed_w(vehicle, np.zeros(1), np.zeros(1))
    minutes = 0.0
    while battery.charge[0] > reserve:
        battery.drain(hover_w, 6.0)
        minutes += 0.1
    assert least_min < minutes < greatest_min


def test_a_battery_gives_the_power_that_is_taken_and_its_voltage_sags() -> None:
    battery = Batteries(Cell(cells=3, capacity_ah=5.0, resistance_ohm=0.05), np.array([1.0, 0.5, 0.0]))
    rest = battery.voltage_v.copy()
    battery.drain(np.array([180.0, 180.0, 180.0]), 36.0)
    assert (battery.voltage_v * battery.current_a)[:2] == pytest.approx([180.0, 180.0])
    assert (battery.voltage_v < rest)[:2].all()
    assert battery.current_a[1] > battery.current_a[0], "at a lower voltage"
    assert battery.current_a[2] == 0.0
    assert battery.charge[0] == pytest.approx(1 - battery.current_a[0] * 0.01 / 5.0)


@EVERY
def test_the_engine_takes_what_steady_flight_takes(vehicle: Vehicle) -> None:
    engine = hovering(vehicle)
    assert engine.power_w() is not None
    flown(engine, lambda _t, _at: np.zeros((1, 3)), 3)
    assert engine.power_w()[0] == pytest.approx(trimmed_w(vehicle, np.zeros(1), np.zeros(1))[0], rel=0.01)
    flown(engine, lambda _t, _at: np.array([[8.0, 0, 0]]), 9)
    assert engine.power_w()[0] == pytest.approx(trimmed_w(vehicle, np.array([8.0]), np.zeros(1))[0], rel=0.03)


# --- control ----------------------------------------------------------------------------------------------------------


@EVERY
def test_the_mixer_gives_the_thrust_and_the_torques_that_are_asked_for(vehicle: Vehicle) -> None:
    wanted = np.array([vehicle.mass_kg * GRAVITY_M_S2, 0.001, -0.002, 0.0005])
    thrust = np.linalg.inv(allocation(vehicle)) @ wanted
    lift = sum(thrust)
    roll = sum(t * y for t, (_, y) in zip(thrust, vehicle.rotors_m, strict=True))
    pitch = -sum(t * x for t, (x, _) in zip(thrust, vehicle.rotors_m, strict=True))
    assert (lift, roll, pitch) == pytest.approx(tuple(wanted[:3]))
    assert 1.5 < vehicle.max_rad_s**2 / hover_rad_s(vehicle) ** 2 < 2.5, "thrust to weight"


def test_an_attitude_points_its_axis_where_it_should() -> None:
    up = np.array([[0.3], [-0.4], [math.sqrt(0.75)]])
    attitude = level_attitude(up)
    assert body_up(attitude) == pytest.approx(up)
    assert times(attitude, conjugate(attitude)).ravel() == pytest.approx([1, 0, 0, 0])


@EVERY
def test_a_step_of_velocity_is_followed_fast_and_without_overshoot(vehicle: Vehicle) -> None:
    """Three UAVs, each along another axis."""
    wanted = np.diag([4.0, 4.0, 2.0])
    engine = hovering(vehicle, 3)
    shares = []
    for _ in range(round(6 / STEP_S)):
        engine.advance(STEP_S, wanted)
        shares.append(engine.velocities().diagonal() / wanted.diagonal())
    for speed in np.array(shares).T:
        assert np.argmax(speed > 0.9) * STEP_S < 1.6
        assert speed.max() < 1.08
        assert speed[-1] == pytest.approx(1.0, abs=0.02)


@EVERY
def test_a_uav_never_leans_beyond_its_limit_by_much(vehicle: Vehicle) -> None:
    engine = hovering(vehicle)
    most = 0.0
    for _ in range(60):
        engine.advance(STEP_S, np.array([[30.0, -30.0, 0.0]]))
        most = max(most, float(engine.tilts_rad()[0]))
    assert math.degrees(most) < vehicle.tilt_deg + 3
    assert math.degrees(most) > vehicle.tilt_deg - 5


def test_a_steady_wind_is_leaned_against_and_the_place_is_kept() -> None:
    engine = hovering(IRIS, wind=Wind(np.random.default_rng(1), 1, mean_m_s=(8.0, 0.0), w20_m_s=0.0))
    home = engine.positions().copy()
    track = flown(engine, lambda _t, at: 0.8 * (home - at), 18)
    assert np.abs(track[-40:, :3] - home).max() < 0.3
    drag = 4 * IRIS.rotor_drag_n_s2_m * hover_rad_s(IRIS) * 8 + IRIS.frame_drag_kg_m * 64
    assert math.tan(engine.tilts_rad()[0]) == pytest.approx(drag / (IRIS.mass_kg * GRAVITY_M_S2), rel=0.06)


@pytest.mark.parametrize(("speed", "climb"), [(25, 0), (8, 4), *slow((0, 0), (10, 0), (18, 0), (0, 5), (0, 10))])
def test_the_power_of_steady_flight_is_that_of_flight(speed: float, climb: float) -> None:
    """Also beyond 22 m/s, where an iteration oscillates: an Iris needs 514 W at 25 m/s, 339 W to climb at 10 m/s."""
    iris = IRIS._replace(tilt_deg=65.0)
    engine = hovering(iris)
    flown(engine, lambda _t, _at: np.array([[float(speed), 0, climb]]), 10)
    reached = engine.velocities()[0]
    solved = trimmed_w(iris, reached[:1], reached[2:])[0]
    assert solved == pytest.approx(engine.power_w()[0], rel=0.01)
    assert trimmed_w(IRIS, np.array([25.0, 0.0]), np.array([0.0, 10.0])) == pytest.approx([514, 339], abs=1)


@EVERY
def test_the_fastest_wind_that_a_scenario_may_have_is_the_vehicles_airspeed_at_its_tilt_limit(vehicle: Vehicle) -> None:
    engine = hovering(vehicle)
    flown(engine, lambda _t, _at: np.array([[60.0, 0, 0]]), 15)
    assert FASTEST_AIR_M_S[vehicle.name] <= engine.velocities()[0, 0] < FASTEST_AIR_M_S[vehicle.name] + 1.0


def test_a_crazyflie_falls_at_the_speed_at_which_its_drag_carries_it() -> None:
    engine = Rotors(CRAZYFLIE)
    engine.reset(np.array([[0.0, 0, 900]]))
    engine.fall(0)
    flown(engine, lambda _t, _at: np.zeros((1, 3)), 15)
    terminal = math.sqrt(CRAZYFLIE.mass_kg * GRAVITY_M_S2 / CRAZYFLIE.frame_drag_kg_m)
    assert -engine.velocities()[0, 2] == pytest.approx(terminal, rel=0.02)


@pytest.mark.slow
def test_a_cruising_uav_keeps_its_speed_and_brakes_at_once() -> None:
    """Its drag at 15 m/s takes 4.5 m/s2; at 35 degrees of tilt it stops within v^2 / (2 g tan 35) + 0.5 s."""
    engine = hovering(IRIS)
    track = flown(engine, lambda _t, _at: np.array([[15.0, 0, 0]]), 12)
    assert track[-1, 3] == pytest.approx(15.0, abs=0.1)
    stop = flown(engine, lambda _t, _at: np.zeros((1, 3)), 6)
    still = int(np.argmax(stop[:, 3] < 0.2))
    assert 0 < still * STEP_S < 3.0
    assert stop[:, 0].max() - track[-1, 0] < 15**2 / (2 * GRAVITY_M_S2 * math.tan(math.radians(35))) + 15 * 0.5
    assert stop[:, 3].min() > -0.5, "and does not fly back"


@pytest.mark.parametrize("wind_m_s", [15, 8])
@pytest.mark.slow
def test_uavs_that_stand_on_their_pads_stay_there_in_wind(make_scenario: MakeScenario, wind_m_s: float) -> None:
    keys = {"world.engine": "rotors", "world.wind_m_s": (wind_m_s, 0.0), "world.gusts_m_s": wind_m_s,
            "mobility.model": "onboard", "nodes.on_ground": True, "nodes.count": 4}  # fmt: skip
    world = WorldActor(make_scenario(**keys), "pads")
    world.start(0)
    first = next(message for _, message in world.outbox if isinstance(message, Poses))
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= 8 * S:
        world.outbox.clear()
        world.wake(wake_ns)
    last = next(message for _, message in world.outbox if isinstance(message, Poses))
    assert last.states == first.states
    assert world.report()["collisions"] == 0
    world.receive(Topics("pads").setpoint(1), Setpoint(8 * S, Enu(0, 0, 20), 2.0, kind=SetpointKind.TAKEOFF), 8 * S)
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= 23 * S:
        world.outbox.clear()
        world.wake(wake_ns)
    up = next(message for _, message in world.outbox if isinstance(message, Poses)).states
    assert up[2] == pytest.approx(20, abs=2)
    assert up[6:12] == first.states[6:12], "the others still stand"


@pytest.mark.slow
def test_fast_and_full_model_fly_a_figure_of_eight_alike() -> None:
    """A lemniscate of 40 m x 20 m at up to 11 m/s: the point masses of `kinematic` stay within 2.5 m of the rotors."""
    rate = 2 * math.pi / 32

    def wanted(t_s: float, at: Rows) -> Rows:
        place = np.array([[40 * math.sin(rate * t_s), 20 * math.sin(2 * rate * t_s), 50.0]])
        feed = np.array([[40 * rate * math.cos(rate * t_s), 40 * rate * math.cos(2 * rate * t_s), 0.0]])
        return feed + 0.8 * (place - at)

    full, fast = hovering(IRIS), Kinematic()
    fast.reset(np.array([[0.0, 0.0, 50.0]]))
    apart = np.linalg.norm((flown(full, wanted, 18) - flown(fast, wanted, 18))[:, :3], axis=1)
    assert apart[round(8 / STEP_S) :].max() < 2.5, "after they have caught up with the moving point"
    assert apart[round(8 / STEP_S) :].mean() > 0.05, "they are not the same model"


# --- wind -------------------------------------------------------------------------------------------------------------


def test_gusts_have_the_strength_and_the_length_of_the_standard() -> None:
    """MIL-F-8785C at 50 m (164 ft) and W20 = 10 m/s: u and v 1.5 times w."""
    level, up = intensities_m_s(np.array([50.0]), w20_m_s=10.0)
    assert up[0] == 1.0
    assert level[0] == pytest.approx((0.177 + 0.000823 * 50 / 0.3048) ** -0.4)
    along, vertical = lengths_m(np.array([50.0]))
    assert vertical[0] == pytest.approx(50.0)
    assert along[0] == pytest.approx(164.04 / (0.177 + 0.000823 * 164.04) ** 1.2 * 0.3048, rel=1e-3)


def test_gusts_over_a_hill_are_those_of_the_height_above_it() -> None:
    def strength(hill_m: float) -> Values:
        wind = Wind(np.random.default_rng(5), 400, mean_m_s=(6.0, 0.0), w20_m_s=10.0)
        engine = Rotors(IRIS, wind=wind, solids=Solids(Obstacles(Hills(np.full((3, 3), hill_m), 100.0), ())))
        engine.reset(np.tile([0.0, 0, hill_m + 20], (400, 1)) + np.arange(400)[:, None] * [9.0, 0, 0])
        engine.advance(0.05, np.zeros((400, 3)))
        return np.asarray(engine._air - [[6.0], [0], [0]])

    assert strength(300.0) == pytest.approx(strength(0.0)), "20 m above the ground either way"


@pytest.mark.parametrize("degrees", [30, 135, 200, 290])
def test_gusts_turn_with_the_mean_wind(degrees: int) -> None:
    """Seen along it, the same random numbers give the same gusts from wherever it blows."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    high, flown = np.full(50, 30.0), np.random.default_rng(1).normal(0, 5, (50, 3))
    turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    winds = [Wind(np.random.default_rng(5), 50, mean_m_s=mean, w20_m_s=9.0) for mean in ((6, 0), (6 * cos, 6 * sin))]
    for _ in range(3):
        assert winds[1].advance(0.5, high, flown @ turn) == pytest.approx(winds[0].advance(0.5, high, flown) @ turn)


@pytest.mark.parametrize("dt_s", [0.05, 2.0])
def test_gusts_vary_and_last_as_the_dryden_spectra_say_whatever_the_step(dt_s: float) -> None:
    count = 4000
    wind = Wind(np.random.default_rng(5), count, mean_m_s=(0.0, 6.0), w20_m_s=10.0)
    high, still = np.full(count, 50.0), np.zeros((count, 3))
    gusts = np.array([wind.advance(dt_s, high, still) for _ in range(1 + round(2.0 / dt_s))]) - [0.0, 6.0, 0.0]
    level, up = (float(s[0]) for s in intensities_m_s(np.array([50.0]), w20_m_s=10.0))
    along, vertical = (float(s[0]) for s in lengths_m(np.array([50.0])))
    first, last = gusts[0], gusts[-1]
    error = 4 / math.sqrt(2 * count)
    for axis, sigma in ((0, level), (1, level), (2, up)):
        assert first[:, axis].std() == pytest.approx(sigma, rel=error)
        assert last[:, axis].std() == pytest.approx(sigma, rel=error)
    elapsed_s = dt_s * round(2.0 / dt_s)
    alike = [float(np.corrcoef(first[:, axis], last[:, axis])[0, 1]) for axis in range(3)]
    u, w = 6.0 * elapsed_s / along, 6.0 * elapsed_s / vertical
    assert alike[1] == pytest.approx(math.exp(-u), abs=0.05), "along the wind, which blows to the north"
    assert alike[0] == pytest.approx(math.exp(-u) * (1 - u / 2), abs=0.05), "across it"
    assert alike[2] == pytest.approx(math.exp(-w) * (1 - w / 2), abs=0.06)


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"world.wind_m_s": (50.0, 50.0)}, r"world.wind_m_s = \[50, 50\] must be <= 19 m/s together"),
        ({"world.wind_m_s": (8.0, 8.0), "world.vehicle": "crazyflie"}, r"must be <= 10 m/s together"),
        ({"world.gusts_m_s": 8.0}, "world.gusts_m_s = 8 is a wind near the ground and needs world.wind_m_s"),
        ({"mobility.speed_m_s": 1000}, r"mobility.speed_m_s.*60"),
        ({"world.physics_hz": 150}, r"world.physics_hz.*multiple of 60"),
    ],
)
def test_what_no_multirotor_can_fly_is_refused(make_scenario: MakeScenario, keys: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        make_scenario(**{"world.engine": "rotors", **keys})


def test_wind_needs_the_rotors(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match=r'need world\.engine = "rotors", not "kinematic"'):
        make_scenario(**{"world.wind_m_s": (3.0, 0.0)})


# --- batteries in a world ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["kinematic", "rotors"])
def test_a_uav_whose_battery_is_empty_falls(make_scenario: MakeScenario, engine: str) -> None:
    keys = {
        "world.engine": engine,
        "world.charge": (0.005, 0.005),
        "sensors.battery_hz": 1,
        "mobility.model": "onboard",
    }
    world = WorldActor(make_scenario(**{"nodes.count": 1, **keys}), "b")
    world.start(0)
    told: list[Battery] = []
    while (wake_ns := world.next_wake_ns()) is not None and wake_ns <= 13 * S:
        world.wake(wake_ns)
        told += [message for _, message in world.outbox if isinstance(message, Battery)]
        world.outbox.clear()
    assert told[0].charge == pytest.approx(0.005, abs=1e-3)
    assert told[-1].charge < 0.002
    assert len(told) < 10, "and then it says nothing more"
    assert world.report()["crashed"] == 1
    assert world.report()["least_charge"] == 0.0


@pytest.mark.slow
def test_the_fast_engines_batteries_are_drained_as_the_full_ones(make_scenario: MakeScenario) -> None:
    """15 s at 5 m/s: the table of steady flight against the rotors' own power."""
    left = {}
    for engine in (Kinematic(), Rotors(CRAZYFLIE)):
        energy = BatteryDrain(make_scenario(**{"nodes.count": 1, "world.vehicle": "crazyflie"}))
        engine.reset(np.array([[0.0, 0, 50]]))
        for _ in range(300):
            engine.advance(STEP_S, np.array([[5.0, 0, 0]]))
            energy.pass_time(STEP_S, engine, np.ones(1, bool))
        left[engine.name] = 1 - float(energy.batteries.charge[0])
    assert left["kinematic"] == pytest.approx(left["rotors"], rel=0.03)


@pytest.mark.parametrize(
    ("velocity", "climb_m_s"), [((0, 0, 0), 0), ((5, 0, 0), 0), ((3, 4, 2), 2), ((0, 8, 5), 5), ((6, 0, -3), 0)]
)
def test_a_body_of_the_fast_engine_takes_the_power_of_steady_flight_and_sinks_as_it_flies_level(
    make_scenario: MakeScenario, velocity: tuple[float, float, float], climb_m_s: float
) -> None:
    engine, energy = Kinematic(), BatteryDrain(make_scenario(**{"nodes.count": 1, "world.vehicle": "crazyflie"}))
    engine.reset(np.array([[0.0, 0, 500]]))
    for _ in range(100):
        engine.advance(STEP_S, np.array([velocity], dtype=float))
    energy.pass_time(STEP_S, engine, np.ones(1, bool))
    power_w = float((energy.batteries.current_a * energy.batteries.voltage_v)[0])
    speed = np.array([math.hypot(*velocity[:2])])
    assert power_w == pytest.approx(float(trimmed_w(CRAZYFLIE, speed, np.array([climb_m_s]))[0]), rel=1e-3)
