"""Each sensor against the formula of its model: shares with their confidence intervals, errors with theirs."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from fanet_mw.bus.messages import Altimeter, Camera, Gps, Inertial, Message, Radar, Voice
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, S, direction
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Box, Hills, Obstacles, obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.sensors.camera import PERSON_M, CameraSensor, recognized_share
from sim.world.sensors.contract import Drift, Sensor, Truth, generator
from sim.world.sensors.gps import GpsReceiver
from sim.world.sensors.phone import PhoneSensor
from sim.world.sensors.radar import MOST_SPEED_M_S, SPEED_CELL_M_S, RadarSensor, detected_share, radar_snr_db
from sim.world.sensors.suite import Suite, sensors_of
from sim.world.sensors.voice import VoiceSensor, level_db, power_sum_db, wind_noise_db

MakeScenario = Callable[..., Scenario]
PLAIN = Solids(None)
SIGMAS = 4.0
"""Half the width of each confidence interval below: one check in 16,000 is outside by chance; seeds are fixed."""


def survivor_at(scenario: Scenario, *places: Sequence[float], buried: bool = False) -> Survivors:
    found = Survivors(scenario)
    found.places = np.array(places, dtype=np.float64).reshape(-1, 3)
    found.buried = np.full(len(found.places), buried)
    return found


def readings(sensor: Sensor, at: Sequence[float], times: int, velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> list[Any]:
    """What the first UAV's sensor tells in so many instants, None where it tells nothing."""
    found: list[Message | None] = []
    for instant in range(times):
        truth = Truth(instant * sensor.period_ns, np.array([at], float), np.array([velocity], float))
        told = list(sensor.read(truth, [0]))
        found.append(told[0][1] if told else None)
    return found


def assert_share(hits: int, trials: int, share: float) -> None:
    """Whether a count can be that of a probability, by the normal approximation of the binomial distribution."""
    assert abs(hits - trials * share) <= SIGMAS * math.sqrt(trials * share * (1 - share)) + 0.5, (hits / trials, share)


def assert_sigma(errors: Sequence[float], sigma: float) -> None:
    """Whether the errors can be Gaussian of this standard deviation and mean 0."""
    count = len(errors)
    assert count > 100
    assert abs(np.mean(errors)) <= SIGMAS * sigma / math.sqrt(count)
    assert abs(np.std(errors) / sigma - 1) <= SIGMAS / math.sqrt(2 * count)


# --- camera -----------------------------------------------------------------------------------------------------------


def camera(make_scenario: MakeScenario, *places: Sequence[float], solids: Solids = PLAIN, **keys: Any) -> CameraSensor:
    scenario = make_scenario(**{"mission.survivors": len(places), "sensors.camera_hz": 2, **keys})
    return CameraSensor(scenario, survivor_at(scenario, *places, buried=bool(keys.get("mission.buried"))), solids)


@pytest.mark.parametrize("up", [80.0, 100.0, 130.0])
def test_people_are_recognized_as_often_as_johnsons_criteria_say(make_scenario: MakeScenario, up: float) -> None:
    sensor = camera(make_scenario, (0, 0, 0))
    ground_per_pixel_m = 2 * up * math.tan(math.radians(35)) / 1920
    x = PERSON_M / ground_per_pixel_m / 2 / 4.0
    share = x ** (2.7 + 0.7 * x) / (1 + x ** (2.7 + 0.7 * x))
    assert 0.2 < share < 0.97, "the case is neither certain nor hopeless"
    seen = [image for image in readings(sensor, (0, 0, up), 1000) if image]
    assert_share(len(seen), 1000, share)
    told = [image.people[0].pixels for image in seen]
    assert_sigma([pixels - PERSON_M / ground_per_pixel_m for pixels in told], 0.1 * PERSON_M / ground_per_pixel_m)
    assert all(float(pixels).is_integer() for pixels in told)


def test_at_n50_line_pairs_half_are_recognized() -> None:
    assert recognized_share(np.array([8.0]), cycles_for_half=4.0)[0] == pytest.approx(0.5)


