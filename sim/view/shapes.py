"""Small meshes and outlines of what is shown."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from trimesh import creation, util

Rows = npt.NDArray[np.float32]
Faces = npt.NDArray[np.int32]


def box() -> tuple[Rows, Faces]:
    return _arrays(creation.box())


def quadrotor() -> tuple[Rows, Faces]:
    """A multirotor of span 1 that faces +x: two arms, four rotors and a nose."""
    angles = [math.pi / 4 + quarter * math.pi / 2 for quarter in range(4)]
    parts = [creation.box((1.0, 0.08, 0.08), _at(turn=angle)) for angle in angles[:2]]
    parts.append(creation.box((0.34, 0.2, 0.14), _at(0.1, 0.0, 0.03)))
    for angle in angles:
        rotor = _at(0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.09)
        parts.append(creation.cylinder(0.22, height=0.02, sections=10, transform=rotor))
    return _arrays(util.concatenate(parts))


def ring(radius: float, width: float) -> tuple[Rows, Faces]:
    """A flat ring about the origin."""
    return _arrays(creation.annulus(radius - width / 2, radius + width / 2, height=0.1 * width, sections=24))


def ball() -> tuple[Rows, Faces]:
    """A sphere of diameter 1."""
    return _arrays(creation.uv_sphere(0.5, count=(8, 12)))


def _at(x: float = 0.0, y: float = 0.0, z: float = 0.0, *, turn: float = 0.0) -> npt.NDArray[np.float64]:
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([(cos, -sin, 0, x), (sin, cos, 0, y), (0, 0, 1, z), (0, 0, 0, 1)])


def _arrays(mesh: Any) -> tuple[Rows, Faces]:  # noqa: ANN401  (trimesh's classes)
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def circle_segments(east: float, north: float, up: float, radius: float) -> Rows:
    """The outline of a level circle as line segments [n, 2, 3]."""
    angles = np.linspace(0.0, 2 * math.pi, 33)
    heights = np.full(len(angles), up)
    around = np.stack([east + radius * np.cos(angles), north + radius * np.sin(angles), heights], axis=1)
    return np.stack([around[:-1], around[1:]], axis=1).astype(np.float32)


def rgb(web: str) -> tuple[int, int, int]:
    return int(web[1:3], 16), int(web[3:5], 16), int(web[5:7], 16)


def linear(paints: object) -> npt.NDArray[np.uint8]:
    """Colors as light, sRGB's curve undone, which viser takes in batches and at ends of lines."""
    return np.rint(255 * (np.asarray(paints, float) / 255) ** 2.2).astype(np.uint8)
