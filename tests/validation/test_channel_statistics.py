"""Shadowing and fading against their laws: standard deviation, autocorrelation, distribution."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from kit import slow

from emulator.channel import fading
from emulator.channel.shadowing import Shadowing
from emulator.kernel import state
from emulator.kernel.fading_gain import gain
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
WAVELENGTH_M = 299_792_458 / 2.412e9


def bessel_j0(x: Any) -> Any:
    turn = 2 * np.pi * (np.arange(400) + 0.5) / 400
    return np.cos(np.multiply.outer(np.asarray(x, dtype=float), np.cos(turn))).mean(axis=-1)


def gains_at(at: Any, velocity: Any, instants_ns: Any, pairs: Any, *, seed: int = 3, **keys: Any) -> Any:
    """Power gains [instant, pair] of stations at `at` [n, 3] [m], as the kernel has them."""
    radio_keys = radio(**keys)
    law, shape = fading.law_of(radio_keys)
    p, pf = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS)
    p[state.FADING], pf[state.FADING_SHAPE] = law, shape
    g = np.zeros(state.GLOBALS, np.int64)
    waves = fading.Waves(radio_keys, seed=seed).of(np.asarray(at, float), np.asarray(velocity, float), 0)
    table = fading.tables(radio_keys)
    return np.array([[gain(g, p, pf, waves, table, a, b, t) for a, b in pairs] for t in instants_ns])


def gains(**keys: Any) -> Any:
    """Power gains of pairs of stations at rest all over an area."""
    random = np.random.Generator(np.random.PCG64(1))
    at = random.uniform(0, 5000, (DRAWS // 100, 3))
    pairs = [(a, (a + lag) % len(at)) for a in range(len(at)) for lag in range(1, 101)]
    return gains_at(at, np.zeros_like(at), [0], pairs, **keys)[0]


RAYLEIGH = {"fading": "nakagami", "nakagami_m": 1}
LAGS_M = np.array([0.0, 0.1, 0.2, 0.3, 0.383, 0.6, 1.0, 1.6]) * WAVELENGTH_M


def power_correlation(speed: Any, **keys: Any) -> Any:
    """The correlation of the gain with that of the first instant, over LAGS_M of way at 1 m/s in all, of many seeds."""
    random = np.random.Generator(np.random.PCG64(2))
    found = []
    for seed in range(60):
        at = random.uniform(0, 5000, (40, 3))
        velocity = np.zeros_like(at)
        velocity[::2], velocity[1::2] = speed
        pairs = [(i, i + 1) for i in range(0, 40, 2)]
        found.append(gains_at(at, velocity, np.rint(LAGS_M * 1e9).astype(int).tolist(), pairs, seed=seed, **keys))
    drawn = np.concatenate(found, axis=1) - 1
    return (drawn * drawn[0]).mean(axis=1) / (drawn[0] ** 2).mean()


@pytest.mark.parametrize("way", [(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0)])
def test_while_one_end_moves_the_power_of_rayleigh_fading_has_the_correlation_of_clarke(way: Any) -> None:
    """The square of J0(2 pi v t / lambda) (R. H. Clarke, 1968; W. C. Jakes, 1974, 1.3-9): the first zero at 0.383."""
    expected = bessel_j0(2 * np.pi * LAGS_M / WAVELENGTH_M) ** 2
    assert expected[4] == pytest.approx(0, abs=1e-4)
    assert power_correlation((way, (0, 0, 0)), **RAYLEIGH) == pytest.approx(expected, abs=0.08)


def test_while_both_ends_move_it_is_the_product_of_both() -> None:
    """A. S. Akki, F. Haber, 1986: also in a formation that keeps its distances."""
    one = bessel_j0(2 * np.pi * LAGS_M / WAVELENGTH_M)
    found = power_correlation(((1.0, 0, 0), (1.0, 0, 0)), **RAYLEIGH)
    assert found == pytest.approx(one**4, abs=0.08)


def test_at_rest_a_link_keeps_its_gain_and_scatterers_that_move_change_it() -> None:
    still = power_correlation(((0, 0, 0), (0, 0, 0)), **RAYLEIGH)
    assert still == pytest.approx(1.0, abs=1e-9)
    moved = power_correlation(((0, 0, 0), (0, 0, 0)), scatterer_speed_m_s=1, **RAYLEIGH)
    assert moved == pytest.approx(bessel_j0(2 * np.pi * LAGS_M / WAVELENGTH_M) ** 2, abs=0.08)


def test_both_directions_of_a_link_fade_alike() -> None:
    random = np.random.Generator(np.random.PCG64(4))
    at, velocity = random.uniform(0, 900, (9, 3)), random.uniform(-20, 20, (9, 3))
    there = [(a, b) for a in range(9) for b in range(a)]
    for keys in (RAYLEIGH, {"fading": "rician", "rician_k_db": 6}):
        found = gains_at(at, velocity, [0, 10**7], there, **keys)
        assert (found == gains_at(at, velocity, [0, 10**7], [(b, a) for a, b in there], **keys)).all()
        assert len(np.unique(found)) == found.size


def test_a_pose_that_continues_the_last_one_continues_the_fading() -> None:
    """Station 1 flies at 15 m/s; the gain after 3 ms is the same from the pose before and from one at that instant."""
    at, velocity = np.array([[0.0, 0, 50], [300, 0, 50]]), np.array([[15.0, 3, 1], [0, 0, 0]])
    keys = radio(scatterer_speed_m_s=2, **RAYLEIGH)
    p, pf, g = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS), np.zeros(state.GLOBALS, np.int64)
    p[state.FADING], pf[state.FADING_SHAPE] = fading.law_of(keys)
    waves, table, t_ns = fading.Waves(keys, seed=1), fading.tables(keys), 3_000_000
    before = gain(g, p, pf, waves.of(at, velocity, 0), table, 0, 1, t_ns)
    g[state.WAVES_FROM_NS] = t_ns
    after = gain(g, p, pf, waves.of(at + velocity * t_ns / 1e9, velocity, t_ns), table, 0, 1, t_ns)
    assert after == pytest.approx(before, rel=0.02)


def gamma_share(shape: int, x: Any) -> Any:
    """P(gamma of integer shape and scale 1 <= x)."""
    return 1 - np.exp(-x) * sum(x**k / math.factorial(k) for k in range(shape))


def kolmogorov_smirnov(drawn: Any, share: Any) -> float:
    """Greatest distance between the drawn distribution and the law, which is `share` at each of `drawn`, ascending."""
    steps = np.arange(len(drawn) + 1) / len(drawn)
    return float(max((steps[1:] - share).max(), (share - steps[:-1]).max()))


ONE_PERCENT: float = 1.628 / math.sqrt(DRAWS)
"""Kolmogorov-Smirnov distance that a right law exceeds in one of a hundred samples."""


@pytest.mark.parametrize("m", [0.5, 3, *slow(1, 8)])
def test_nakagami_power_is_gamma_distributed_with_mean_one(m: float) -> None:
    drawn = np.sort(gains(fading="nakagami", nakagami_m=m))
    assert drawn.mean() == pytest.approx(1.0, abs=4 / math.sqrt(m * DRAWS))
    assert drawn.var() == pytest.approx(1 / m, rel=0.08)
    normal_squared = np.array([math.erf(math.sqrt(x / 2)) for x in drawn])
    share = normal_squared if m == 0.5 else gamma_share(int(m), m * drawn)
    assert kolmogorov_smirnov(drawn, share) < ONE_PERCENT


@pytest.mark.parametrize("k_db", [3, 15, *slow(-20, 10)])
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
