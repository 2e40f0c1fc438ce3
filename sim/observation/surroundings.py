"""The ground, buildings and no-fly areas of a scenario as plain shapes, for those who draw them."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Box, Hills, Indices, Obstacles, obstacles

_CORNERS: Final = 32
"""The number of corners of the outline of a circle."""


class Surroundings(NamedTuple):
    """What stands about a swarm."""

    corners: np.ndarray
    """Corners of the ground [n, 3]."""
    triangles: Indices
    hills: Hills | None
    boxes: Sequence[Box]
    no_fly: Sequence[Sequence[tuple[float, float]]]
    half_m: float

    def on_ground(self, at: Enu, *, above_m: float = 0.0) -> Enu:
        up = self.hills.height_m(at.east, at.north) if self.hills is not None else 0.0
        return Enu(at.east, at.north, up + above_m)


def surroundings(scenario: Scenario) -> Surroundings:
    """The surroundings of a scenario; a map file that is gone is shown as flat, empty ground."""
    try:
        found = obstacles(scenario, np.array(positions(scenario)))
    except ConfigError:
        found = Obstacles(None, ())
    half = scenario.world.area_m / 2
    if found.hills is not None:
        corners, triangles = found.hills.mesh()
    else:
        corners = np.array([(x, y, 0.0) for y in (-half, half) for x in (-half, half)])
        triangles = np.array([[0, 1, 3], [0, 3, 2]])
    no_fly = [_circle(*circle) for circle in scenario.world.no_fly_m]
    return Surroundings(corners, triangles, found.hills, found.boxes, no_fly, half)


def _circle(east: float, north: float, radius: float) -> list[tuple[float, float]]:
    steps = (2 * math.pi * step / _CORNERS for step in range(_CORNERS))
    return [(east + radius * math.cos(angle), north + radius * math.sin(angle)) for angle in steps]
