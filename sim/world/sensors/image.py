"""A camera that looks straight down, as an image: for those who bring detectors of their own on board.

The field of view is that of `sensors/camera.py`, which says whom the built-in detector finds; here it is rendered
(`sensors/scene.py`). The pixels of a person are as many as the formula there says: ground per pixel = 2 depth tan(fov /
2) / width. A gimbal keeps the image's width along east, without any error.
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
    """The rendered images of all UAVs, one camera for each."""

    kind = "image"

    def __init__(self, scenario: Scenario, survivors: Survivors, obstacles: Obstacles | None) -> None:
        config = scenario.sensors
        if find_spec("pybullet") is None:
            raise ConfigError(
                f"sensors.image_hz = {config.image_hz:g} needs pybullet to render: pip install 'fanet-mw[pybullet]'"
            )
        from sim.world.sensors.scene import Scene

        self.period_ns = round(S / config.image_hz)
        self._half_width = math.tan(math.radians(config.camera_fov_deg) / 2)
        self._pixels = config.image_pixels
        self._carriers = frozenset(config.image_nodes or scenario.node_ids)
        in_sight = survivors.places[~survivors.buried]
        self._scene = Scene(obstacles, in_sight, area_m=scenario.world.area_m, uavs=scenario.nodes.count)

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        width, height = self._pixels
        self._scene.move(truth.at)
        for row in (row for row in rows if row + 1 in self._carriers):
            image = self._scene.image(truth.at[row], pixels=self._pixels, half_width=self._half_width)
            yield row, CameraImage(truth.now_ns, width, height, image.tobytes())

    def close(self) -> None:
        self._scene.close()
