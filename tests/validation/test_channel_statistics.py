"""Shadowing and fading against their laws: standard deviation, autocorrelation, distribution."""

import math
from typing import Any

import numpy as np
import pytest

from emulator.shadowing import Shadowing
from fanet_mw import config
from fanet_mw.scenario import Radio

FAR_M = 5000.0
SEEDS = range(40)


def radio(**keys: Any) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": {"channel": "friis", **keys}}).radio


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
        float(np.mean(s[:-lag] * s[lag:]) / 36) for s in (along_a_way(seed, step_m=5, count=1000) for seed in SEEDS)
    ]
    assert np.mean(products) == pytest.approx(math.exp(-lag_m / 50), abs=0.06)


def test_it_falls_twice_as_fast_when_both_ends_move() -> None:
    products = [
        float(np.mean(s[:-5] * s[5:]) / 36)
        for s in (along_a_way(seed, step_m=5, count=1000, both=True) for seed in SEEDS)
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
