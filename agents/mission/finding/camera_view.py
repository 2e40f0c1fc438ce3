"""What a UAV knows of its camera: what an image shows of the ground, and how much one image tells about a person.

    evidence of a sighting     ln(P(a person is recognized) / P(a false alarm stands there))
    evidence of an empty image ln(1 - P(a person is recognized)), if the place was in the image

Their sum over the images of a place is the logarithm of a likelihood ratio (Wald's sequential test): a person stands
there, or false alarms happened to fall together.
"""

import math
from typing import Final

from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu

_PERSON_M: Final = math.sqrt(1.7 * 0.5)
"""The size of a person who lies on the ground."""
_MOST: Final = 0.7
"""The greatest probability of recognition that is relied on: trees, walls and postures hide people."""
_LEAST_FALSE: Final = 1e-5
"""The least probability of a false alarm at a place in one image, whatever is said of the camera."""
PLACE_M2: Final = math.pi * 6.0 * 6.0
"""The area within which two exact sightings are taken for the same person."""
INSIDE: Final = 0.9
"""A person is expected in an image within this share of its half width and height."""


def recognized_share(pixels: float, *, cycles_for_half: float) -> float:
    """The probability that a person of so many pixels is recognized (docs/reference/sensors.md)."""
    x = max(1e-9, pixels / 2 / cycles_for_half)
    odds = math.exp(min(700.0, (2.7 + 0.7 * x) * math.log(x)))
    return odds / (1 + odds)


class CameraView:
    """The camera of one UAV, which looks straight down."""

    def __init__(self, scenario: Scenario) -> None:
        sensors = scenario.sensors
        self.hz = sensors.camera_hz
        self._width, _ = sensors.camera_pixels
        self._cycles = sensors.camera_cycles
        self._tan_east, self._tan_north = sensors.tan_half_fov
        self._false_per_image = sensors.camera_false_per_hour / sensors.camera_hz / 3600 if sensors.camera_hz else 0.0

    def recognized(self, height_m: float) -> float:
        """The probability that a person is recognized in one image from this height above ground."""
        pixels = _PERSON_M * self._width / (2 * max(0.1, height_m) * self._tan_east)
        return recognized_share(pixels, cycles_for_half=self._cycles)

    def shows(self, place: Enu, here: Enu) -> bool:
        """True if a place on the ground is well inside the image; both heights are above the ground below the UAV."""
        down_m = here.up - place.up
        return (
            abs(place.east - here.east) <= INSIDE * down_m * self._tan_east
            and abs(place.north - here.north) <= INSIDE * down_m * self._tan_north
        )

    def sighting_evidence(self, height_m: float) -> float:
        image_m2 = max(1.0, 4 * height_m * height_m * self._tan_east * self._tan_north)
        false = self._false_per_image * min(1.0, PLACE_M2 / image_m2)
        return math.log(max(1e-3, min(_MOST, self.recognized(height_m))) / max(_LEAST_FALSE, min(0.5, false)))

    def empty_evidence(self, height_m: float) -> float:
        """The evidence of one image that shows nobody at a place, from this height; it is negative."""
        return math.log(1 - min(_MOST, self.recognized(height_m)))