def test_the_direction_of_a_person_errs_by_its_sigma_along_each_axis(make_scenario: MakeScenario) -> None:
    sensor = camera(make_scenario, (12, 7, 0), **{"sensors.camera_sigma_deg": 2.0, "sensors.camera_cycles": 0.1})
    errors = []
    for image in readings(sensor, (0, 0, 40), 600):
        (person,) = image.people
        ray = direction(bearing_rad=person.bearing_rad, elevation_rad=person.elevation_rad)
        true = np.array([12, 7, -40]) / math.sqrt(12**2 + 7**2 + 40**2)
        errors.append(
            float(np.dot(np.array(ray), np.cross(true, [0, 0, 1.0])) / np.linalg.norm(np.cross(true, [0, 0, 1])))
        )
    assert_sigma(errors, math.radians(2.0))


@pytest.mark.parametrize(
    ("place", "seen"),
    [((34, 0, 0), True), ((36, 0, 0), False), ((0, 19, 0), True), ((0, 21, 0), False), ((0, -19, 0), True)],
)
def test_the_image_covers_its_field_of_view_and_no_more(
    make_scenario: MakeScenario, place: tuple[float, ...], seen: bool
) -> None:
    """50 m up, 70 degrees across 1920 pixels: 35.0 m to either side, 19.7 m ahead and behind."""
    sensor = camera(make_scenario, place, **{"sensors.camera_cycles": 0.1})
    assert any(readings(sensor, (0, 0, 50), 5)) == seen


def test_nobody_is_seen_through_a_roof_or_under_rubble(make_scenario: MakeScenario) -> None:
    roof = Solids(Obstacles(None, (Box(0, 0, 20, 20, 10),)))
    sure = {"sensors.camera_cycles": 0.1}
    assert not any(readings(camera(make_scenario, (5, 0, 0), solids=roof, **sure), (0, 0, 50), 20))
    assert not any(readings(camera(make_scenario, (5, 0, 0), **{"mission.buried": 1.0, **sure}), (0, 0, 50), 20))
    assert all(readings(camera(make_scenario, (14, 0, 0), solids=roof, **sure), (0, 0, 50), 20))


def test_false_people_come_at_their_rate(make_scenario: MakeScenario) -> None:
    sensor = camera(make_scenario, (900, 900, 0), **{"sensors.camera_false_per_hour": 720})
    told = [len(image.people) for image in readings(sensor, (0, 0, 50), 1500) if image]
    assert abs(sum(told) - 150) <= SIGMAS * math.sqrt(150)


def test_a_false_person_is_as_large_as_one_on_the_ground_below(make_scenario: MakeScenario) -> None:
    plateau = Solids(Obstacles(Hills(np.full((3, 3), 60.0), 500.0), ()))
    keys = {"sensors.camera_false_per_hour": 3600.0, "world.area_m": 1000.0}
    for solids, up in ((PLAIN, 40.0), (plateau, 100.0)):
        told = readings(camera(make_scenario, (400, 400, 0), solids=solids, **keys), (0, 0, up), 400)
        pixels = [person.pixels for image in told if image for person in image.people]
        assert np.mean(pixels) == pytest.approx(PERSON_M * 1920 / (2 * 40 * math.tan(math.radians(35))), rel=0.05)


# --- voice ------------------------------------------------------------------------------------------------------------


def voice(make_scenario: MakeScenario, *places: Sequence[float], solids: Solids = PLAIN, **keys: Any) -> VoiceSensor:
    """Without the errors of levels, unless asked for."""
    exact = {"sensors.voice_loudness_db": 0.0, "sensors.voice_error_db": 0.0}
    scenario = make_scenario(**{"mission.survivors": len(places), "sensors.voice_hz": 1, **exact, **keys})
    return VoiceSensor(scenario, survivor_at(scenario, *places, buried=bool(keys.get("mission.buried"))), solids)


def test_sound_falls_by_six_decibels_for_twice_the_distance_and_five_per_kilometre() -> None:
    near, far = level_db(np.array([10.0, 20.0]), at_1_m_db=88.0)
    assert near == pytest.approx(88 - 20 - 0.05)
    assert near - far == pytest.approx(20 * math.log10(2) + 0.05)


