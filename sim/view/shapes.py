"""Small meshes and outlines of what is shown."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.float32]
Faces = npt.NDArray[np.int32]
_BOX: Final = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)], np.float32)
_BOX_FACES: Final = np.array(
    [
        (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
        (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
    ],
    np.int32,
)  # fmt: skip


def box() -> tuple[Rows, Faces]:
    return _BOX, _BOX_FACES


def quadrotor() -> tuple[Rows, Faces]:
    """A multirotor of span 1 that faces +x: two arms, four rotors and a nose."""
    parts = [_moved(1.0, 0.08, 0.08, turn=math.pi / 4), _moved(1.0, 0.08, 0.08, turn=-math.pi / 4)]
    parts.append(_moved(0.34, 0.2, 0.14, at=(0.1, 0.0, 0.03)))
    vertices = [corners for corners, _ in parts]
    faces = [triangles for _, triangles in parts]
    for quarter in range(4):
        angle = math.pi / 4 + quarter * math.pi / 2
        rim, disk = _disk(0.22, 0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.09)
        vertices.append(rim)
        faces.append(disk)
    return _joined(vertices, faces)


def ring(radius: float, width: float, *, corners: int = 24) -> tuple[Rows, Faces]:
    """A flat ring about the origin, seen from both sides."""
    angles = np.arange(corners) * 2 * math.pi / corners
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(corners)], axis=1)
    vertices = np.concatenate([around * (radius - width / 2), around * (radius + width / 2)]).astype(np.float32)
    here = np.arange(corners)
    after = (here + 1) % corners
    up = np.concatenate(
        [
            np.stack([here, here + corners, after + corners], axis=1),
            np.stack([here, after + corners, after], axis=1),
        ]
    )
    return vertices, np.concatenate([up, up[:, ::-1]]).astype(np.int32)


def ball(*, rings: int = 8, sectors: int = 12) -> tuple[Rows, Faces]:
    """A sphere of diameter 1."""
    up, around = np.meshgrid(np.linspace(0, math.pi, rings + 1), np.linspace(0, 2 * math.pi, sectors + 1))
    vertices = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], axis=2) / 2
    at = (np.arange(sectors)[:, None] * (rings + 1) + np.arange(rings)[None]).ravel()
    faces = np.concatenate(
        [
            np.stack([at, at + 1, at + rings + 2], axis=1),
            np.stack([at, at + rings + 2, at + rings + 1], axis=1),
        ]
    )
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def circle_segments(east: float, north: float, up: float, radius: float, *, corners: int = 32) -> Rows:
    """The outline of a level circle as line segments [corners, 2, 3]."""
    angles = np.arange(corners + 1) * 2 * math.pi / corners
    heights = np.full(corners + 1, up)
    around = np.stack([east + radius * np.cos(angles), north + radius * np.sin(angles), heights], axis=1)
    return np.stack([around[:-1], around[1:]], axis=1).astype(np.float32)


def rgb(web: str) -> tuple[int, int, int]:
    return int(web[1:3], 16), int(web[3:5], 16), int(web[5:7], 16)


def linear(paints: object) -> npt.NDArray[np.uint8]:
    """Colors as light, sRGB's curve undone, which viser takes in batches and at ends of lines."""
    return np.rint(255 * (np.asarray(paints, float) / 255) ** 2.2).astype(np.uint8)


def _moved(
    length: float, width: float, height: float, *, turn: float = 0.0, at: tuple[float, float, float] = (0, 0, 0)
) -> tuple[Rows, Faces]:
    corners = _BOX * np.array([length, width, height], np.float32)
    cos, sin = math.cos(turn), math.sin(turn)
    turned = corners @ np.array([(cos, sin, 0), (-sin, cos, 0), (0, 0, 1)], np.float32)
    return (turned + np.array(at, np.float32)).astype(np.float32), _BOX_FACES


def _disk(radius: float, x: float, y: float, z: float, *, corners: int = 10) -> tuple[Rows, Faces]:
    angles = np.arange(corners) * 2 * math.pi / corners
    rim = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles), np.full(corners, z)], axis=1)
    vertices = np.concatenate([[[x, y, z]], rim]).astype(np.float32)
    here = np.arange(corners) + 1
    after = here % corners + 1
    up = np.stack([np.zeros(corners), here, after], axis=1)
    return vertices, np.concatenate([up, up[:, ::-1]]).astype(np.int32)


def _joined(vertices: list[Rows], faces: list[Faces]) -> tuple[Rows, Faces]:
    starts = np.cumsum([0, *(len(part) for part in vertices[:-1])])
    return (
        np.concatenate(vertices).astype(np.float32),
        np.concatenate([part + start for part, start in zip(faces, starts, strict=True)]).astype(np.int32),
    )
