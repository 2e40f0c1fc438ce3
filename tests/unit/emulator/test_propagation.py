"""Path loss in closed form, and the links that follow: reach, obstruction, symmetry."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from emulator.channel.link_budget import heard_m, milliwatt, noise_mw, reach_m, received_dbm
from emulator.channel.path_loss import (
    ENVIRONMENTS,
    air_to_air_db,
    air_to_ground_db,
    crossover_m,
    friis_db,
    sight_probability,
    two_ray_db,
    uma_av_db,
    uma_av_sight_probability,
)
from emulator.channel.propagation import Blocked, LinkTable, pair_codes
from emulator.channel.shadowing import WAVES, Shadowing, superpose
from emulator.kernel.state import AUDIBLE, LINK_DST, LINK_POWER, LINK_SRC
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Radio, Scenario, config

MakeScenario = Callable[..., Scenario]
CHANNELS = ("log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")


def only(value: Any) -> float:
    return float(np.asarray(value).reshape(-1)[0])


def one(value: float) -> Any:
    return np.array([value])


def radio(**keys: Any) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": keys}).radio


@pytest.mark.parametrize(
    ("distance_m", "mhz", "db"), [(1, 2400, 40.05), (100, 2437, 80.18), (1000, 2437, 100.18), (1000, 5180, 106.73)]
)  # 32.45 + 20 log10(km) + 20 log10(MHz)
def test_free_space_loses_what_friis_says(distance_m: float, mhz: float, db: float) -> None:
    assert only(friis_db(one(distance_m), frequency_mhz=mhz)) == pytest.approx(db, abs=0.01)


def test_two_rays_fall_by_40_db_a_decade_beyond_the_crossover_and_are_free_space_before() -> None:
    """Antennas at 2 m and 1.5 m, 2437 MHz: crossover at 4 pi 3 / 0.12302 = 306.5 m."""
    heights = {"height_a_m": one(2.0), "height_b_m": one(1.5), "frequency_mhz": 2437.0}
    assert only(crossover_m(**heights)) == pytest.approx(306.46, abs=0.05)

    def loss(distance_m: float) -> float:
        return only(two_ray_db(one(distance_m), **heights))

    assert loss(300) == only(friis_db(one(300.0), frequency_mhz=2437.0))
    assert loss(1000) == pytest.approx(120 - 20 * math.log10(3), abs=1e-9)
    assert loss(10_000) - loss(1000) == pytest.approx(40, abs=1e-9)
    assert loss(306.46 + 0.01) - loss(306.46 - 0.01) == pytest.approx(0, abs=0.01), "the two laws meet"


@pytest.mark.parametrize(("rate_mbps", "dbm"), [(11.0, -93.58), (54.0, -93.99)])
def test_a_receiver_s_noise_is_thermal_noise_in_its_channel_and_its_own_figure(rate_mbps: float, dbm: float) -> None:
    """-174 dBm/Hz over 22 MHz (DSSS) or 20 MHz (OFDM), and 7 dB."""
    keys = radio(standard="g", rate_mbps=rate_mbps, noise_figure_db=7)
    assert 10 * math.log10(noise_mw(keys)) == pytest.approx(dbm, abs=0.01)
    assert milliwatt(-30) == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("environment", "elevation_deg", "probability"),
    [("suburban", 20, 0.99273), ("urban", 30, 0.73098), ("dense_urban", 45, 0.75577), ("highrise", 90, 0.84778)],
)  # 1 / (1 + a exp(-b (elevation - a))), by hand
def test_the_chance_of_sight_rises_with_the_elevation(
    environment: str, elevation_deg: float, probability: float
) -> None:
    found = only(sight_probability(one(elevation_deg), ENVIRONMENTS[environment]))
    assert found == pytest.approx(probability, abs=2e-5)


def test_air_to_ground_is_free_space_plus_the_mean_excess() -> None:
    """Urban, 100 m up at 30 degrees: 200 m, P = 0.73098, excess 0.73098 x 1 + 0.26902 x 20 = 6.111 dB."""
    found = only(air_to_ground_db(one(200.0), one(100.0), ENVIRONMENTS["urban"], frequency_mhz=2000.0))
    assert found == pytest.approx(84.489 + 6.111, abs=0.002)


def test_uma_av_is_the_mean_of_its_two_losses() -> None:
    """2 GHz, 100 m up, 1000 m away: P = 0.22 + e^(-1000 / 4800) 0.78 = 0.8533; LoS 100.02 dB, NLoS 116.96 dB."""
    assert only(uma_av_sight_probability(one(1000.0), one(100.0))) == pytest.approx(0.85332, abs=1e-5)
    found = only(uma_av_db(one(1000.0), one(1000.0), one(100.0), frequency_mhz=2000.0))
    assert found == pytest.approx(0.85332 * 100.0206 + 0.14668 * 116.9625, abs=0.01)
    assert only(uma_av_sight_probability(one(4000.0), one(150.0))) == 1.0


def links_of(at: list[list[float]], keys: Radio, **more: Any) -> dict[tuple[int, int], float]:
    """Mean power [dBm] of each link."""
    links = LinkTable(np.array(at, dtype=np.float64), keys, spare=0, **more)
    ends = links.ints[[LINK_SRC, LINK_DST], : links.count].T.tolist()
    return {(a, b): 10 * math.log10(mw) for (a, b), mw in zip(ends, links.reals[LINK_POWER].tolist(), strict=False)}


def test_the_gain_of_an_antenna_strengthens_its_links_both_ways_and_makes_them_longer() -> None:
    at, keys = (
        [[0, 0, 50], [0, 900, 50], [0, 2000, 5]],
        radio(channel="friis", frequency_mhz=2400, tx_power_dbm=5, interference_floor_dbm=-98),
    )
    plain, with_gain = links_of(at, keys), links_of(at, keys, gains={2: 15.0})
    assert with_gain[0, 1] == plain[0, 1]
    assert with_gain[1, 2] == with_gain[2, 1] == pytest.approx(plain[1, 2] + 15.0)
    assert (0, 2) not in plain
    free_space = 5 - 20 * math.log10(4 * math.pi * 2.4e9 / 299_792_458) - 20 * math.log10(math.hypot(2000, 45))
    assert with_gain[0, 2] == with_gain[2, 0] == pytest.approx(free_space + 15.0)


def test_with_the_channel_range_a_gain_of_twelve_decibels_means_four_times_the_reach() -> None:
    keys = radio(channel="range", range_m=250)
    found = links_of([[0, 0, 0], [995, 0, 0], [1005, 0, 0], [1100, 0, 0]], keys, gains={0: 20 * math.log10(4)})
    assert set(found) == {(0, 1), (1, 0), (1, 2), (2, 1), (1, 3), (3, 1), (2, 3), (3, 2)}


def test_two_uavs_are_air_to_air_and_a_station_on_the_ground_is_not() -> None:
    keys = radio(channel="air_to_ground", environment="urban", frequency_mhz=2000)
    found = links_of([[0, 0, 50], [0, 0, 250], [0, 0, 1]], keys)
    at_1_m = 20 * math.log10(4 * math.pi * 2e9 / 299_792_458)
    assert found[0, 1] == pytest.approx(30 - at_1_m - 20.5 * math.log10(200), abs=0.02)
    assert found[0, 2] == pytest.approx(30 - at_1_m - 20 * math.log10(49) - 1.0, abs=0.01), "overhead: seen"


@pytest.mark.parametrize(
    ("channel", "environment"),
    [
        ("two_ray", "suburban"),
        ("uma_av", "suburban"),
        *(("air_to_ground", environment) for environment in ENVIRONMENTS),
    ],
)
@pytest.mark.parametrize("distance_m", [60.0, 300.0, 2000.0])
@pytest.mark.parametrize("other_m", [0.0, 25.0, 60.0])
def test_a_uav_that_climbs_meets_no_step_of_the_loss(
    channel: str, environment: str, distance_m: float, other_m: float
) -> None:
    """No more than 1 dB per 0.1 m; before, 18 to 32 dB at 10 m. The antenna of `uma_av` is at 25 m, and from 100 m
    upwards TR 36.777 itself takes all users for seen.
    """
    if channel == "uma_av" and other_m != 25.0:
        return
    keys = radio(channel=channel, environment=environment)
    height = np.arange(1.0, 99.0 if channel == "uma_av" else 150.0, 0.1)
    here = np.column_stack([np.full_like(height, distance_m), np.zeros_like(height), height])
    there = np.tile([0.0, 0.0, other_m], (len(height), 1))
    loss = -received_dbm(np.linalg.norm(here - there, axis=1), here, there, keys)
    assert np.abs(np.diff(loss)).max() < 1.0


def test_at_street_level_and_above_the_roofs_air_to_ground_is_what_was_published() -> None:
    """ITU-R P.1410: roofs of an urban area have a Rayleigh distribution of scale 15 m; half are below 17.7 m."""
    keys = radio(channel="air_to_ground", environment="urban", frequency_mhz=2000.0)
    at = np.array([[0.0, 0, 0], [0, 0, 15 * math.sqrt(2 * math.log(2))], [0, 0, 90], [400, 0, 90]])
    ends = at[:3], np.tile(at[3], (3, 1))
    distance = np.linalg.norm(ends[0] - ends[1], axis=1)
    loss = 30 - received_dbm(distance, *ends, keys)
    street = air_to_ground_db(distance, ends[1][:, 2] - ends[0][:, 2], ENVIRONMENTS["urban"], frequency_mhz=2000.0)
    air = air_to_air_db(distance, frequency_mhz=2000.0)
    assert loss == pytest.approx([street[0], (street[1] + air[1]) / 2, air[2]], abs=1e-6)


def test_below_its_antenna_uma_av_has_the_height_of_the_uav() -> None:
    keys = radio(channel="uma_av")
    ends = np.array([[500.0, 0, 5.0]]), np.array([[0.0, 0, 25.0]])
    distance = np.linalg.norm(ends[0] - ends[1], axis=1)
    expected = uma_av_db(distance, np.array([500.0]), np.array([5.0]), frequency_mhz=2412.0)
    assert 30 - received_dbm(distance, *ends, keys) == pytest.approx(expected)


@examples(20)
@given(st.integers(0, 10_000), st.sampled_from(CHANNELS), st.sampled_from([0.0, 6.0]))
def test_every_link_is_symmetric_above_the_floor_and_none_above_it_is_missing(
    seed: int, channel: str, shadowing_db: float
) -> None:
    keys = radio(
        channel=channel, tx_power_dbm=0, sensitivity_dbm=-80, interference_floor_dbm=-85, shadowing_db=shadowing_db
    )
    random = np.random.Generator(np.random.PCG64(seed))
    side = 2 * reach_m(keys)
    at = random.uniform([0, 0, 0], [side, side, 120], (20, 3))
    shadowing = Shadowing(keys, seed=seed) if shadowing_db else None
    found = links_of(at.tolist(), keys, shadowing=shadowing)
    assert {(b, a): power for (a, b), power in found.items()} == found
    assert all(power >= -85 - 1e-6 for power in found.values())
    everyone = links_of(
        at.tolist(), radio(**{**keys.model_dump(), "interference_floor_dbm": -300}), shadowing=shadowing
    )
    strong = {pair for pair, power in everyone.items() if power >= -85 + 1e-6}
    missing = strong - set(found)
    two_sigma_more = radio(
        channel=channel, tx_power_dbm=2 * shadowing_db, sensitivity_dbm=-80, interference_floor_dbm=-85
    )
    farthest_m = reach_m(two_sigma_more) * (1 - 1e-9)
    assert all(math.dist(at[i], at[j]) >= farthest_m for i, j in missing), "beyond two sigma nobody looks"
    assert not missing or shadowing_db


def test_shadowing_follows_the_places_and_nothing_else(make_scenario: MakeScenario) -> None:
    keys = radio(channel="friis", shadowing_db=6, interference_floor_dbm=-95)
    at = [[0, 0, 50], [300, 0, 50], [0, 400, 50]]
    first = links_of(at, keys, shadowing=Shadowing(keys, seed=1))
    field = Shadowing(keys, seed=1)
    links_of([[9, 9, 9], [99, 99, 99], [999, 999, 99]], keys, shadowing=field)
    assert links_of(at, keys, shadowing=field) == first, "whatever came before"
    assert links_of(at, keys, shadowing=Shadowing(keys, seed=2)) != first


def test_the_field_of_a_link_is_the_sum_of_all_waves_from_either_end() -> None:
    angles, others = np.random.default_rng(1).uniform(0, 2 * np.pi, (2, 3, WAVES))
    total = np.zeros(3)
    pairs = np.array([[0, 1], [1, 0], [2, 1]])
    superpose(pairs, np.cos(angles), np.sin(angles), np.cos(others), np.sin(others), total)
    expected = [np.cos(angles[a] + others[b]).sum() + np.cos(angles[b] + others[a]).sum() for a, b in pairs]
    assert total == pytest.approx(expected)
    assert total[0] == total[1], "to the last bit"


@pytest.mark.parametrize("distance_m", [1.0, 20.0, 50.0, 400.0])
def test_shadowing_has_its_deviation_between_near_and_far_ends(distance_m: float) -> None:
    """Pairs that are far from each other, of several fields: the correlation is 50 m."""
    keys = radio(channel="friis", shadowing_db=6, shadowing_corr_m=50)
    places = np.arange(100)[:, None] * [9000.0, 0.0, 0.0]
    at = np.concatenate([places, places + np.array([0.0, distance_m, 0.0])])
    pairs = np.array([[n, n + 100] for n in range(100)])
    losses = [Shadowing(keys, seed=seed).loss_db(at, pairs, np.full(100, distance_m)) for seed in range(40)]
    assert np.std(losses) == pytest.approx(6.0, rel=0.04)


def test_an_obstruction_costs_its_loss_and_cuts_a_link_of_the_range_channel() -> None:
    at = [[0, 0, 50], [100, 0, 50], [0, 100, 50]]
    blocked = Blocked(pair_codes(np.array([[1, 0]]), 3), np.zeros(0))
    keys = radio(channel="friis", obstruction_loss_db=25)
    clear, behind = links_of(at, keys), links_of(at, keys, blocked=blocked)
    assert {pair: clear[pair] - behind[pair] for pair in clear} == pytest.approx(
        {(0, 1): 25, (1, 0): 25, (0, 2): 0, (2, 0): 0, (1, 2): 0, (2, 1): 0}
    )
    assert set(links_of(at, radio(), blocked=blocked)) == {(0, 2), (2, 0), (1, 2), (2, 1)}


def test_beyond_the_sensitivity_a_link_only_interferes() -> None:
    keys = radio(channel="friis", sensitivity_dbm=-60, interference_floor_dbm=-90)
    links = LinkTable(np.array([[0.0, 0, 50], [500, 0, 50]]), keys, spare=0)
    assert links.count == 2
    assert not links.ints[AUDIBLE].any()
    assert heard_m(keys) < 500 < heard_m(radio(channel="friis", sensitivity_dbm=-75))
    assert heard_m(radio()) == 250


def test_defaults_follow_the_channel_and_the_standard() -> None:
    assert radio(channel="log_distance", standard="a").reference_loss_db == 46.73
    assert radio(channel="log_distance").reference_loss_db == 40.05
    assert radio(channel="log_distance", frequency_mhz=5180.0).reference_loss_db == 46.73
    with pytest.raises(ConfigError, match=r"airborne_m = 25 must be > 25"):
        radio(channel="uma_av", airborne_m=25.0)
    assert radio(channel="friis", standard="a").frequency_mhz == 5180
    with pytest.raises(ConfigError, match="shadowing_db needs a channel with powers"):
        radio(shadowing_db=4)