def test_noises_add_as_powers_and_wind_grows_by_63_decibels_for_a_tenfold_airspeed() -> None:
    assert power_sum_db(80.0, np.array([80.0]))[0] == pytest.approx(83.01, abs=0.01)
    slow, fast = wind_noise_db(np.array([2.0, 20.0]))
    assert fast - slow == pytest.approx(63.0)


def test_a_call_is_heard_as_far_as_its_level_is_above_the_noise(make_scenario: MakeScenario) -> None:
    """88 dB at 1 m, rotors of 80 dB, a gain of 15 dB: 23 dB to lose on the way, 14.0 m with the air's share."""
    sure = {"sensors.voice_share": 1.0}
    assert all(readings(voice(make_scenario, (0, 0, 0), **sure), (0, 0, 13.9), 10))
    assert not any(readings(voice(make_scenario, (0, 0, 0), **sure), (0, 0, 14.2), 10))
    calm = {**sure, "sensors.voice_rotor_db": 40.0}
    assert all(readings(voice(make_scenario, (0, 0, 0), **calm), (0, 0, 300), 10))
    assert not any(readings(voice(make_scenario, (0, 0, 0), **calm), (0, 0, 300), 10, velocity=(20, 0, 0)))
    windy = {**calm, "world.engine": "rotors", "world.wind_m_s": (19.0, 0.0)}
    assert not any(readings(voice(make_scenario, (0, 0, 0), **windy), (0, 0, 300), 10)), "hovering in wind is noisy"
    assert all(readings(voice(make_scenario, (0, 0, 0), **windy), (0, 0, 300), 10, velocity=(19, 0, 0)))
    buried = {**sure, "mission.buried": 1.0, "sensors.burial_voice_db": 6.0}
    assert all(readings(voice(make_scenario, (0, 0, 0), **buried), (0, 0, 6.9), 10))
    assert not any(readings(voice(make_scenario, (0, 0, 0), **buried), (0, 0, 7.2), 10))


def test_a_survivor_calls_in_its_share_of_the_instants(make_scenario: MakeScenario) -> None:
    told = readings(voice(make_scenario, (0, 0, 0), **{"sensors.voice_share": 0.3}), (0, 0, 8), 2000)
    assert_share(sum(reading is not None for reading in told), 2000, 0.3)


