"""Rendered images of a camera that looks straight down, for users who run an image detector of their own on board.

The built-in detector needs no images: `sensors/camera.py` is a model of camera and detector in one. This sensor has the
same field of view, and shows a person with the same number of pixels: one pixel covers 2 depth tan(fov / 2) / width of
the ground. The camera hangs in a gimbal without error, so that the width of the image is always along east.
"""

import math
from collections.abc import Iterator, Sequence
from importlib.util import find_spec

from fanet_mw.bus.messages import CameraImage, Message
from fanet_mw.errors import ConfigError
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.world.environment.obstacles import Obstacles
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Sensor, Truth


class ImageSensor(Sensor):
    """One camera with rendered images on each UAV of `sensors.image_nodes`, by default on all UAVs."""

    kind = "image"

    def __init__(self, scenario: Scenario, survivors: Survivors, obstacles: Obstacles | None) -> None:
        config = scenario.sensors
        if find_spec("pybullet") is None:
            raise ConfigError(
                f"sensors.image_hz = {config.image_hz:g} needs pybullet to render: pip install 'fanet-mw[pybullet]'"
            )
        from sim.world.sensors.scene import Scene

        self.period_ns = round(S / config.image_hz)
        self._tan_half_fov = math.tan(math.radians(config.camera_fov_deg) / 2)
        self._pixels = config.image_pixels
        self._carriers = frozenset(config.image_nodes or scenario.uav_ids)
        not_buried = survivors.places[~survivors.buried]
        self._scene = Scene(obstacles, not_buried, area_m=scenario.world.area_m, uavs=scenario.nodes.count)

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        width, height = self._pixels
        self._scene.move(truth.at)
        for row in (row for row in rows if row + 1 in self._carriers):
            image = self._scene.image(truth.at[row], pixels=self._pixels, tan_half_fov=self._tan_half_fov)
            yield row, CameraImage(truth.now_ns, width, height, image.tobytes())

    def close(self) -> None:
        self._scene.close()
