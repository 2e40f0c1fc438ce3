"""Fading in the air: mean power kept, the same run for the same seed, copies counted, books closed."""

import math
from array import array
from collections.abc import Callable

import numpy as np
import pytest
from hand_driven import NAMES, Air, receptions, statuses
from hypothesis import given
from hypothesis import strategies as st
from kit import examples
from test_emulator_kernel import Output, medium, run

from emulator.channel.fading import Waves, law_of, lift, random_walk_exponent, tables
from emulator.kernel.fading_gain import gain
from emulator.kernel.state import FADING, FADING_SHAPE, RICIAN, WAVES
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.radio_control import Cut, Degrade, Jam
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId

MakeScenario = Callable[..., Scenario]
LAWS = {
    "rayleigh": {"radio.fading": "nakagami", "radio.nakagami_m": 1},
    "nakagami": {"radio.fading": "nakagami", "radio.nakagami_m": 3},
    "half": {"radio.fading": "nakagami", "radio.nakagami_m": 0.5},
    "rician": {"radio.fading": "rician", "radio.rician_k_db": 6},
}
FRAMES = 3000
STIRRED = {"radio.scatterer_speed_m_s": 900.0}
"""Scatterers so fast that each frame meets another gain."""


def powers_dbm(scenario: Scenario, *, distance_m: float) -> list[float]:
    """RSSI of what node 2 received of FRAMES small frames."""
    air = Air(scenario, [0, distance_m])
    for i in range(FRAMES):
        air.send(1, (1 + i) * MS, now_ns=i * MS, payload=bytes(64))
        air.medium.wake((1 + i) * MS)
    heard = air.run(10_000 * MS)
    return [h.message.rssi_dbm for h in heard if isinstance(h.message, Reception)]


@pytest.mark.parametrize("law", LAWS)
def test_the_mean_power_of_a_strong_link_is_that_without_fading(make_scenario: MakeScenario, law: str) -> None:
    """10 m in free space: -30 dBm, 60 dB above the sensitivity, so that hardly a fade is missed."""
    base = {"nodes.count": 2, "radio.channel": "friis", **STIRRED}
    still = powers_dbm(make_scenario(**base), distance_m=10)
    assert len(still) == FRAMES
    assert min(still) == max(still)
    faded = powers_dbm(make_scenario(**base, **LAWS[law]), distance_m=10)
    assert len(faded) > 0.99 * FRAMES
    mean_mw = np.mean([math.pow(10, dbm / 10) for dbm in faded])
    assert 10 * math.log10(mean_mw) == pytest.approx(still[0], abs=0.25)
    assert max(faded) - min(faded) > 10


@pytest.mark.parametrize("mean_over_sensitivity_db", [2.0, 0.01, -0.01, -2.0, -6.0])
def test_the_share_of_copies_received_is_the_chance_of_the_fade_on_either_side_of_the_sensitivity(
    make_scenario: MakeScenario, mean_over_sensitivity_db: float
) -> None:
    """Rayleigh: P(gain >= threshold / mean) = exp(-threshold / mean); 1 / e where both are equal."""
    base = {"nodes.count": 2, "radio.channel": "friis", "radio.sensitivity_dbm": -80, **LAWS["rayleigh"], **STIRRED}
    air = Air(make_scenario(**base), [0, 10 ** ((30 + 80 - 40.095 - mean_over_sensitivity_db) / 20)])
    for i in range(FRAMES):
        air.send(1, (1 + i) * MS, now_ns=i * MS, payload=bytes(64))
        air.medium.wake((1 + i) * MS)
    told = air.run(10_000 * MS)
    heard = receptions(told)
    share = math.exp(-(10 ** (-mean_over_sensitivity_db / 10)))
    assert len(heard) / FRAMES == pytest.approx(share, abs=0.03)
    copies = air.medium.report()["copies"]
    assert copies["on_air"] == FRAMES
    assert copies["lost"].get("weak_signal", 0) == FRAMES - len(heard)
    rows = [row for h in told if isinstance(h.message, LinkStats) for row in h.message.rows()]
    assert sum(row.copies for row in rows) == FRAMES
    mean_dbm = -80 + mean_over_sensitivity_db
    assert all(row.rssi_dbm == pytest.approx(mean_dbm, abs=0.01) for row in rows if row.received)