def test_whoever_listens_hears_the_same_calls_and_they_last_a_second(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 2, "sensors.voice_hz": 10, "sensors.voice_share": 0.4}
    sensor, at = voice(make_scenario, (0, 0, 0), **keys), np.array([(0.0, 0, 8), (3, 0, 8)])
    heard = np.zeros((2, 3000), bool)
    for step in range(3000):
        for row, _ in sensor.read(Truth(step * S // 10, at, at * 0), [0, 1]):
            heard[row, step] = True
    assert (heard[0] == heard[1]).all()
    begun = np.flatnonzero(heard[0, 1:] & ~heard[0, :-1])
    ended = np.flatnonzero(~heard[0, 1:] & heard[0, :-1])
    assert set((ended[-len(begun) + 1 :] - begun[: len(begun) - 1]) % 10) == {0}
    assert_share(int(heard[0, ::10].sum()), 300, 0.4)


def test_the_error_of_a_voices_direction_falls_with_the_root_of_its_snr(make_scenario: MakeScenario) -> None:
    sensor = voice(make_scenario, (6, 0, 0), **{"sensors.voice_share": 1.0})
    calls = [reading.calls[0] for reading in readings(sensor, (0, 0, 2), 600)]
    snr_db = 88 - 20 * math.log10(math.hypot(6, 2)) - 80 + 15
    assert calls[0].snr_db == pytest.approx(snr_db, abs=0.1)
    north = [direction(bearing_rad=call.bearing_rad, elevation_rad=call.elevation_rad).north for call in calls]
    assert_sigma(north, math.radians(5.0) * 10 ** (-snr_db / 20))


def test_levels_differ_among_people_and_err_each_time(make_scenario: MakeScenario) -> None:
    """A range by level alone is off by a factor of 1.9: 5.4 dB of 20 dB for each tenfold distance."""
    keys = {"sensors.voice_share": 1.0, "sensors.voice_rotor_db": 0.0, "sensors.voice_loudness_db": 5.0}
    places = [(20 + i, 0, 0) for i in range(200)]
    sensor = voice(make_scenario, *places, **keys, **{"sensors.voice_error_db": 2.0})
    first, second = ({round(math.tan(call.bearing_rad), 9): call for call in reading.calls}
                     for reading in readings(sensor, (0, 0, 2), 2))  # fmt: skip
    assert len(first) == len(second) == 200
    true_db = [float(level_db(np.array([math.hypot(20 + i, 2)]), at_1_m_db=88.0)[0]) for i in range(200)]
    levels = [[call.level_db for call in told.values()] for told in (first, second)]
    assert_sigma([level - true for level, true in zip(levels[0], true_db, strict=True)], math.hypot(5, 2))
    assert_sigma([a - b for a, b in zip(*levels, strict=True)], 2 * math.sqrt(2))


def test_the_ground_on_which_people_lie_hides_none_of_their_voices(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"world.terrain_m": 30, "world.area_m": 1000, "nodes.altitude_m": 60})
    solids = Solids(obstacles(scenario, np.array(positions(scenario))))
    lying = np.random.default_rng(7).uniform(-480, 480, (200, 3))
    lying[:, 2] = solids.ground_m(lying)
    sensor = voice(make_scenario, *lying, solids=solids, **{"sensors.voice_share": 1.0})
    above = Truth(0, lying + np.array([2.0, 1.0, 5.0]), np.zeros_like(lying))
    assert [row for row, _ in sensor.read(above, range(200))] == [*range(200)]


def test_a_wall_between_hides_a_voice(make_scenario: MakeScenario) -> None:
    wall = Solids(Obstacles(None, (Box(5, 0, 1, 40, 30),)))
    sure = {"sensors.voice_share": 1.0}
    told = readings(voice(make_scenario, (8, 0, 0), solids=wall, **sure), (0, 0, 2), 5)
    assert not any(told)
    assert all(readings(voice(make_scenario, (8, 0, 0), **sure), (0, 0, 2), 5))


# --- radar ------------------------------------------------------------------------------------------------------------


def scans(
    make_scenario: MakeScenario, others: Sequence[Sequence[float]], times: int, solids: Solids = PLAIN, **keys: Any
) -> list[tuple[Any, ...]]:
    """The echoes of each scan of a UAV at 50 m, others beside it."""
    scenario = make_scenario(**{"nodes.count": 1 + len(others), "sensors.radar_hz": 5, **keys})
    sensor = RadarSensor(scenario, solids)
    at = np.array([(0.0, 0.0, 50.0), *others])
    velocity = np.zeros_like(at)
    velocity[0] = [3.0, 0, 0]
    found = []
    for instant in range(times):
        told = list(sensor.read(Truth(instant * sensor.period_ns, at, velocity), [0]))
        found.append(told[0][1].echoes if told else ())
    return found


def test_the_reference_snr_is_that_of_the_radar_equation() -> None:
    """Power, gain of antennas and channels, 77 GHz, 10 ms, 15 dB: as in the text of the model."""
    gain_db = 2 * 10.5 + 10 * math.log10(12)
    snr_db = radar_snr_db(power_dbm=12, gain_db=gain_db, wavelength_m=3e8 / 77e9, seconds=0.01, noise_figure_db=15)
    assert snr_db == pytest.approx(21.6, abs=0.2)


@pytest.mark.parametrize("range_m", [40.0, 70.0, 110.0])
def test_a_uav_is_detected_as_often_as_a_swerling_1_target(make_scenario: MakeScenario, range_m: float) -> None:
    found = scans(make_scenario, [(range_m, 0, 50)], 800, **{"sensors.radar_false_alarm": 1e-9})
    snr = 10 ** ((21.6 + 10 * math.log10(0.03) - 40 * math.log10(range_m / 100)) / 10)
    share = 1e-9 ** (1 / (1 + snr))
    assert_share(sum(bool(echoes) for echoes in found), 800, share)
    assert float(detected_share(np.array([snr]), false_alarm=1e-9)[0]) == pytest.approx(share)
    told = [10 ** (echo.snr_db / 10) for echoes in found for echo in echoes]
    assert min(told) > -math.log(1e-9) - 1 - 1e-6, "what is told as an echo is above the threshold, less the noise"


def test_ranges_and_bearings_err_as_their_snr_says(make_scenario: MakeScenario) -> None:
    found = scans(make_scenario, [(0, 30, 50)], 600, **{"sensors.radar_false_alarm": 1e-9})
    echoes = [echo for scan in found for echo in scan]
    fine = [math.sqrt(2 * 10 ** (echo.snr_db / 10)) for echo in echoes]
    assert_sigma([(echo.range_m - 30) * f for echo, f in zip(echoes, fine, strict=True)], 0.5)
    off = [(echo.bearing_rad + math.pi) % (2 * math.pi) - math.pi for echo in echoes]
    assert_sigma([o * f for o, f in zip(off, fine, strict=True)], math.radians(10) / 1.6)


def test_an_echo_tells_how_fast_the_range_shrinks(make_scenario: MakeScenario) -> None:
    """To lambda / (2 T) = 0.19 m/s over the root of twice the SNR; what is no target may have any speed."""
    for x, speed in ((20, 3.0), (-20, -3.0)):
        echoes = [e for scan in scans(make_scenario, [(x, 0, 50)], 300) for e in scan if abs(e.range_m - 20) < 2]
        fine = [math.sqrt(2 * 10 ** (echo.snr_db / 10)) for echo in echoes]
        assert_sigma([(e.closing_m_s - speed) * f for e, f in zip(echoes, fine, strict=True)], SPEED_CELL_M_S)
    false = [
        e.closing_m_s for scan in scans(make_scenario, [], 300, **{"sensors.radar_false_alarm": 1e-4}) for e in scan
    ]
    assert_sigma(false, MOST_SPEED_M_S / math.sqrt(3))


def test_a_speed_beyond_what_is_unambiguous_is_folded(make_scenario: MakeScenario) -> None:
    sensor = RadarSensor(make_scenario(**{"nodes.count": 2, "sensors.radar_hz": 5}), PLAIN)
    at, velocity = np.array([(0.0, 0, 50), (30, 0, 50)]), np.array([(12.0, 0, 0), (-13, 0, 0)])
    read = [told for step in range(40) for _, told in sensor.read(Truth(step, at, velocity), [0])]
    told = [echo.closing_m_s for scan in read for echo in scan.echoes if abs(echo.range_m - 30) < 1]  # type: ignore[union-attr]
    assert len(told) > 30
    assert np.mean(told) == pytest.approx(-15, abs=0.1)


@pytest.mark.parametrize(("apart_m", "told"), [(0.2, {1}), (0.8, {2})])
def test_uavs_within_one_cell_are_one_echo(make_scenario: MakeScenario, apart_m: float, told: set[int]) -> None:
    others = [(0, 20.1, 51), (0, 20.1 + apart_m, 51)]
    found = scans(make_scenario, others, 60, **{"sensors.radar_false_alarm": 1e-9})
    assert {len(echoes) for echoes in found} - {0} == told


def test_walls_are_met_where_they_stand_and_hide_what_is_behind(make_scenario: MakeScenario) -> None:
    wall = Solids(Obstacles(None, (Box(40, 0, 10, 60, 80),)))
    found = scans(make_scenario, [(60, 0, 50)], 100, wall, **{"sensors.radar_false_alarm": 1e-9})
    ahead = [
        e for scan in found for e in scan if abs(e.bearing_rad - math.pi / 2) < 0.05 and abs(e.elevation_rad) < 0.05
    ]
    assert len(ahead) > 75
    assert np.mean([e.range_m for e in ahead]) == pytest.approx(35, abs=0.2)
    assert all(e.range_m < 50 for scan in found for e in scan), "nothing from behind the wall"


@pytest.mark.parametrize("bearing_deg", [5, 7, 94, 231])
def test_a_tower_between_two_rays_is_met(make_scenario: MakeScenario, bearing_deg: float) -> None:
    """6 m wide, 100 m away, where the rays of two beams are 17 m apart."""
    east, north = (100 * f(math.radians(bearing_deg)) for f in (math.sin, math.cos))
    tower = Solids(Obstacles(None, (Box(east, north, 6, 6, 90),)))
    found = scans(make_scenario, [], 60, tower, **{"sensors.radar_false_alarm": 1e-9})
    echoes = [echo for scan in found for echo in scan]
    assert len(echoes) > 50
    assert np.mean([echo.range_m for echo in echoes]) == pytest.approx(97, abs=1.5)


def test_clutter_comes_as_often_as_the_false_alarm_rate_says(make_scenario: MakeScenario) -> None:
    found = scans(make_scenario, [], 1000, **{"sensors.radar_false_alarm": 1e-5})
    expected = 1000 * 36 * 240 * 1e-5
    assert abs(sum(map(len, found)) - expected) <= SIGMAS * math.sqrt(expected)


# --- the others -------------------------------------------------------------------------------------------------------


def gps_errors(scenario: Scenario, instants_s: Sequence[int]) -> np.ndarray:
    """Errors of all receivers [instants, nodes, 3], at rest."""
    sensor, at = GpsReceiver(scenario), np.zeros((scenario.nodes.count, 3))
    return np.array([sensor.fixes(Truth(t_s * S, at, at))[0] for t_s in instants_s])


def test_fixes_have_noise_of_each_fix_and_a_bias_that_stays_a_while(make_scenario: MakeScenario) -> None:
    keys = {"world.gps_sigma_m": 1.0, "sensors.gps_bias_m": 4.0, "sensors.gps_bias_time_s": 50.0, "world.gps_hz": 1,
            "sensors.gps_common_m": 0.0, "sensors.gps_vertical": 1.0}  # fmt: skip
    first, soon, late = gps_errors(make_scenario(**{"nodes.count": 300, **keys}), (0, 1, 500))
    assert_sigma(first.ravel().tolist(), math.hypot(4, 1))
    kept = math.exp(-1 / 50)
    assert_sigma((soon - first).ravel().tolist(), math.sqrt(2 * 16 * (1 - kept) + 2))
    correlation = np.corrcoef(first.ravel(), late.ravel())[0, 1]
    assert abs(correlation) < SIGMAS / math.sqrt(900)


def test_a_drift_keeps_its_spread_at_any_pace_and_forgets_by_its_time() -> None:
    drift = Drift(generator(1, "drift"), (20_000,), sigma=2.0, tau_s=50.0)
    values = [drift.at(round(t_s * S)) for t_s in (0, 1, 2, 10, 50, 51, 500)]
    assert [np.std(value) for value in values] == pytest.approx([2.0] * 7, rel=0.03)
    assert np.corrcoef(values[0], values[4])[0, 1] == pytest.approx(1 / math.e, abs=0.03)


def test_the_default_gps_is_that_of_the_data_sheet_and_the_standard(make_scenario: MakeScenario) -> None:
    """2.5 m CEP (u-blox NEO-M8) over many days; the ratio of 13 m to 8 m at 95 % (SPS PS, 2020) up and sideways."""
    seeds = range(150)
    errors = np.concatenate(
        [gps_errors(make_scenario(seed=seed, **{"nodes.count": 2}), (0, 9000, 18000))[:, 0] for seed in seeds]
    )
    sideways = np.hypot(errors[:, 0], errors[:, 1])
    assert np.median(sideways) == pytest.approx(2.5, rel=0.15)
    assert np.quantile(np.abs(errors[:, 2]), 0.95) / np.quantile(sideways, 0.95) == pytest.approx(13 / 8, rel=0.2)


def test_neighbors_share_most_of_the_error_and_ten_seconds_of_averaging_help_little(
    make_scenario: MakeScenario,
) -> None:
    apart, kept = [], []
    for seed in range(60):
        errors = gps_errors(make_scenario(seed=seed, **{"nodes.count": 2}), range(11))
        apart.append(errors[0, 0, :2] - errors[0, 1, :2])
        kept.append(errors[:, 0, :2].mean(axis=0))
    assert_sigma(np.ravel(apart).tolist(), math.sqrt(2) * math.hypot(0.6, 0.3))
    assert np.std(kept) == pytest.approx(math.hypot(2.0, 0.6), rel=0.2), "white noise of 2.1 m would leave 0.6 m"


def test_a_fix_is_as_old_as_its_delay_and_its_velocity_errs(make_scenario: MakeScenario) -> None:
    exact = {"world.gps_sigma_m": 0.0, "sensors.gps_bias_m": 0.0, "sensors.gps_common_m": 0.0}
    scenario = make_scenario(**{"nodes.count": 300, **exact})
    at, velocity = np.zeros((300, 3)), np.tile([10.0, 0, 0], (300, 1))
    position, told, _ = GpsReceiver(scenario).fixes(Truth(0, at, velocity))
    assert position == pytest.approx(np.tile([-1.1, 0, 0], (300, 1)))
    assert_sigma((told - velocity).ravel().tolist(), 0.05)


def test_an_outage_is_a_place_and_a_time_without_fixes(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "sensors.gps_outages": ((100, 0, 50, 10, 20),), "world.gps_hz": 1})
    sensor = GpsReceiver(scenario)
    at = np.array([[120.0, 0, 50], [160, 0, 50]])
    told = {t: [row for row, _ in sensor.read(Truth(t * S, at, at), [0, 1])] for t in (9, 10, 19, 20)}
    assert told == {9: [0, 1], 10: [1], 19: [1], 20: [0, 1]}


