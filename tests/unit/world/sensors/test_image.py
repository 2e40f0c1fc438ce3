"""Rendered images: whoever lies in view is where the camera's geometry puts them, as large as it says, or hidden."""

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from fanet_mw.application import Application
from fanet_mw.bus.messages import CameraImage, SensorReading
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.world.environment.obstacles import Box, Hills, Obstacles
from sim.world.environment.survivors import Survivors
from sim.world.sensors.camera import ImageSensor
from sim.world.sensors.contract import Truth

MakeScenario = Callable[..., Scenario]
WIDTH, HEIGHT = 320, 240
FOV_DEG = 60.0


def shown(
    make_scenario: MakeScenario,
    person: Sequence[float],
    *,
    up: float = 20.0,
    obstacles: Obstacles | None = None,
    other: Sequence[float] = (0.0, 0.0, 500.0),
    **keys: Any,
) -> np.ndarray:
    """What the camera of a UAV `up` above the origin shows; a second UAV flies at `other`."""
    scenario = make_scenario(
        **{
            "nodes.count": 2, "mission.survivors": 1, "sensors.image_hz": 1, "sensors.camera_fov_deg": FOV_DEG,
            "sensors.image_pixels": (WIDTH, HEIGHT), "world.area_m": 500, **keys,
        }
    )  # fmt: skip
    survivors = Survivors(scenario)
    survivors.places = np.array([person], float)
    sensor = ImageSensor(scenario, survivors, obstacles)
    at = np.array([[0.0, 0.0, up], other])
    ((row, image),) = sensor.read(Truth(S, at, np.zeros_like(at)), [0])
    sensor.close()
    assert row == 0
    assert isinstance(image, CameraImage)
    assert (image.t_ns, image.width, image.height) == (S, WIDTH, HEIGHT)
    return np.frombuffer(image.rgb, np.uint8).reshape(HEIGHT, WIDTH, 3).astype(int)


def orange(image: np.ndarray) -> np.ndarray:
    """The pixels of a person, as (row, column)."""
    return np.argwhere((image[:, :, 0] > 150) & (image[:, :, 2] < 60))


def ground_per_pixel_m(depth_m: float) -> float:
    return 2 * depth_m * math.tan(math.radians(FOV_DEG) / 2) / WIDTH


@pytest.mark.parametrize("up", [15.0, 30.0])
def test_a_person_has_the_pixels_and_the_place_that_the_resolution_on_the_ground_says(
    make_scenario: MakeScenario, up: float
) -> None:
    found = orange(shown(make_scenario, (5.0, 3.0, 0.0), up=up))
    pixel_m = ground_per_pixel_m(up - 0.2)  # their upper side is that much nearer
    assert len(found) == pytest.approx(1.7 * 0.5 / pixel_m**2, rel=0.25)
    row, column = found.mean(axis=0)
    assert column == pytest.approx(WIDTH / 2 + 5.0 / pixel_m, abs=1.5), "east is to the right"
    assert row == pytest.approx(HEIGHT / 2 - 3.0 / pixel_m, abs=1.5), "north is above"


@pytest.mark.parametrize("seed", range(12))
def test_people_on_slopes_are_seen_from_30_m_above(make_scenario: MakeScenario, seed: int) -> None:
    """They lie along the ground, which is the same one in the picture."""
    random = np.random.default_rng(seed)
    axis = np.linspace(-200, 200, 41)
    east, north = np.meshgrid(axis, axis)
    waves = np.cos(east / random.uniform(18, 40) + random.uniform(0, 6)) + np.cos(north / random.uniform(18, 40))
    hills = Hills(5.0 * (waves + 2.0), 10.0)
    place = [*random.uniform(-8, 8, 2).tolist(), 0.0]
    place[2] = hills.height_m(*place[:2])
    found = orange(shown(make_scenario, place, up=place[2] + 30, obstacles=Obstacles(hills, ())))
    assert len(found) > 0.5 * 1.7 * 0.5 / ground_per_pixel_m(30) ** 2


def test_nobody_is_seen_under_a_roof_or_rubble_or_behind_a_hill(make_scenario: MakeScenario) -> None:
    inside = Obstacles(None, (Box(5.0, 3.0, 8.0, 8.0, 6.0),))
    assert not len(orange(shown(make_scenario, (5.0, 3.0, 0.0), obstacles=inside)))
    assert not len(orange(shown(make_scenario, (5.0, 3.0, 0.0), **{"mission.buried": 1.0})))
    heights = np.zeros((21, 21))
    heights[:, 12] = 12.0  # a ridge 20 m east of the origin
    ridge = Obstacles(Hills(heights, 10.0), ())
    beyond = (32.0, 0.0, 0.0)
    assert not len(orange(shown(make_scenario, beyond, up=30.0, obstacles=ridge, **{"sensors.camera_fov_deg": 100})))
    assert len(orange(shown(make_scenario, beyond, up=30.0, **{"sensors.camera_fov_deg": 100})))


def test_a_uav_below_is_in_the_image_and_the_one_that_carries_the_camera_is_not(make_scenario: MakeScenario) -> None:
    def dark(image: np.ndarray) -> int:
        return int((image.max(axis=2) < 40).sum())

    nobody_below = shown(make_scenario, (90.0, 90.0, 0.0))
    one_below = shown(make_scenario, (90.0, 90.0, 0.0), other=(2.0, 0.0, 10.0))
    assert dark(nobody_below) == 0
    assert dark(one_below) == pytest.approx(math.pi * 0.25**2 / ground_per_pixel_m(10.0) ** 2, rel=0.35)


class Watcher(Application):
    """Keeps the images that one UAV takes."""

    name = "watcher"

    def __init__(self) -> None:
        self.images: list[CameraImage] = []

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        if isinstance(reading, CameraImage):
            self.images.append(reading)


def test_an_application_on_board_is_handed_images_at_their_rate(make_scenario: MakeScenario) -> None:
    watcher, other = Watcher(), Watcher()
    scenario = make_scenario(
        **{
            "nodes.count": 2, "duration_s": 4, "warmup_s": 0, "drain_s": 1, "world.engine": "kinematic",
            "mobility.model": "onboard", "sensors.image_hz": 2,
            "sensors.image_pixels": (16, 16), "sensors.image_nodes": (1,),
        }
    )  # fmt: skip
    simulate(scenario, applications=lambda node: [watcher] if node == 1 else [other])
    assert [image.t_ns for image in watcher.images] == [k * S // 2 for k in range(9)]
    assert all(len(image.rgb) == 3 * 16 * 16 for image in watcher.images)
    assert not other.images, "it carries no camera of this kind"


def test_a_camera_on_a_uav_that_there_is_not_is_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match=r"sensors\.image_nodes: 3, 9 must be <= nodes\.count = 2"):
        make_scenario(**{"nodes.count": 2, "sensors.image_hz": 1, "sensors.image_nodes": (9, 1, 3)})


def test_without_pybullet_images_are_refused_by_name(
    make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)  # an import of it fails
    with pytest.raises(ConfigError, match=r"sensors\.image_hz = 1 needs pybullet"):
        shown(make_scenario, (0.0, 0.0, 0.0))
