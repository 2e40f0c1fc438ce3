"""A camera that looks straight down, and a detector of people in its images, as one model.

    across a person     sqrt(1.7 m x 0.5 m) = 0.92 m, who lies on the ground
    ground per pixel    2 depth tan(fov / 2) / width
    pixels              0.92 m / ground per pixel;   line pairs N = pixels / 2
    P(recognized)       x^E / (1 + x^E),  x = N / N50,  E = 2.7 + 0.7 x

N50 is the number of line pairs with which half of the observers recognize what they see (Johnson, "Analysis of image
forming systems", 1958). The curve around it is the target transfer probability function of the Night Vision
Laboratory's static performance model (Ratches et al., ECOM-7043, 1975). Each image is a new trial. A person who is
buried, or hidden from the camera by anything solid, is not seen. The pixels that a detector counts are off by a tenth
(assumed). A gimbal keeps the image's width along east; angular errors are Gaussian. False alarms are a Poisson process,
anywhere in the image. Not modeled: light, motion blur, and that successive images are alike.

Rendered images are for users who run a detector of their own on board: the field of view is the same, and the camera
shows a person with the same number of pixels. Its gimbal has no error.
"""

import math
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Final

import numpy as np
import numpy.typing as npt

from fanet_mw.bus.messages import Camera, CameraImage, Message, Person
from fanet_mw.errors import ConfigError
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.world.arrays import Flags, Rows, Values
from sim.world.environment.obstacles import Obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors
from sim.world.sensors.contract import Sensor, Truth, angles, generator, shaken

PERSON_M: Final = math.sqrt(1.7 * 0.5)
SIZE_SIGMA: Final = 0.1
"""Relative error of the size of a person in an image."""
_EYE_M: Final = 0.3
"""The height above ground of the part of a person that a ray must reach."""


def recognized_share(pixels: Values, *, cycles_for_half: float) -> Values:
    """The probability that a person of so many pixels is recognized, by the target transfer probability function."""
    x = np.maximum(pixels, 1e-9) / 2 / cycles_for_half
    odds = np.exp(np.minimum((2.7 + 0.7 * x) * np.log(x), 700.0))
    return np.asarray(odds / (1 + odds))


class CameraSensor(Sensor):
    """The cameras of all UAVs, one for each."""

    kind = "camera"

    def __init__(self, scenario: Scenario, survivors: Survivors, solids: Solids) -> None:
        config = scenario.sensors
        self.period_ns = round(S / config.camera_hz)
        self._tan_half_fov, self._tan_half_fov_height = config.tan_half_fov
        self._width, _ = config.camera_pixels
        self._cycles = config.camera_cycles
        self._sigma_rad = math.radians(config.camera_sigma_deg)
        self._false_per_image = config.camera_false_per_hour / config.camera_hz / 3600
        self._survivors, self._solids = survivors, solids
        self._random = generator(scenario.seed, "camera")

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        inside = self._in_view(truth.at[list(rows)])
        some = np.asarray(inside.any(axis=1))
        for index, row in enumerate(rows):
            if not some[index] and not self._false_per_image:
                continue
            at = truth.at[row]
            people = [*self._true_people(at, np.flatnonzero(inside[index])), *self._false_people(at)]
            if people:
                yield row, Camera(truth.now_ns, tuple(people))

    def pixels(self, depth_m: Values) -> Values:
        """The number of pixels across a person at a depth below the camera."""
        return np.asarray(PERSON_M * self._width / (2 * np.maximum(depth_m, 0.1) * self._tan_half_fov))

    def _in_view(self, at: Rows) -> Flags:
        """Which survivors are inside the image of a camera at each place [n, survivors]."""
        offset = self._survivors.places - at[:, None]
        east, north, depth = offset[..., 0], offset[..., 1], -offset[..., 2]
        inside = (np.abs(east) <= depth * self._tan_half_fov) & (np.abs(north) <= depth * self._tan_half_fov_height)
        return np.asarray(inside & (depth > 0) & ~self._survivors.buried)

    def _true_people(self, at: Values, found: npt.NDArray[np.intp]) -> Iterator[Person]:
        if not len(found):
            return
        offset = self._survivors.places - at
        target = self._survivors.places[found] + [0.0, 0.0, _EYE_M]
        found = found[~self._solids.blocked(np.broadcast_to(at, target.shape), target)]
        pixels = self.pixels(-offset[found, 2])
        seen = self._random.random(len(found)) < recognized_share(pixels, cycles_for_half=self._cycles)
        for index, across in zip(found[seen].tolist(), pixels[seen].tolist(), strict=True):
            direction = offset[index] / np.linalg.norm(offset[index])
            yield Person(*angles(shaken(self._random, direction, self._sigma_rad)), self._counted(across))

    def _false_people(self, at: Values) -> Iterator[Person]:
        if not self._false_per_image:
            return
        for _ in range(int(self._random.poisson(self._false_per_image))):
            x, y = self._random.uniform(-1.0, 1.0, 2).tolist()
            depth_m = np.maximum(0.1, at[2:] - self._solids.ground_m(at[None]))
            yield Person(
                *angles(np.array([x * self._tan_half_fov, y * self._tan_half_fov_height, -1.0])),
                self._counted(float(self.pixels(depth_m)[0])),
            )

    def _counted(self, pixels: float) -> float:
        """The pixels that the detector says."""
        return float(max(1.0, round(pixels * (1 + self._random.normal(0.0, SIZE_SIGMA)))))


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
        self._tan_half_fov, _ = config.tan_half_fov
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
