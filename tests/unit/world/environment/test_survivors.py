"""Who hears a survivor's phone: path loss, shadowing that belongs to a place, and a threshold."""

from collections.abc import Callable

import numpy as np
import pytest

from fanet_mw.scenario import Scenario
from sim.world.environment.survivors import place
from sim.world.sensors.phone import PhoneSensor

MakeScenario = Callable[..., Scenario]


def sensor(make_scenario: MakeScenario, **mission: float) -> tuple[Scenario, PhoneSensor]:
    keys = {"survivors": 8, "shadowing_db": 0.0, "detection_dbm": -92.0, "phone_power_dbm": 15.0} | mission
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
        if dbm >= mission.detection_dbm:
            expected.append((survivor, dbm))
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
    for cell in range(100):
        here = np.array([25.0 * cell + 5.0, 5.0, 50.0])
        for survivor, dbm in phones.scan(here):
            distance_m = float(np.linalg.norm(survivors[survivor - 1] - here))
            shadowing.append(
                dbm - (mission.phone_power_dbm - 40.05 - 10 * mission.phone_exponent * np.log10(distance_m))
            )
    values = np.array(shadowing)
    count = len(values)
    assert count == 800, "every phone is heard at every place"
    assert abs(values.mean()) <= 4 * 6.0 / np.sqrt(count)
    assert abs(values.std() / 6.0 - 1) <= 4 / np.sqrt(2 * count)
    within_quartiles = np.mean(np.abs(values) < 0.6745 * 6.0)
    assert abs(within_quartiles - 0.5) <= 4 * 0.5 / np.sqrt(count)


def test_what_a_place_hides_it_hides_every_time(make_scenario: MakeScenario) -> None:
    scenario, phones = sensor(make_scenario, shadowing_db=8.0, detection_dbm=-200.0)
    here, near, elsewhere = (np.array([east, 5.0, 50.0]) for east in (5.0, 5.001, 405.0))
    first = phones.scan(here)
    phones.scan(elsewhere)
    assert phones.scan(here) == first == PhoneSensor(scenario).scan(here)
    assert [dbm for _, dbm in phones.scan(near)] == pytest.approx([dbm for _, dbm in first], abs=0.01)


def test_what_is_kept_of_shadowing_is_bounded_and_changes_nothing(
    make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario, phones = sensor(make_scenario, shadowing_db=8.0, detection_dbm=-200.0)
    monkeypatch.setattr("sim.world.sensors.phone.KEPT_VALUES", 20)
    tour = [np.array([30.0 * i, 5.0, 50.0]) for i in range(-20, 21)]
    there, back = [phones.scan(at) for at in tour], [phones.scan(at) for at in reversed(tour)]
    assert there == back[::-1] == [PhoneSensor(scenario).scan(at) for at in tour]
    assert len(phones._shadow) <= 20
