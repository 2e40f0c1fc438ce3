"""Small-scale fading: one power gain per frame and receiver, of mean 1, drawn when the frame starts.

    nakagami   gamma distributed with shape m and mean 1                           m = 1 is Rayleigh
    rician     |sqrt(K / (K + 1)) + complex normal of variance 1 / (K + 1)|^2      K: direct over scattered power

Each transmitter has a generator of its own (named stream `fading`) and draws from it in the order of its links, so that
the same frames at the same instants meet the same gains. The gain of a frame is constant over its band and its length,
and independent of the gain of the next frame. Not modeled: coherence time, Doppler, frequency selectivity, and that
both directions of a link fade alike.
"""

import math
from typing import Final

from emulator.kernel.jit import jit
from emulator.kernel.state import FADE_A, FADE_B, FADING, FADING_SHAPE, Ints, Reals
from fanet_mw.scenario.tables.radio import Radio

NONE: Final = 0
NAKAGAMI: Final = 1
RICIAN: Final = 2
_MODULUS_A = 2_147_483_563
_MODULUS_B = 2_147_483_399
_TWO_PI = 2.0 * math.pi


def law_of(radio: Radio) -> tuple[int, float]:
    """What the kernel needs of the fading: the number of the law, and its parameter (m, or K as a ratio)."""
    if radio.fading == "nakagami":
        return NAKAGAMI, radio.nakagami_m
    if radio.fading == "rician":
        return RICIAN, math.pow(10.0, radio.rician_k_db / 10)
    return NONE, 0.0


def seeds(seed: int) -> tuple[int, int]:
    """The two initial states of a generator, made of 63 random bits."""
    return seed % (_MODULUS_A - 1) + 1, (seed >> 31) % (_MODULUS_B - 1) + 1


@jit
def uniform(st: Ints, s: int) -> float:
    """The next value in (0, 1) of a station's fading generator (P. L'Ecuyer, CACM 31(6), 1988, figure 3)."""
    a = st[FADE_A, s] * 40014 % _MODULUS_A
    b = st[FADE_B, s] * 40692 % _MODULUS_B
    st[FADE_A, s] = a
    st[FADE_B, s] = b
    z = a - b
    if z < 1:
        z += _MODULUS_A - 1
    return float(z / _MODULUS_A)


@jit
def gamma(st: Ints, s: int, shape: float) -> float:
    """A gamma variate of scale 1 (G. Marsaglia, W. W. Tsang, ACM Trans. Math. Softw. 26(3), 2000)."""
    boost = 1.0
    if shape < 1.0:
        boost = math.pow(uniform(st, s), 1.0 / shape)
        shape += 1.0
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x = math.sqrt(-2.0 * math.log(uniform(st, s))) * math.cos(_TWO_PI * uniform(st, s))
        v = 1.0 + c * x
        if v <= 0.0:
            continue
        v = v * v * v
        if math.log(uniform(st, s)) < 0.5 * x * x + d - d * v + d * math.log(v):
            return float(boost * d * v)


@jit
def gain(p: Ints, pf: Reals, st: Ints, s: int) -> float:
    """The power gain of one frame of station `s` at one receiver."""
    shape = pf[FADING_SHAPE]
    if p[FADING] == NAKAGAMI:
        return float(gamma(st, s, shape) / shape)
    scatter = math.sqrt(-math.log(uniform(st, s)) / (shape + 1.0))  # Rayleigh amplitude
    phase = _TWO_PI * uniform(st, s)
    x = math.sqrt(shape / (shape + 1.0)) + scatter * math.cos(phase)
    y = scatter * math.sin(phase)
    return float(x * x + y * y)