def test_heights_are_those_of_the_air_and_of_what_is_below(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{
            "nodes.count": 3,
            "sensors.altimeter_hz": 1,
            "sensors.barometer_drift_m": 0,
            "sensors.barometer_sigma_m": 0.5,
        }
    )
    (sensor,) = (
        s
        for s in sensors_of(scenario, Survivors(scenario), Solids(Obstacles(None, (Box(0, 0, 20, 20, 15),))))
        if s.kind == "altimeter"
    )
    at = np.array([[0.0, 0, 40], [50, 0, 40], [50, 0, 130]])
    told: list[list[Altimeter]] = [[], [], []]
    for t in range(300):
        for row, reading in sensor.read(Truth(t * S, at, at), [0, 1, 2]):
            assert isinstance(reading, Altimeter)
            told[row].append(reading)
    assert_sigma([reading.up_m - 40 for reading in told[0]], 0.5)
    assert_sigma([reading.above_ground_m - 25 for reading in told[0] if reading.above_ground_m is not None], 0.1)
    assert np.mean([reading.above_ground_m for reading in told[1]]) == pytest.approx(40, abs=0.1)
    both = np.array([(reading.up_m, reading.above_ground_m) for reading in told[1]])
    assert abs(np.corrcoef(both.T)[0, 1]) < SIGMAS / math.sqrt(300), "each has a noise of its own"
    assert all(reading.above_ground_m is None for reading in told[2]), "beyond the rangefinder's 120 m"


