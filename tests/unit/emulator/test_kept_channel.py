"""What a seed's medium makes of places is the same in every release: powers, errors and fading are kept."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from kept_values import kept

from emulator.channel.error_rate import header_rates, log_success_per_bit
from emulator.channel.fading import Waves, lift, tables
from emulator.channel.link_budget import (
    audible_mw,
    carrier_sense_mw,
    energy_mw,
    heard_m,
    noise_mw,
    reach_m,
    reach_with_gain_m,
    received_dbm,
    sensitivities_mw,
)
from emulator.channel.path_loss import ENVIRONMENTS
from emulator.channel.propagation import Blocked, LinkTable
from emulator.channel.shadowing import Shadowing
from fanet_mw.airtime import OFDM_RATES_MBPS
from fanet_mw.scenario import Radio, config

CHANNELS = ("range", "log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")
FADINGS: tuple[dict[str, Any], ...] = (
    {"fading": "none"},
    {"fading": "rician", "rician_k_db": 6},
    {"fading": "nakagami", "nakagami_m": 0.7},
    {"fading": "nakagami", "nakagami_m": 3},
)
DRAWN = np.random.default_rng(5)
AT = DRAWN.uniform([-400, -400, 1], [400, 400, 120], (24, 3))
VELOCITY = DRAWN.uniform(-15, 15, (24, 3))


def radio(**keys: Any) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": keys}).radio


@pytest.mark.parametrize("channel", CHANNELS)
def test_powers_of_links_are_what_they_were_before(channel: str) -> None:
    def values() -> Iterator[Any]:
        shadowed = () if channel == "range" else ({"shadowing_db": 5},)
        for keys in ({}, {"frequency_mhz": 5500}, {"standard": "g", "rate_mbps": 24}, *shadowed):
            for environment in ENVIRONMENTS if channel == "air_to_ground" else ("urban",):
                made = radio(channel=channel, environment=environment, **keys)
                yield reach_m(made), reach_with_gain_m(made, 6.0), heard_m(made), noise_mw(made), sensitivities_mw(made)
                yield carrier_sense_mw(made), energy_mw(made), audible_mw(made)
                far = np.geomspace(0.5, 5000, 40)
                low, high = (np.stack([far * share, far * 0, 2 + far / 60], axis=1) for share in (0.0, 1.0))
                yield received_dbm(far, low, high, made)
                blocked = Blocked(np.array([1, 5, 60, 311]), np.array([3.0, 20, 0.5, 200]))
                shadowing = Shadowing(made, seed=4) if made.shadowing_db else None
                links = LinkTable(AT, made, spare=3, ground_m=1.0, shadowing=shadowing, blocked=blocked, gains={2: 5.0})
                yield links.ints, np.log10(np.maximum(1e-30, links.reals)), links.ptr, links.longest_ns

    kept(f"powers, {channel}", values())


@pytest.mark.parametrize("keys", FADINGS, ids=lambda keys: "_".join(map(str, keys.values())))
def test_fading_is_what_it_was_before(keys: dict[str, Any]) -> None:
    made = radio(channel="friis", scatterer_speed_m_s=3, **keys)
    kept(f"fading, {keys}", [lift(made), tables(made)[:, ::16], Waves(made, seed=4).of(AT, VELOCITY, 7_000_000_123)])


@pytest.mark.parametrize("errors", ["nist", "tables"])
@pytest.mark.parametrize("short", [False, True])
def test_error_rates_are_what_they_were_before(errors: str, *, short: bool) -> None:
    rates = (1.0, 2.0, *((5.5, 11.0) if errors == "nist" and not short else ()), *OFDM_RATES_MBPS)
    found = [(header_rates(rate), log_success_per_bit(rate, errors, short=short)[::5]) for rate in rates]
    kept(f"errors, {errors}{', short' * short}", found)
