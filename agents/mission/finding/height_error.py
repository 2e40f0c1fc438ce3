"""How much higher one UAV is than it takes itself to be, by people whom it has seen from several places.

    seen_i = place - error * lean_i + noise_i        lean_i = (place - position_i) / height_i, along the ground

GPS is wrong by metres in height, for minutes and for all UAVs of a swarm alike, so whoever is seen from one side is
placed too near to it, or too far beyond. Seen from two sides, the two places tell the error: by least squares, over all
people together who are certainly there (false alarms lean as their places do), from a prior by what is known of the
receiver. Weights are inverse variances [1 / m2].
"""

import math
from typing import Final, NamedTuple


class HeightError:
    """The estimated error, and its variance."""

    def __init__(self, sigma_m: float = 0.0) -> None:
        """`sigma_m`: the standard deviation before anybody is seen; 0: heights are right."""
        self._weight = math.inf if sigma_m <= 0.0 else 1.0 / (sigma_m * sigma_m)
        self._weighted_m = 0.0

    @property
    def m(self) -> float:
        return self._weighted_m / self._weight

    @property
    def variance_m2(self) -> float:
        return 1.0 / self._weight

    def learn(self, parallax: "Parallax") -> None:
        """Take in what one person tells."""
        self._weighted_m += parallax.weighted_m
        self._weight += parallax.weight


class Parallax(NamedTuple):
    """What sightings of one person tell of the error: a sum of estimates, each times its weight, and of the weights."""

    weighted_m: float = 0.0
    weight: float = 0.0

    def seen_again(
        self, leaned: tuple[float, float], moved_m: tuple[float, float], *, variance_m2: float
    ) -> "Parallax":
        """The person is seen with another lean than before in the mean, and `moved_m` from the mean place."""
        weight = (leaned[0] ** 2 + leaned[1] ** 2) / variance_m2
        weighted_m = -(leaned[0] * moved_m[0] + leaned[1] * moved_m[1]) / variance_m2
        return Parallax(self.weighted_m + weighted_m, self.weight + weight)


NOTHING_TOLD: Final = Parallax()
