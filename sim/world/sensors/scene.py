"""Renders what a camera sees that looks straight down on the world. Pybullet does it on the processor, without a GPU.

The ground, the hills and the buildings have one color each. People are orange boxes that lie along east, and UAVs are
black discs. No application of this project reads the images: its own detector is a model that needs none
(`sensors/camera.py`). Not modeled: textures, shadows, weather, darkness, motion blur, and errors of the lens.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from sim.world.arrays import Rows, Values
from sim.world.engines.quiet_pybullet import pybullet
from sim.world.environment.obstacles import Box, Hills, Obstacles

Image = npt.NDArray[np.uint8]
"""Pixels as [row, column, color]: rows from north to south, columns from west to east, colors red, green and blue."""
_Color = tuple[float, float, float, float]
_GROUND: Final[_Color] = (0.42, 0.47, 0.32, 1.0)
_HILL: Final[_Color] = (0.36, 0.42, 0.28, 1.0)
_BUILDING: Final[_Color] = (0.62, 0.62, 0.66, 1.0)
_PERSON: Final[_Color] = (1.0, 0.45, 0.0, 1.0)
_UAV: Final[_Color] = (0.05, 0.05, 0.05, 1.0)
_PERSON_M: Final = (1.7, 0.5, 0.2)
"""Length, width and thickness of a person who lies on the ground, the same size as in `sensors/camera.py`."""
_UAV_RADIUS_M: Final = 0.25
_UAV_HEIGHT_M: Final = 0.1
_BEYOND_M: Final = 1000.0
"""The flat ground extends this far beyond the area on each side."""
_NEAR_M: Final = 0.5
"""Nothing nearer to the camera than this is rendered, so that the UAV that carries it does not fill the image."""
_SUN: Final = (1.0, -1.0, 4.0)
"""The direction in which the sun stands."""


class Scene:
    """The ground, buildings, people and UAVs of a world, which can be rendered from any place above them."""

    def __init__(self, obstacles: Obstacles | None, people: Rows, *, area_m: float, uavs: int) -> None:
        """`people`: the places of all people who are not buried [n, 3]."""
        self._client = pybullet.connect(pybullet.DIRECT)
        half = area_m / 2 + _BEYOND_M
        self._put(self._box_shape((2 * half, 2 * half, 1.0), _GROUND), (0.0, 0.0, -0.5))
        if obstacles is not None:
            for box in obstacles.boxes:
                self._build(box)
            if obstacles.hills is not None:
                self._put(self._hills_shape(obstacles.hills), (0.0, 0.0, 0.0))
        lying = self._box_shape(_PERSON_M, _PERSON) if len(people) else -1
        hills = obstacles.hills if obstacles else None
        for east, north, up in people.tolist():
            slopes = _slopes_rad(hills, east, north) if hills else (0.0, 0.0)
            self._put(lying, (east, north, up + _PERSON_M[2] / 2), turned=(slopes[1], -slopes[0], 0.0))
        disc = self._shape(pybullet.GEOM_CYLINDER, _UAV, radius=_UAV_RADIUS_M, length=_UAV_HEIGHT_M)
        self._uavs = [self._put(disc, (0.0, 0.0, -10.0)) for _ in range(uavs)]

    def move(self, at: Rows) -> None:
        """Move the UAVs to their places [n, 3]."""
        for body, place in zip(self._uavs, at.tolist(), strict=True):
            pybullet.resetBasePositionAndOrientation(body, place, (0.0, 0.0, 0.0, 1.0), physicsClientId=self._client)

    def image(self, eye: Values, *, pixels: tuple[int, int], tan_half_fov: float) -> Image:
        """The image of a camera at the place `eye`; its field of view is measured across the width of the image."""
        width, height = pixels
        east, north, up = eye.tolist()
        view = pybullet.computeViewMatrix((east, north, up), (east, north, up - 1.0), (0.0, 1.0, 0.0))
        near = tan_half_fov * _NEAR_M
        upright = near * height / width
        lens = pybullet.computeProjectionMatrix(-near, near, -upright, upright, _NEAR_M, max(up, 1.0) + 10.0)
        found = pybullet.getCameraImage(
            width, height, view, lens, lightDirection=_SUN, shadow=0, renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_NO_SEGMENTATION_MASK, physicsClientId=self._client,
        )  # fmt: skip
        return np.ascontiguousarray(np.reshape(np.asarray(found[2], np.uint8), (height, width, 4))[:, :, :3])

    def close(self) -> None:
        """Release the renderer; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def _build(self, box: Box) -> None:
        shape = self._box_shape((box.width, box.depth, box.roof), _BUILDING)
        self._put(shape, (box.east, box.north, box.roof / 2), turned=(0.0, 0.0, box.yaw))

    def _hills_shape(self, hills: Hills) -> int:
        """The surface through the heights of the grid: two triangles for each of its cells."""
        corners, triangles = hills.mesh()
        slope_north, slope_east = np.gradient(np.pad(hills.heights, 1, mode="edge"), hills.cell_m)
        upright = np.stack([-slope_east.ravel(), -slope_north.ravel(), np.ones(len(corners))], axis=1)
        return self._shape(
            pybullet.GEOM_MESH, _HILL, vertices=corners.tolist(), indices=triangles.ravel().tolist(),
            normals=(upright / np.linalg.norm(upright, axis=1, keepdims=True)).tolist(),
        )  # fmt: skip

    def _box_shape(self, size_m: Sequence[float], color: _Color) -> int:
        return self._shape(pybullet.GEOM_BOX, color, halfExtents=[side / 2 for side in size_m])

    def _shape(self, kind: int, color: _Color, **size: object) -> int:
        return int(pybullet.createVisualShape(kind, rgbaColor=color, physicsClientId=self._client, **size))

    def _put(self, shape: int, at: Sequence[float], *, turned: Sequence[float] = (0.0, 0.0, 0.0)) -> int:
        """Put a body somewhere, rotated about east, north and up [rad]."""
        attitude = pybullet.getQuaternionFromEuler(turned)
        return int(
            pybullet.createMultiBody(
                baseVisualShapeIndex=shape, basePosition=at, baseOrientation=attitude, physicsClientId=self._client
            )
        )


def _slopes_rad(hills: Hills, east: float, north: float) -> tuple[float, float]:
    """The angles by which the ground rises to the east and to the north across a person who lies there."""
    length, width, _ = _PERSON_M
    sides = np.array(
        [[east - length / 2, north], [east + length / 2, north], [east, north - width / 2], [east, north + width / 2]]
    )
    west_m, east_m, south_m, north_m = hills.at(sides).tolist()
    return math.atan2(east_m - west_m, length), math.atan2(north_m - south_m, width)