def test_the_rangefinder_ends_where_it_says_whatever_its_noise(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "sensors.altimeter_hz": 1, "sensors.rangefinder_m": 60})
    (sensor,) = (s for s in sensors_of(scenario, Survivors(scenario), PLAIN) if s.kind == "altimeter")
    at = np.array([[0.0, 0, 60.0], [0, 0, 60.01]])
    for t in range(30):
        within, beyond = (r for _, r in sensor.read(Truth(t * S, at, at), [0, 1]) if isinstance(r, Altimeter))
        assert within.above_ground_m is not None
        assert beyond.above_ground_m is None


@pytest.mark.parametrize("kind", ["inertial", "altimeter"])
def test_a_reading_is_of_its_own_uav_whoever_else_is_read(make_scenario: MakeScenario, kind: str) -> None:
    keys = {f"sensors.{key}": 0 for key in ("inertial_sigma_m_s", "barometer_sigma_m", "rangefinder_sigma_m")}
    scenario = make_scenario(**{"nodes.count": 6, "sensors.inertial_hz": 1, "sensors.altimeter_hz": 1, **keys})
    at = np.arange(18.0).reshape(6, 3) + 40

    def read(rows: list[int]) -> dict[int, Message]:
        (sensor,) = (s for s in sensors_of(scenario, Survivors(scenario), PLAIN) if s.kind == kind)
        return dict(sensor.read(Truth(S, at, at - 50), rows))

    every = read([0, 1, 2, 3, 4, 5])
    assert len({str(reading) for reading in every.values()}) == 6
    assert read([2, 5]) == {row: every[row] for row in (2, 5)}


