"""Who hears a survivor's phone: path loss, shadowing that belongs to a place, and a threshold."""

from collections.abc import Callable

import numpy as np
import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from sim.world.environment.survivors import place
from sim.world.sensors.phone import PhoneSensor

MakeScenario = Callable[..., Scenario]


def sensor(make_scenario: MakeScenario, **mission: float) -> tuple[Scenario, PhoneSensor]:
    """Without fading and noise, unless asked for."""
    exact = {"phone_rice_db": 100.0, "rssi_sigma_db": 0.0}
    keys = {"survivors": 8, "shadowing_db": 0.0, "detection_dbm": -92.0, "phone_power_dbm": 15.0} | exact | mission
    scenario = make_scenario(
        **{"nodes.count": 2, "world.area_m": 400, **{f"mission.{key}": value for key, value in keys.items()}}
    )
    return scenario, PhoneSensor(scenario)


def test_a_phone_is_heard_by_the_law_down_to_the_threshold_the_strongest_first(make_scenario: MakeScenario) -> None:
    scenario, phones = sensor(make_scenario)
    here = np.array([0.0, 0.0, 50.0])
    mission = scenario.mission
    expected = []
    for survivor, at in enumerate(place(scenario), start=1):
        distance_m = float(np.linalg.norm(np.array(at) - here))
        dbm = mission.phone_power_dbm - 40.05 - 10 * mission.phone_exponent * np.log10(distance_m)
        if round(dbm) >= mission.detection_dbm:
            expected.append((survivor, round(dbm)))
    expected.sort(key=lambda item: -item[1])
    found = phones.scan(here)
    assert [survivor for survivor, _ in found] == [survivor for survivor, _ in expected]
    assert [dbm for _, dbm in found] == pytest.approx([dbm for _, dbm in expected])
    assert 2 <= len(found) < 8, "the case is one in which some are heard and some are not"


def test_with_shadowing_nothing_below_the_threshold_is_told(make_scenario: MakeScenario) -> None:
    _, phones = sensor(make_scenario, shadowing_db=8.0)
    scans = [phones.scan(np.array([60.0 * x, 60.0 * y, 50.0])) for x in range(-8, 9) for y in range(-8, 9)]
    heard = [dbm for scan in scans for _, dbm in scan]
    assert min(heard) >= -92
    assert min(heard) < -90, "and what is just above it is"


def test_shadowing_is_gaussian_of_its_standard_deviation_over_places_and_phones(make_scenario: MakeScenario) -> None:
    """800 values: mean, deviation and quartiles are no more than four standard errors off."""
    scenario, phones = sensor(make_scenario, shadowing_db=6.0, detection_dbm=-300.0)
    mission, survivors = scenario.mission, np.array(place(scenario))
    shadowing = []
    for cell in range(100):  # 10 correlation distances apart
        here = np.array([500.0 * cell + 5.0, 5.0, 50.0])
        for survivor, dbm in phones.scan(here):
            distance_m = float(np.linalg.norm(survivors[survivor - 1] - here))
            shadowing.append(
                dbm - (mission.phone_power_dbm - 40.05 - 10 * mission.phone_exponent * np.log10(distance_m))
            )
    values = np.array(shadowing)
    count = len(values)
    assert count == 800, "every phone is heard at every place"
    assert abs(values.mean()) <= 4 * 6.0 / np.sqrt(count)
    assert abs(values.std() / 6.0 - 1) <= 0.1
    within_quartiles = np.mean(np.abs(values) < 0.6745 * 6.0)
    assert abs(within_quartiles - 0.5) <= 0.08


def test_what_a_place_hides_it_hides_every_time(make_scenario: MakeScenario) -> None:
    scenario, phones = sensor(make_scenario, shadowing_db=8.0, detection_dbm=-200.0)
    here, near, elsewhere = (np.array([east, 5.0, 50.0]) for east in (5.0, 5.001, 405.0))
    first = phones.scan(here)
    phones.scan(elsewhere)
    assert phones.scan(here) == first == PhoneSensor(scenario).scan(here)
    assert [dbm for _, dbm in phones.scan(near)] == pytest.approx([dbm for _, dbm in first], abs=1.01)