def test_a_link_that_fading_lifts_less_than_once_in_a_thousand_frames_has_no_copies(
    make_scenario: MakeScenario,
) -> None:
    base = {"nodes.count": 2, "radio.channel": "friis", "radio.sensitivity_dbm": -80, **LAWS["rayleigh"], **STIRRED}
    for margin_db, on_air in ((8.3, 1), (8.5, 0)):  # 10 log10(ln 1000) = 8.39
        air = Air(make_scenario(**base), [0, 10 ** ((30 + 80 - 40.095 + margin_db) / 20)])
        air.send(1, 1 * MS)
        air.run()
        assert air.medium.report()["copies"]["on_air"] == on_air


@pytest.mark.parametrize("law", LAWS)
def test_the_lift_is_the_gain_that_one_draw_in_a_thousand_exceeds(make_scenario: MakeScenario, law: str) -> None:
    radio = make_scenario(**{"nodes.count": 2, "radio.channel": "friis", **LAWS[law]}).radio
    random = np.random.Generator(np.random.PCG64(1))
    if radio.fading == "nakagami":
        drawn = random.gamma(radio.nakagami_m, 1 / radio.nakagami_m, 400_000)
    else:
        k = 10 ** (radio.rician_k_db / 10)
        normal = random.normal(size=(2, 400_000)) / math.sqrt(2 * (k + 1))
        drawn = (math.sqrt(k / (k + 1)) + normal[0]) ** 2 + normal[1] ** 2
    assert (drawn > lift(radio)).mean() == pytest.approx(0.001, abs=0.0002)


def test_the_sum_of_the_waves_is_mapped_by_its_own_distribution() -> None:
    """Of so few waves of random phase: how often their sum is longer than this, by 640,000 phases."""
    phases = np.random.default_rng(1).uniform(0, 2 * np.pi, (20_000, WAVES))
    length = np.abs(np.exp(1j * phases).sum(axis=1)) / math.sqrt(WAVES)
    amplitudes = np.array([0.3, 0.8, 1.2, 1.7, 2.1])
    for amplitude, share in zip(amplitudes, np.exp(-random_walk_exponent(amplitudes)), strict=True):
        assert (length > amplitude).mean() == pytest.approx(share, abs=4 * math.sqrt(share / 20_000))


@pytest.mark.parametrize("law", ["rayleigh", "rician"])
def test_between_poses_a_gain_goes_on_along_each_axis_as_if_poses_came(make_scenario: MakeScenario, law: str) -> None:
    radio = make_scenario(**{"nodes.count": 2, "radio.channel": "friis", **LAWS[law]}).radio
    waves, table = Waves(radio, seed=1), tables(radio)
    globals_, ints, reals = np.zeros(100, np.int64), np.zeros(100, np.int64), np.zeros(100)
    ints[FADING], reals[FADING_SHAPE] = law_of(radio)
    at = np.array([[0.0, 0.0, 50.0], [40.0, 30.0, 80.0]])
    velocities = np.array([[3.0, 0.0, 0.0], [0.0, -4.0, 0.0], [0.0, 0.0, 5.0], [2.0, 3.0, -1.0]])
    for velocity in velocities:
        moves = np.array([velocity, -0.5 * velocity[::-1]])
        now = waves.of(at, moves, 0)
        for t_ms in (7, 40):
            then = waves.of(at + moves * t_ms / 1000, moves, t_ms * MS)
            goes_on = gain(globals_, ints, reals, now, table, 0, 1, t_ms * MS)
            assert goes_on == pytest.approx(gain(globals_, ints, reals, then, table, 1, 0, 0), abs=0.02)
    still = np.zeros((3, 3))
    three = waves.of(np.array([at[0], at[1], at[1] + 7.0]), still, 0)
    gains = [gain(globals_, ints, reals, three, table, a, b, 0) for a, b in ((0, 1), (0, 2), (1, 2))]
    assert min(abs(gains[0] - gains[1]), abs(gains[1] - gains[2])) > 0.01, "both ends count"


def attempts_that_serve(make_scenario: MakeScenario, speed_m_s: float) -> tuple[float, float]:
    """The share of unicasts delivered in seven attempts, and of attempts that fail, over many seeds: the mean power is
    3 dB above the sensitivity, ACKs at the rate of data.
    """
    keys = {"nodes.count": 2, "radio.channel": "friis", "radio.sensitivity_dbm": -80, **LAWS["rayleigh"]}
    acked = made = 0
    for seed in range(SEEDS):
        air = Air(make_scenario(**keys, seed=seed), [])
        states = array("d", [0.0, 0, 50, speed_m_s, 0, 0, 10 ** ((30 + 77 - 40.095) / 20), 0, 50, 0, 0, 0])
        air.medium.receive(NAMES.pose, Poses(0, array("H", [1, 2]), states), 0)
        air.medium.receive(NAMES.radio_tx(1), TxRequest(0, MS, bytes(1024), NodeId(2), wants_status=True), 0)
        ((_, outcome, _, attempts),) = statuses(air.run())
        acked += outcome is TxOutcome.ACKED
        made += attempts
    return acked / SEEDS, 1 - acked / made


