"""Shadowing and fading against their laws: standard deviation, autocorrelation, distribution."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from emulator.channel import fading
from emulator.channel.shadowing import Shadowing
from emulator.kernel import state
from fanet_mw.rng import stream_seed
from fanet_mw.scenario import Radio, config

FAR_M = 5000.0
SEEDS = range(40)
FEW = range(24)


def radio(**keys: Any) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": {"channel": "friis", **keys}}).radio


@cache
def along_a_way(seed: int, *, step_m: float, count: int, both: bool = False) -> Any:
    """Shadowing [dB] of one link while one end, or both, fly straight."""
    keys = radio(shadowing_db=6, shadowing_corr_m=50)
    at = np.zeros((2 * count, 3))
    at[:count, 0] = step_m * np.arange(count)
    at[count:, 1] = FAR_M
    if both:
        at[count:, 0] = at[:count, 0]
    found = np.column_stack([np.arange(count), np.arange(count, 2 * count)])
    return Shadowing(keys, seed=seed).loss_db(at, found, np.linalg.norm(at[:count] - at[count:], axis=1))


def test_shadowing_has_its_standard_deviation_and_no_mean() -> None:
    drawn = np.concatenate([along_a_way(seed, step_m=200, count=200) for seed in SEEDS])
    assert drawn.mean() == pytest.approx(0.0, abs=0.4)
    assert drawn.std() == pytest.approx(6.0, rel=0.05)
    beyond = (np.abs(drawn) > 12).mean()
    assert beyond == pytest.approx(0.0455, abs=0.012), "as normal: 4.6 % beyond two sigma"


@pytest.mark.parametrize("lag_m", [10, 25, 50, 100, 200])
def test_its_correlation_falls_exponentially_as_one_end_moves(lag_m: int) -> None:
    lag = lag_m // 5
    products = [
        float(np.mean(s[:-lag] * s[lag:]) / 36) for s in (along_a_way(seed, step_m=5, count=1000) for seed in FEW)
    ]
    assert np.mean(products) == pytest.approx(math.exp(-lag_m / 50), abs=0.06)


def test_it_falls_twice_as_fast_when_both_ends_move() -> None:
    products = [
        float(np.mean(s[:-5] * s[5:]) / 36)
        for s in (along_a_way(seed, step_m=5, count=1000, both=True) for seed in FEW)
    ]
    assert np.mean(products) == pytest.approx(math.exp(-2 * 25 / 50), abs=0.06)


def test_close_ends_have_the_same_standard_deviation() -> None:
    keys = radio(shadowing_db=6, shadowing_corr_m=50)
    random = np.random.Generator(np.random.PCG64(1))
    drawn = []
    for seed in SEEDS:
        at = random.uniform(-5000, 5000, (400, 3))
        at[200:] = at[:200] + np.array([10, 0, 0])
        found = np.column_stack([np.arange(200), np.arange(200, 400)])
        drawn.append(Shadowing(keys, seed=seed).loss_db(at, found, np.full(200, 10.0)))
    assert np.concatenate(drawn).std() == pytest.approx(6.0, rel=0.05)


DRAWS = 20_000


def gains(**keys: Any) -> Any:
    """Power gains of one transmitter, as the kernel draws them."""
    law, shape = fading.law_of(radio(**keys))
    p, pf = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS)
    p[state.FADING], pf[state.FADING_SHAPE] = law, shape
    rows = np.zeros((state.STATION_ROWS, 1), np.int64)
    rows[[state.FADE_A, state.FADE_B], 0] = fading.seeds(stream_seed(3, "fading", 1))
    return np.array([fading.gain(p, pf, rows, 0) for _ in range(DRAWS)])


def gamma_share(shape: int, x: Any) -> Any:
    """P(gamma of integer shape and scale 1 <= x)."""
    return 1 - np.exp(-x) * sum(x**k / math.factorial(k) for k in range(shape))


def kolmogorov_smirnov(drawn: Any, share: Any) -> float:
    """Greatest distance between the drawn distribution and the law, which is `share` at each of `drawn`, ascending."""
    steps = np.arange(len(drawn) + 1) / len(drawn)
    return float(max((steps[1:] - share).max(), (share - steps[:-1]).max()))


ONE_PERCENT: float = 1.628 / math.sqrt(DRAWS)
"""Kolmogorov-Smirnov distance that a right law exceeds in one of a hundred samples."""


@pytest.mark.parametrize("m", [0.5, 1, 3, 8])
def test_nakagami_power_is_gamma_distributed_with_mean_one(m: float) -> None:
    drawn = np.sort(gains(fading="nakagami", nakagami_m=m))
    assert drawn.mean() == pytest.approx(1.0, abs=4 / math.sqrt(m * DRAWS))
    assert drawn.var() == pytest.approx(1 / m, rel=0.08)
    normal_squared = np.array([math.erf(math.sqrt(x / 2)) for x in drawn])
    share = normal_squared if m == 0.5 else gamma_share(int(m), m * drawn)
    assert kolmogorov_smirnov(drawn, share) < ONE_PERCENT


@pytest.mark.parametrize("k_db", [-20, 3, 10, 15])
def test_rician_power_is_noncentral_chi_square_distributed_with_mean_one(k_db: float) -> None:
    """As a Poisson mixture of gamma distributions: sum over j of P(j; K) P(gamma(j + 1) <= (K + 1) x)."""
    k = math.pow(10, k_db / 10)
    drawn = np.sort(gains(fading="rician", rician_k_db=k_db))
    assert drawn.mean() == pytest.approx(1.0, abs=4 * math.sqrt((1 + 2 * k) / (1 + k) ** 2 / DRAWS))
    assert drawn.var() == pytest.approx((1 + 2 * k) / (1 + k) ** 2, rel=0.05)
    x = (k + 1) * drawn
    term, below, share = np.exp(-x), np.exp(-x), np.zeros(DRAWS)
    weight = math.exp(-k)
    for j in range(160):
        share += weight * (1 - below)
        term = term * x / (j + 1)
        below = below + term
        weight *= k / (j + 1)
    assert kolmogorov_smirnov(drawn, share) < ONE_PERCENT
