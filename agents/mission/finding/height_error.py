"""How much higher one UAV is than it takes itself to be, by people whom it has seen from several places.

    seen_i = place - error * lean_i + noise_i        lean_i = (place - position_i) / height_i, along the ground

GPS is wrong by metres in height, for minutes. Whoever is seen from two sides tells the error: by least squares over all
people who are certainly there, from a prior by what is known of the receiver. Weights are inverse variances [1 / m2].
"""

import math
from typing import Final, NamedTuple

from fanet_mw.units import S


class HeightError:
    """The estimated error now, and its variance."""

    def __init__(self, sigma_m: float = 0.0, *, tau_s: float = math.inf) -> None:
        """`sigma_m`: the standard deviation before anybody is seen, 0: heights are right; `tau_s`: the time over which
        the error's correlation falls to 1 / e (a Gauss-Markov process).
        """
        self._prior_m2, self._tau_s = sigma_m * sigma_m, tau_s
        self.m, self.variance_m2 = 0.0, self._prior_m2
        self._at_ns = 0

    def advance(self, now_ns: int) -> None:
        """Time passes, and the error changes."""
        left = math.exp(-max(0, now_ns - self._at_ns) / S / self._tau_s)
        self._at_ns = max(self._at_ns, now_ns)
        self.m *= left
        self.variance_m2 = self._prior_m2 + left * left * (self.variance_m2 - self._prior_m2)

    def learn(self, parallax: "Parallax") -> None:
        """Take in what one person tells."""
        share = 1.0 / (1.0 + self.variance_m2 * parallax.weight)
        self.m = share * (self.m + self.variance_m2 * parallax.weighted_m)
        self.variance_m2 *= share


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