def test_velocity_without_gps_has_noise_and_a_slow_drift(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 200, "sensors.inertial_hz": 1})
    (sensor,) = (s for s in sensors_of(scenario, Survivors(scenario), PLAIN) if s.kind == "inertial")
    at = np.zeros((200, 3))
    told = np.array([r.velocity for _, r in sensor.read(Truth(0, at, at + 3), range(200)) if isinstance(r, Inertial)])
    assert_sigma((told - 3).ravel().tolist(), math.hypot(0.1, 0.05))


def test_what_is_buried_is_heard_more_faintly(make_scenario: MakeScenario) -> None:
    keys = {"mission.survivors": 1, "mission.shadowing_db": 0, "mission.detection_dbm": -200}
    above = np.array([0.0, 0, 50])
    plain, rubble = (make_scenario(**keys, **{"mission.buried": share}) for share in (0.0, 1.0))
    assert PhoneSensor(plain).scan(above)[0][1] - PhoneSensor(rubble).scan(above)[0][1] == pytest.approx(20.0)


def test_a_sensor_more_on_board_changes_no_other_ones_readings(make_scenario: MakeScenario) -> None:
    def told(**keys: Any) -> list[tuple[str, Message]]:
        scenario = make_scenario(**{"nodes.count": 3, "mission.survivors": 4, "world.area_m": 100, **keys})
        suite = Suite(scenario, sensors_of(scenario, Survivors(scenario), PLAIN), Topics("s"))
        at = np.array([[0.0, 0, 30], [20, 0, 30], [40, 0, 30]])
        alive = np.array([True, True, False])
        found = []
        for step in range(100):
            truth = Truth(step * S // 10, at, np.zeros_like(at))
            found += list(suite.readings(truth, alive, before_ns=truth.now_ns - S // 10))
        return found

    every = {f"sensors.{kind}_hz": 2 for kind in ("camera", "voice", "radar", "altimeter", "inertial")}
    alone, together = told(**{"sensors.camera_hz": 2}), told(**every)
    assert {type(m) for _, m in together} >= {Camera, Radar, Altimeter, Inertial, Gps}
    assert [item for item in together if isinstance(item[1], Camera | Gps)] == [
        item for item in alone if isinstance(item[1], Camera | Gps)
    ]
    assert not any("/3/" in topic for topic, _ in together), "who has crashed senses nothing"


def test_an_outage_that_ends_before_it_begins_is_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match=r"gps_outages\.0: from = 20 must be < until = 10"):
        make_scenario(**{"sensors.gps_outages": ((0, 0, 10, 20, 10),)})


def test_directions_and_angles_are_inverse() -> None:
    assert direction(bearing_rad=math.pi / 2, elevation_rad=0.0) == pytest.approx(Enu(1, 0, 0), abs=1e-12)
    assert direction(bearing_rad=0.0, elevation_rad=-math.pi / 2) == pytest.approx(Enu(0, 0, -1), abs=1e-12)
    assert issubclass(Voice, tuple)
    assert issubclass(Radar, tuple)


def test_a_rescue_has_position_fixes_whatever_protocol_carries_its_reports(make_scenario: MakeScenario) -> None:
    for protocol in ("flooding", "counter", "aodv", "clustered"):
        keys = {"nodes.count": 2, "nodes.telemetry_hz": 0, "routing.protocol": protocol, "mission.survivors": 1}
        scenario = make_scenario(**keys)
        kinds = [sensor.kind for sensor in sensors_of(scenario, Survivors(scenario), PLAIN)]
        assert "gps" in kinds, protocol