SEEDS = 300


def test_a_link_that_has_faded_stays_so_while_nobody_moves_and_both_directions_fade_together(
    make_scenario: MakeScenario,
) -> None:
    """P(gain > 1/2) = exp(-1/2) = 0.607: of a frame, of its ACK after it, and of all seven attempts together."""
    delivered, _ = attempts_that_serve(make_scenario, 0.0)
    assert delivered == pytest.approx(0.607, abs=0.09)


@pytest.mark.slow
def test_attempts_meet_other_fades_the_faster_a_station_moves(make_scenario: MakeScenario) -> None:
    """Jakes' model at such instants gives 0.61, 0.85 and 0.99; it changes by half a wavelength in 62 or 6.2 ms."""
    slow, fast = (attempts_that_serve(make_scenario, speed)[0] for speed in (1.0, 10.0))
    assert slow == pytest.approx(0.85, abs=0.07)
    assert fast > 0.97


FULL = {
    "channel": "friis", "frequency_mhz": 5180, "tx_power_dbm": 12, "interference_floor_dbm": -96, "shadowing_db": 5,
    "fading": "rician", "rician_k_db": 3, "capture": True, "standard": "a", "rate_mbps": 12,
}  # fmt: skip


@examples(12)
@given(st.integers(0, 10_000), st.integers(2, 12), st.sampled_from(["rician", "nakagami"]), st.booleans())
def test_all_books_close_with_everything_on(seed: int, count: int, fading: str, ofdm: bool) -> None:
    keys = {**FULL, "fading": fading}
    if not ofdm:
        keys = {**keys, "standard": "b", "rate_mbps": 11}
    air = medium(count, **keys, queue_frames=6, lifetime_ms=40)
    outputs = run(air, seed, count=count, frames=120)
    report = air.report()
    frames, copies = report["frames"], report["copies"]
    assert frames["in_flight"] == 0
    assert frames["delivered"] + sum(frames["dropped"].values()) == frames["sent"] == 120
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values())
    assert sum(isinstance(message, TxStatus) for _, message in outputs) == 120


def everything(extra_wakes: int = 0) -> list[Output]:
    found = run(medium(9, **FULL), 7, count=9, frames=150, extra_wakes=extra_wakes)
    return sorted(found, key=lambda output: (output[1].end_ns, output[0], isinstance(output[1], Reception)))


def test_the_same_seed_fades_alike_however_often_time_is_told() -> None:
    assert any(isinstance(message, Reception) for _, message in everything())
    assert everything() == everything(extra_wakes=200)


def test_fading_without_powers_is_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match=r"radio\.fading needs a channel with powers"):
        make_scenario(**{"radio.fading": "rician"})


@examples(10)
@given(st.integers(0, 10_000), st.booleans())
def test_books_close_when_faults_lie_on_links_that_fade(seed: int, capture: bool) -> None:
    count = 6
    air = medium(count, **{**FULL, "capture": capture})
    for control in (
        Degrade("d", NodeId(1), NodeId(2), both=True, loss_db=12.0, loss_share=0.4),
        Jam("j", Enu(100.0, 100.0, 0.0), 200.0, -80.0),
        Cut("c", NodeId(3), 10 * MS),
    ):
        air.receive(Topics("k").radio_control, control, 0)
    run(air, seed, count=count, frames=100)
    report = air.report()
    copies = report["copies"]
    assert report["refused"] == {}
    assert report["frames"]["in_flight"] == 0
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values())


def test_a_rician_factor_is_given_in_decibels(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "radio.channel": "friis", **LAWS["rician"]})
    assert law_of(scenario.radio) == (RICIAN, pytest.approx(10**0.6))


def test_links_of_two_transmitters_fade_apart(make_scenario: MakeScenario) -> None:
    """Both are 10 m from node 2, and send in turns."""
    air = Air(
        make_scenario(**{"nodes.count": 3, "radio.channel": "friis", **LAWS["rayleigh"], **STIRRED}), [-10, 0, 10]
    )
    for i in range(60):
        air.send(1 if i % 2 else 3, (1 + i) * MS, payload=bytes(64))
    heard = [h.message for h in air.run() if h.node == 2 and isinstance(h.message, Reception)]
    faded = {src: [message.rssi_dbm for message in heard if message.src == src] for src in (1, 3)}
    assert len(faded[1]) == len(faded[3]) == 30
    assert not set(faded[1]) & set(faded[3])
