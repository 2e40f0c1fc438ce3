"""The marker on a UAV's own pad, a square with a code that no other pad has, as a camera that looks down finds it.

It is found while all of it is in the image and at least 25 pixels wide: 2.5 a cell of AprilTag's tag36h11 with its
border (Olson, ICRA 2011). Directions err by `sensors.camera_sigma_deg`, attitude included, distances by 2 % (assumed).
Not modeled: darkness, blur, dust that rotors raise.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from fanet_mw.bus.messages import LandingTarget, Message
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import Enu, S
from sim.world.environment.layout import positions
from sim.world.sensors.contract import Sensor, Truth, generator, shaken

_LEAST_PIXELS: Final = 25.0
_DISTANCE_SIGMA: Final = 0.02


class PadSensor(Sensor):
    """The finders of all UAVs, each of the marker on its own pad."""

    kind = "pad"

    def __init__(self, scenario: Scenario) -> None:
        config = scenario.sensors
        width, _ = config.camera_pixels
        self.period_ns = round(S / config.pad_hz)
        self._pads = np.array(positions(scenario), dtype=np.float64)
        self._tan_east, self._tan_north = config.tan_half_fov
        self._half_m = config.pad_marker_m / 2
        self._most_m = config.pad_marker_m * width / (2 * _LEAST_PIXELS * self._tan_east)
        self._sigma_rad = math.radians(config.camera_sigma_deg)
        self._random = generator(scenario.seed, "pad")

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        picked = list(rows)
        offsets = self._pads[picked] - truth.at[picked]
        down_m, across_m = -offsets[:, 2], np.abs(offsets[:, :2]) + self._half_m
        shown = (down_m <= self._most_m) & (across_m <= down_m[:, None] * [self._tan_east, self._tan_north]).all(axis=1)
        for index in np.flatnonzero(shown).tolist():
            away_m = np.linalg.norm(offsets[index]) * (1 + self._random.normal(0.0, _DISTANCE_SIGMA))
            seen = away_m * shaken(self._random, offsets[index] / np.linalg.norm(offsets[index]), self._sigma_rad)
            yield picked[index], LandingTarget(truth.now_ns, Enu(*seen.tolist()))
