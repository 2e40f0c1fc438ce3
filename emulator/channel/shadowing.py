"""Log-normal shadowing as a property of places: the loss of a link follows from the positions of its two ends.

A Gaussian field over both ends of plane waves, S(a, b) = sqrt(2 / N) sum cos(k a + l b + phase), symmetrized, with
waves of an exponential correlation (the 3-dimensional Cauchy distribution) for each end: exp(-d / d_corr) when one end
moves by d (M. Gudmundson, Electronics Letters 27(23), 1991), the product of both when both move (Z. Wang, E. Tameh, A.
Nix, IEEE Trans. Veh. Technol. 57(2), 2008). The same poses give the same shadowing, whichever preceded them. Not
modeled: dependence on surroundings, angle or height. Within one seed the correlation differs from the law by about 1 /
sqrt(2 N).
"""

import math

import numpy as np

from emulator.kernel.jit import jit
from emulator.kernel.state import Ints, Reals
from fanet_mw.rng import stream_seed
from fanet_mw.scenario.tables.radio import Radio

WAVES = 128  # a multiple of 4: see `one_way`


@jit
def one_way(cos_k: Reals, sin_k: Reals, cos_l: Reals, sin_l: Reals) -> float:
    """Sum of cos(k + l) over the waves, in four partial sums that the processor can add at the same time."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for n in range(0, WAVES, 4):
        s0 += cos_k[n] * cos_l[n] - sin_k[n] * sin_l[n]
        s1 += cos_k[n + 1] * cos_l[n + 1] - sin_k[n + 1] * sin_l[n + 1]
        s2 += cos_k[n + 2] * cos_l[n + 2] - sin_k[n + 2] * sin_l[n + 2]
        s3 += cos_k[n + 3] * cos_l[n + 3] - sin_k[n + 3] * sin_l[n + 3]
    return (s0 + s1) + (s2 + s3)


@jit
def superpose(found: Ints, cos_k: Reals, sin_k: Reals, cos_l: Reals, sin_l: Reals, total: Reals) -> None:
    """Sum of the waves for each pair, added both ways round so that (a, b) and (b, a) agree to the last bit."""
    for link in range(found.shape[0]):
        a, b = found[link, 0], found[link, 1]
        total[link] = one_way(cos_k[a], sin_k[a], cos_l[b], sin_l[b]) + one_way(cos_k[b], sin_k[b], cos_l[a], sin_l[a])


class Shadowing:
    """One field, drawn from the scenario's seed."""

    def __init__(self, radio: Radio, *, seed: int) -> None:
        random = np.random.Generator(np.random.PCG64(stream_seed(seed, "shadowing")))
        self._sigma_db = radio.shadowing_db
        self._correlation_m = radio.shadowing_corr_m
        self._k = self._wave_vectors(random)
        self._l = self._wave_vectors(random)
        self._phase = random.uniform(0.0, 2 * math.pi, WAVES)

    def _wave_vectors(self, random: np.random.Generator) -> Reals:
        """Wave vectors [3, WAVES] in 1/m, multivariate Cauchy: a normal vector over an independent normal number."""
        return np.asarray(
            random.normal(size=(3, WAVES)) / np.abs(random.normal(size=WAVES)) / self._correlation_m, dtype=np.float64
        )

    def loss_db(self, at: Reals, found: Ints, distance: Reals) -> Reals:
        """Loss [dB], zero mean, of ordered pairs [n, 2] at `at`, `distance` [m] apart: the field from one end plus from
        the other, scaled to keep its variance where both are nearly equal.
        """
        if not len(found):
            return np.zeros(0)
        here = np.where(np.isfinite(at), at, 0.0)
        first, second = here @ self._k + self._phase, here @ self._l
        total = np.zeros(len(found))
        superpose(found, np.cos(first), np.sin(first), np.cos(second), np.sin(second), total)
        alike = np.exp(-2 * distance / self._correlation_m)
        return np.asarray(self._sigma_db * total / np.sqrt(WAVES * (1 + alike)), dtype=np.float64)