def shadowing_at(phones: PhoneSensor, places: np.ndarray) -> np.ndarray:
    """Shadowing in dB of each phone [places, phones]."""
    return np.array([phones._shadowing_db(np.arange(8), at) for at in places])


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("apart_m", [5.0, 50.0, *slow(25.0, 100.0)])
def test_shadowing_is_correlated_in_space_as_gudmundson_says_and_has_no_edges(
    make_scenario: MakeScenario, axis: int, apart_m: float
) -> None:
    """exp(-d / 50 m), along each axis: at the corners of the cells of old, 25 m wide, it jumped by 20 dB."""
    _, phones = sensor(make_scenario, shadowing_db=6.0)
    places = np.random.default_rng(1).uniform(-20_000, 20_000, (1500, 3))
    there = places.copy()
    there[:, axis] += apart_m
    first, second = shadowing_at(phones, places), shadowing_at(phones, there)
    found = np.corrcoef(first.ravel(), second.ravel())[0, 1]
    assert found == pytest.approx(np.exp(-apart_m / 50), abs=0.12)  # 256 waves, one seed
    there[:, axis] = places[:, axis] + 0.01
    assert np.abs(shadowing_at(phones, there) - first).max() < 1.5


def test_a_reading_fades_is_noisy_and_comes_in_steps_of_one_decibel(make_scenario: MakeScenario) -> None:
    """Rician power with K = 10 dB has a standard deviation of sqrt(1 + 2 K) / (1 + K) of its mean; noise has 1.5 dB."""
    _, phones = sensor(make_scenario, detection_dbm=-300.0, phone_rice_db=10.0, rssi_sigma_db=1.5)
    scans = [dict(phones.scan(np.array([0.0, 0.0, 50.0]))) for _ in range(2000)]
    told = np.array([[scan[survivor] for survivor in range(1, 9)] for scan in scans])
    assert (told == np.round(told)).all()
    power = 10 ** (phones._reading_db(200_000) / 10)
    noise = 10 ** (np.random.default_rng(1).normal(0, 1.5, 200_000) / 10)
    assert power.mean() / noise.mean() == pytest.approx(1.0, abs=0.01), "fading takes nothing off the mean power"
    spread = (power.std() / power.mean()) ** 2 - (noise.std() / noise.mean()) ** 2
    assert np.sqrt(spread / (1 + (noise.std() / noise.mean()) ** 2)) == pytest.approx(np.sqrt(21) / 11, rel=0.03)
    assert told.std(axis=0) == pytest.approx(np.full(8, np.hypot(1.95, 1.5)), rel=0.1)


def test_five_scans_in_one_place_do_not_say_where_a_phone_is(make_scenario: MakeScenario) -> None:
    """By least squares over the mean of five readings from five places within 20 m of each other."""
    scenario, phones = sensor(
        make_scenario, detection_dbm=-300.0, shadowing_db=4.0, phone_rice_db=10.0, rssi_sigma_db=1.5
    )
    true = np.array(place(scenario)[0])
    places = true + np.array([[60.0, 0, 50], [70, 5, 50], [65, 10, 50], [60, 15, 50], [75, 15, 50]])
    told = [dict(phones.scan(at))[1] for at in places]
    axis = np.arange(-200, 201, 4.0)
    grid = np.stack([*np.meshgrid(axis + true[0], axis + true[1]), np.zeros((101, 101))], axis=-1).reshape(-1, 3)
    distance = np.linalg.norm(grid[:, None] - places, axis=2)
    off = told - (15 - 40.05 - 10 * scenario.mission.phone_exponent * np.log10(distance))
    best = grid[(off**2).sum(axis=1).argmin()]
    assert np.linalg.norm(best - true) > 5.0
