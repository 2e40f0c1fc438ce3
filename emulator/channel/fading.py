"""Small-scale fading: a power gain of mean 1 that follows from where two stations are and how they move.

    h(t)     = sum over N waves of exp(j 2 pi (k_n . x_lo(t) + l_n . x_hi(t) + f_n t + phase_n)) / sqrt(N)
    nakagami   |h|^2 mapped to a gamma distribution of shape m and mean 1          m = 1 is Rayleigh
    rician     |sqrt(K / (K + 1)) exp(j 2 pi d(t) / lambda) + h / sqrt(K + 1)|^2     K: direct over scattered power

Correlations and sources: docs/explanation/channel.md. The lower station number comes first, so that both directions
fade alike; between poses x(t) goes on with the pose's velocity. The sum of N waves is mapped by its own distribution
(J. C. Kluyver's random walk). Not modeled: frequency selectivity, change within a frame, directions that depend on the
place.
"""

import math
from functools import cache
from typing import Final

import numpy as np

from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from emulator.kernel.state import NAKAGAMI, NONE, RICIAN, ROOT, TABLE, WAVES, Reals
from fanet_mw.rng import stream_seed
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import S

_TWO_PI: Final = 2.0 * math.pi
RARE: Final = 0.001
"""The share of frames on a link of which fading may lift none, for the link to carry no copies."""


def law_of(radio: Radio) -> tuple[int, float]:
    """What the kernel needs of the fading: the number of the law, and its parameter (m, or K as a ratio)."""
    if radio.fading == "nakagami":
        return NAKAGAMI, radio.nakagami_m
    if radio.fading == "rician":
        return RICIAN, math.pow(10.0, radio.rician_k_db / 10)
    return NONE, 0.0


def lift(radio: Radio) -> float:
    """The gain that one frame in a thousand exceeds; 1 without fading."""
    return _lift(*law_of(radio))


@cache
def _lift(law: int, shape: float) -> float:
    if law == NAKAGAMI:
        return float(gamma_quantile(np.array([-math.log(RARE)]), shape)[0])
    if law == RICIAN:
        rayleigh = np.sqrt(-np.log((np.arange(2000) + 0.5) / 2000) / (shape + 1))
        angle = math.pi * (np.arange(180) + 0.5) / 180
        x = math.sqrt(shape / (shape + 1)) + np.outer(rayleigh, np.cos(angle))
        return float(np.quantile(x * x + np.outer(rayleigh, np.sin(angle)) ** 2, 1 - RARE))
    return 1.0


def gamma_quantile(exponent: Reals, shape: float) -> Reals:
    """Where a gamma variate of mean 1 is exceeded with probability exp(-`exponent`)."""
    log_gain = np.linspace(-45.0 / min(1.0, shape), math.log(60.0 / min(1.0, shape)), 60_000)
    step = log_gain[1] - log_gain[0]
    density = np.exp(
        shape * math.log(shape) - math.lgamma(shape) + shape * log_gain - shape * np.exp(log_gain)
    )  # of log_gain
    below = np.cumsum(density) * step - density * step / 2
    above = np.cumsum(density[::-1])[::-1] * step - density * step / 2
    lower = np.log(np.maximum(below, 1e-300)), log_gain
    upper = -np.log(np.maximum(above, 1e-300)), log_gain
    share = -np.expm1(-exponent)
    small, large = np.interp(np.log(np.maximum(share, 1e-300)), *lower), np.interp(exponent, *upper)
    return np.asarray(np.exp(np.where(share < 0.5, small, large)), dtype=np.float64)


def random_walk_exponent(amplitude: Reals) -> Reals:
    """-ln P(the mean of N unit phasors, times sqrt N, is longer than this): the square of the amplitude, nearly."""
    t, weight = np.polynomial.legendre.leggauss(240)
    t, weight = 2.25 * (t + 1), 2.25 * weight  # beyond 4.5 less than 1e-12 is left of J0^32
    sine = np.sin(_TWO_PI / 4 * (np.arange(96) + 0.5) / 96)  # Bessel's integrals over a quarter turn
    spectrum = weight * np.cos(np.outer(t, sine)).mean(axis=1) ** WAVES
    length = ROOT * amplitude
    j1 = [(np.sin(r * np.outer(t, sine)) * sine).mean(axis=1) for r in length]
    return np.asarray(-np.log1p(-np.clip(length * (np.array(j1) @ spectrum), 0.0, 1 - 1e-12)), dtype=np.float64)


def tables(radio: Radio) -> Reals:
    """The table of the kernel, for the law of the scenario; zeros without fading."""
    return _tables(*law_of(radio)).copy()


@cache
def _tables(law: int, shape: float) -> Reals:
    if law == NONE:
        return np.zeros((2, 1))
    coarse = np.linspace(0.02, ROOT, 400)
    amplitude = np.linspace(0.0, ROOT, TABLE)
    ratio = np.interp(amplitude, coarse, random_walk_exponent(coarse) / coarse**2)
    exponent = amplitude**2 * ratio
    shaped = np.sqrt(ratio) if law == RICIAN else gamma_quantile(exponent, shape)
    return np.stack([np.cos(_TWO_PI * np.arange(TABLE) / TABLE), shaped])


class Waves:
    """The directions of the waves, drawn from the scenario's seed, and the phases of each station in them."""

    def __init__(self, radio: Radio, *, seed: int) -> None:
        random = np.random.Generator(np.random.PCG64(stream_seed(seed, "fading")))
        self._wavelength_m = SPEED_OF_LIGHT_M_S / (radio.frequency_mhz * 1e6)

        def spread() -> Reals:
            """Cosines and sines of angles, one in each N-th of a turn, in random order."""
            angle = _TWO_PI * (random.permutation(WAVES) + random.random(WAVES)) / WAVES
            return np.stack([np.cos(angle), np.sin(angle)])

        self._k, self._l = (np.concatenate([spread(), spread()[:1]]) / self._wavelength_m for _ in "kl")
        self._phase = random.random(WAVES)
        self._turns_per_s = spread()[0] * radio.scatterer_speed_m_s / self._wavelength_m

    def of(self, at: Reals, velocity: Reals, t_ns: int) -> Reals:
        """A row for each station at `at` [m] with `velocity` [m/s] at this instant; zeros if its place is unknown."""
        known = np.isfinite(at).all(axis=1, keepdims=True)
        at = np.where(known, at, 0.0)
        velocity = np.where(known & np.isfinite(velocity), velocity, 0.0)
        drift = self._phase + self._turns_per_s * (t_ns / S)
        return np.concatenate(
            [
                (at @ self._k + drift) % 1.0,
                (velocity @ self._k + self._turns_per_s) / S,
                (at @ self._l) % 1.0,
                velocity @ self._l / S,
                at / self._wavelength_m,
                velocity / self._wavelength_m / S,
            ],
            axis=1,
        )
