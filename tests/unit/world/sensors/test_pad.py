"""The marker on a pad, as the camera above it finds it."""

from collections.abc import Callable

import numpy as np
import pytest

from fanet_mw.bus.messages import LandingTarget
from fanet_mw.scenario import Scenario
from sim.world.sensors.contract import Truth
from sim.world.sensors.pad import PadSensor


def seen_from(make_scenario: Callable[..., Scenario], *at: tuple[float, float, float]) -> list[LandingTarget | None]:
    """What each of several images of one UAV's own pad tells, its error left out."""
    keys = {"nodes.count": 1, "nodes.on_ground": True, "sensors.camera_fov_deg": 90, "sensors.camera_sigma_deg": 0}
    sensor, told = PadSensor(make_scenario(**keys)), []
    for place in at:
        readings = [*sensor.read(Truth(0, np.array([place]), np.zeros((1, 3))), [0])]
        told.append(readings[0][1] if readings else None)
    return told  # type: ignore[return-value]


def test_a_camera_finds_the_marker_below_that_is_large_enough_and_whole_in_the_image(
    make_scenario: Callable[..., Scenario],
) -> None:
    near, far, aside, ahead, cut, on_it = seen_from(
        make_scenario, (0, 0, 30), (0, 0, 32), (-9, 0, 10), (0, -5, 10), (0, -5.5, 10), (0, 0, 0.1)
    )
    assert near is not None
    assert near.offset.up == pytest.approx(-30, rel=0.1)
    assert far is None
    assert aside is not None
    assert aside.offset.east == pytest.approx(9, rel=0.1)
    assert ahead is not None, "an image is wider than high"
    assert cut is None
    assert on_it is None
