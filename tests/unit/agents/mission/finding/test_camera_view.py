"""What one image tells: how far it reaches, and how much a sighting and an empty image count."""

import math

import pytest
from kit import MakeScenario

from agents.mission.finding.camera_view import CameraView, recognized_share
from fanet_mw.units import Enu

HALF_WIDTH = 0.75
"""Of an image, over the height from which it is taken."""
FOV_DEG = 2 * math.degrees(math.atan(HALF_WIDTH))


def view_of(make_scenario: MakeScenario, **sensors: float | list[int]) -> CameraView:
    given = {
        "camera_hz": 2.0,
        "camera_fov_deg": FOV_DEG,
        "camera_pixels": [4000, 2000],
        "camera_cycles": 4.0,
        **sensors,
    }
    return CameraView(make_scenario(**{f"sensors.{key}": value for key, value in given.items()}))


def test_half_of_all_people_are_recognized_at_the_stated_cycles_of_two_pixels() -> None:
    assert recognized_share(8.0, cycles_for_half=4.0) == 0.5
    ratio = 2.0  # Johnson's criteria: odds of x^(2.7 + 0.7 x)
    odds = math.pow(ratio, 2.7 + 0.7 * ratio)
    assert recognized_share(16.0, cycles_for_half=4.0) == pytest.approx(odds / (1 + odds))
    assert recognized_share(0.0, cycles_for_half=4.0) == pytest.approx(0.0, abs=1e-20)
    assert recognized_share(1e6, cycles_for_half=4.0) == 1.0, "and no overflow"


def test_a_person_of_1_7_by_half_a_metre_is_as_many_pixels_as_the_image_has_over_its_width(
    make_scenario: MakeScenario,
) -> None:
    view = view_of(make_scenario)
    wide_m = 2 * 100.0 * HALF_WIDTH
    pixels = math.sqrt(1.7 * 0.5) / wide_m * 4000
    assert view.recognized(100.0) == pytest.approx(recognized_share(pixels, cycles_for_half=4.0))
    coarse = view_of(make_scenario, camera_pixels=[400, 200], camera_cycles=100.0)
    assert coarse.recognized(0.0) == coarse.recognized(0.1) > coarse.recognized(0.2)


def test_a_place_is_shown_within_nine_tenths_of_the_half_width_and_height(make_scenario: MakeScenario) -> None:
    view, here = view_of(make_scenario), Enu(7, -5, 100)
    for sign in (-1, 1):
        for reach_m, shown in ((67.4, True), (67.6, False)):
            assert view.shows(Enu(7 + sign * reach_m, -5, 0), here) is shown
            assert view.shows(Enu(7, -5 + sign * reach_m / 2, 0), here) is shown, "half as high as wide"
            assert view.shows(Enu(7 + sign * reach_m, -5, 30), here._replace(up=130)) is shown, "on a hill"
    assert view.shows(here, here), "the place at which the UAV stands"


def test_the_evidence_of_a_sighting_is_the_log_of_recognition_over_a_false_alarm_at_that_place(
    make_scenario: MakeScenario,
) -> None:
    per_image = 1800.0 / 2 / 3600
    view = view_of(make_scenario, camera_false_per_hour=1800.0)
    for height_m in (20.0, 60.0, 120.0):
        image_m2 = 2 * height_m * height_m * HALF_WIDTH * HALF_WIDTH
        false = per_image * 36 * math.pi / image_m2
        expected = math.log(min(0.7, view.recognized(height_m)) / false)
        assert view.sighting_evidence(height_m) == pytest.approx(expected), height_m
    assert view.sighting_evidence(2.0) == pytest.approx(math.log(0.7 / per_image)), "an image within one place"
    assert view.sighting_evidence(0.0) == pytest.approx(math.log(0.7 / per_image))


def test_evidence_is_bounded_whatever_is_said_of_the_camera(make_scenario: MakeScenario) -> None:
    assert view_of(make_scenario).sighting_evidence(60.0) == pytest.approx(math.log(0.7 / 1e-5)), "no false alarms"
    blind = view_of(make_scenario, camera_false_per_hour=1e6, camera_cycles=100.0, camera_pixels=[400, 200])
    assert blind.sighting_evidence(60.0) == pytest.approx(math.log(1e-3 / 0.5)), "more false alarms than images"
    assert view_of(make_scenario, camera_hz=0.0).sighting_evidence(60.0) == pytest.approx(math.log(0.7 / 1e-5))


def test_an_empty_image_speaks_against_a_person_as_far_as_one_would_have_been_recognized(
    make_scenario: MakeScenario,
) -> None:
    view = view_of(make_scenario)
    assert view.empty_evidence(10.0) == pytest.approx(math.log(0.3)), "trees and postures hide people"
    assert view.empty_evidence(400.0) == pytest.approx(math.log(1 - view.recognized(400.0)))
