"""What a loss is called, what makes a medium busy, and how weak a frame may be, by the clauses of IEEE 802.11-2020."""

import math
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hand_driven import NAMES, Air, receptions, statuses
from test_emulator_kernel import completion

from emulator.channel.error_rate import log_success_per_bit
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB, log_ok_alone
from emulator.kernel.state import DELAY, LINK_DST, LOG_OK
from fanet_mw.bus.messages import Poses, TxOutcome
from fanet_mw.bus.radio_control import Jam, Restore
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.radio import LEAST_SNR_DB, RATES_MBPS
from fanet_mw.units import MS, US, Enu
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

MakeScenario = Callable[..., Scenario]
NOISE_DBM = -174 + 10 * math.log10(22e6) + 7
POWERS = {"radio.channel": "friis", "radio.tx_power_dbm": 0.0}


def metres(power_dbm: float, mhz: float = 2412.0) -> float:
    """Where 0 dBm have fallen to this in free space."""
    return 299_792_458 / (4 * math.pi * mhz * 1e6) * 10 ** (-power_dbm / 20)


# --- losses -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("interferer_dbm", "reason"), [(NOISE_DBM - 21, "weak_signal"), (-80.0, "collision")])
def test_a_loss_is_a_collision_only_if_the_frame_would_have_survived_without_the_other(
    make_scenario: MakeScenario, interferer_dbm: float, reason: str
) -> None:
    """The wanted frame has 4 dB of SNR, at which noise takes nearly all of 1,088 bytes at 11 Mb/s."""
    wanted_dbm = NOISE_DBM + (4.0 if reason == "weak_signal" else 12.0)
    least_dbm = -100.0 if reason == "weak_signal" else -86.0  # so that the two are hidden from each other
    keys = {"nodes.count": 3, **POWERS, "radio.interference_floor_dbm": -120.0, "radio.sensitivity_dbm": least_dbm}
    lost: dict[str, int] = {}
    for seed in range(30):
        air = Air(make_scenario(**keys, seed=seed), [0, -metres(wanted_dbm), metres(interferer_dbm)])
        air.send(2, 1 * MS)
        air.send(3, 1 * MS + 300 * US)
        rows = [row for h in air.run() if hasattr(h.message, "rows") for row in h.message.rows()]
        for row in rows:
            if (row.src, row.dst) == (2, 1):
                for name, count in zip(("collision", "half_duplex", "weak_signal"), row.lost, strict=False):
                    lost[name] = lost.get(name, 0) + count
    assert lost[reason] >= 29
    assert lost["collision" if reason == "weak_signal" else "weak_signal"] == 0


def test_what_was_on_the_air_before_a_frame_spoils_it_too(make_scenario: MakeScenario) -> None:
    """An interferer that nobody senses leaves 4.4 dB of the wanted frame's 10.6: its preamble, not its 1,088 bytes."""
    keys = {"nodes.count": 3, **POWERS, "radio.interference_floor_dbm": -120.0, "radio.sensitivity_dbm": -86.0}
    lost = {"collision": 0, "weak_signal": 0}
    for seed in range(30):
        air = Air(make_scenario(**keys, seed=seed), [0, -metres(NOISE_DBM + 10.6), metres(NOISE_DBM + 5.0)])
        air.send(3, 1 * MS)
        air.send(2, 1 * MS + 300 * US)
        for h in air.run():
            for row in h.message.rows() if hasattr(h.message, "rows") else ():
                if (row.src, row.dst) == (2, 1):
                    lost["collision"] += row.lost[0]
                    lost["weak_signal"] += row.lost[2]
    assert lost["collision"] >= 29
    assert lost["weak_signal"] == 0


def test_preamble_and_header_have_the_error_rate_of_their_own_rate(make_scenario: MakeScenario) -> None:
    """Of frames of 65 bytes at 11 Mb/s half are lost for these bytes, and none for 192 us at 1 Mb/s before them."""
    snr_db = next(db for db in np.arange(0.0, 12.0, 0.05) if completion(11.0, float(db)) ** (65 / 128) > 0.5)
    keys = {"nodes.count": 2, **POWERS, "radio.sensitivity_dbm": -95, "radio.queue_frames": 1000}
    air = Air(make_scenario(**keys), [0, metres(NOISE_DBM + snr_db)])
    for n in range(800):
        air.send(1, (1 + n) * MS, payload=b"x", now_ns=n * MS)
        air.medium.wake((1 + n) * MS)
    assert len(receptions(air.run(2000 * MS))) / 800 == pytest.approx(0.5, abs=0.07)


@pytest.mark.slow
def test_with_a_signal_as_strong_as_noise_both_reasons_are_met_as_often_as_their_rates_say(
    make_scenario: MakeScenario,
) -> None:
    """6.5 dB above noise, and an interferer 6 dB below noise: 5.5 dB are left for the part that overlaps."""
    keys = {"nodes.count": 3, **POWERS, "radio.interference_floor_dbm": -120.0, "radio.sensitivity_dbm": -95}
    counts = {"collision": 0, "weak_signal": 0, "received": 0}
    runs = 400
    for seed in range(runs):
        air = Air(make_scenario(**keys, seed=seed), [0, -metres(NOISE_DBM + 6.5), metres(NOISE_DBM - 6.0)])
        air.send(2, 1 * MS)
        air.send(3, 1 * MS + 10 * US)
        for h in air.run():
            for row in h.message.rows() if hasattr(h.message, "rows") else ():
                if (row.src, row.dst) == (2, 1):
                    counts["received"] += row.received
                    counts["collision"] += row.lost[0]
                    counts["weak_signal"] += row.lost[2]
    alone = completion(11.0, 6.5) ** (1088 / 128)
    both = completion(11.0, 6.5 - 10 * math.log10(1 + 10**-0.6)) ** (1088 / 128)
    assert counts["received"] / runs == pytest.approx(both, abs=0.08)
    assert counts["weak_signal"] / runs == pytest.approx(1 - alone, abs=0.08)
    assert counts["collision"] / runs == pytest.approx(alone - both, abs=0.08)


@pytest.mark.slow
def test_no_frame_has_more_retries_than_attempts_allow_also_when_most_expire() -> None:
    """Seven attempts are at most six retries (802.11-2020, 10.3.4.4); here most frames expire after some attempts."""
    settings = ["nodes.count=30", "traffic.arrivals=cbr", "traffic.interval_s=0.005", "duration_s=4",
                "radio.lifetime_ms=40"]  # fmt: skip
    summary = finish(simulate(catalog.find("contention_unicast", settings)), out=None)
    assert summary["frames"]["dropped"]["mac_lifetime"] > summary["frames"]["delivered"]
    assert 0 < summary["air"]["mean_retries"] <= 6


# --- carrier sense ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("standard", "noise_dbm", "busy"),
    [("a", -61.9, True), ("a", -62.1, False), ("g", 0.0, True), ("a", math.inf, True), ("b", 0.0, False)],
)
def test_a_station_of_ofdm_keeps_silent_while_it_is_jammed_above_62_dbm(
    make_scenario: MakeScenario, standard: str, noise_dbm: float, busy: bool
) -> None:
    """802.11-2020, 17.3.10.6: CCA is busy for any signal 20 dB above -82 dBm; DSSS, mode 2, looks for signals only."""
    air = Air(make_scenario(**{"nodes.count": 2, "radio.standard": standard, **POWERS}), [0, 15])
    air.medium.receive(NAMES.radio_control, Jam("j", Enu(0.0, 0.0, 0.0), 10.0, noise_dbm), 0)
    air.send(1, 1 * MS)
    air.medium.receive(NAMES.radio_control, Restore("j"), 30 * MS)
    heard = air.run()
    ((node, _, end_ns, _),) = statuses(heard)
    assert node == 1
    assert (end_ns > 30 * MS) == busy
    assert len(receptions(heard)) == 1, "the other station is outside"


def test_what_begins_while_a_backoff_runs_freezes_it(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.standard": "a", **POWERS}), [0, 15])
    for i in range(3):
        air.send(1, 1 * MS + i)
    air.medium.receive(NAMES.radio_control, Jam("j", Enu(0.0, 0.0, 0.0), 10.0, 0.0), 1 * MS + 100 * US)
    air.medium.receive(NAMES.radio_control, Restore("j"), 20 * MS)
    ends_ns = [end_ns for _, _, end_ns, _ in statuses(air.run())]
    assert ends_ns[0] < 2 * MS, "on the air when it began"
    assert min(ends_ns[1:]) > 20 * MS


def test_a_frame_above_carrier_sense_and_below_the_sensitivity_is_waited_for_and_lost(
    make_scenario: MakeScenario,
) -> None:
    keys = {"nodes.count": 3, **POWERS, "radio.sensitivity_dbm": -80, "radio.carrier_sense_dbm": -90}
    air = Air(make_scenario(**keys), [0, metres(-85), -metres(-70)])
    air.send(2, 1 * MS)
    air.send(1, 1 * MS + 100 * US)
    heard = air.run()
    ends_ns = {node: end_ns for node, _, end_ns, _ in statuses(heard)}
    assert ends_ns[1] > ends_ns[2] + 984 * US, "it waited"
    assert {(node, src) for node, src, _ in receptions(heard)} == {(3, 1)}


# --- levels -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", LEAST_SNR_DB)
@pytest.mark.parametrize("rate_mbps", RATES_MBPS["g"])
def test_the_default_sensitivity_is_where_one_frame_of_128_bytes_in_a_hundred_arrives(
    model: str, rate_mbps: float
) -> None:
    table = log_success_per_bit(rate_mbps, model, short=True)
    at = round((LEAST_SNR_DB[model][rate_mbps] - ERROR_FLOOR_DB) * ERROR_STEPS_PER_DB)
    assert math.exp(8 * 128 * table[at - 1]) < 0.01 <= math.exp(8 * 128 * table[at])


def levels(make_scenario: MakeScenario, **radio: Any) -> tuple[float, ...]:
    found = make_scenario(**{f"radio.{key}": value for key, value in {"channel": "friis", **radio}.items()}).radio
    return found.sensitivity_dbm, found.carrier_sense_dbm, found.interference_floor_dbm, found.preamble_snr_db


def test_sensitivities_follow_the_rate_and_carrier_sense_is_that_or_82_dbm(make_scenario: MakeScenario) -> None:
    assert levels(make_scenario) == pytest.approx((NOISE_DBM + 3.35, NOISE_DBM + 3.35, -101, -6.65), abs=0.01)
    assert levels(make_scenario, rate_mbps=1.0)[0] == pytest.approx(NOISE_DBM - 6.65, abs=0.01)
    assert levels(make_scenario, access="ns3") == (-82, -82, -101, 4)
    assert levels(make_scenario, sensitivity_dbm=-75.0)[:2] == (-75, -75)
    assert levels(make_scenario, standard="a")[:2] == pytest.approx((NOISE_DBM - 0.41 + 20.55, -82), abs=0.01)
    quiet = levels(make_scenario, rate_mbps=1.0, noise_figure_db=0.0)
    assert quiet[2] == quiet[1] == quiet[0] < -101


@pytest.mark.parametrize(("rate_mbps", "half_km"), [(1.0, 23.7), (11.0, 7.4)])
def test_each_rate_reaches_as_far_as_its_error_rates_let_it(
    make_scenario: MakeScenario, rate_mbps: float, half_km: float
) -> None:
    """Where half of the frames of 1,024 bytes arrive in free space, by the error rates alone, with 30 dBm."""
    got = {}
    for share, factor in (("more", 0.95), ("fewer", 1.05)):
        keys = {"nodes.count": 2, "radio.channel": "friis", "radio.rate_mbps": rate_mbps}
        air = Air(make_scenario(**keys), [0, factor * 1000 * half_km])
        for i in range(60):
            air.send(1, (1 + 20 * i) * MS)
        got[share] = len(receptions(air.run(2000 * MS))) / 60
    assert got["more"] > 0.6
    assert 0 < got["fewer"] < 0.4


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"interference_floor_dbm": -80.0}, r"interference_floor_dbm = -80 must be <= radio.sensitivity_dbm = -90.23"),
        (
            {"carrier_sense_dbm": -95.0, "interference_floor_dbm": -94.0},
            r"interference_floor_dbm = -94 must be <= radio.carrier_sense_dbm = -95",
        ),
        ({"carrier_sense_dbm": -80.0}, r"carrier_sense_dbm = -80 must be <= radio.sensitivity_dbm = -90.23"),
    ],
)
def test_levels_that_would_cut_links_in_silence_are_refused(
    make_scenario: MakeScenario, keys: dict[str, float], said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        levels(make_scenario, **keys)


def test_the_tables_of_ns3_need_less_than_the_bound_of_nist() -> None:
    """`SINR` at which half of the frames of 1,458 bytes arrive: 0.3 dB at 6 Mb/s in ns-3's table, 17.5 dB at 54."""

    def half_db(rate_mbps: float, model: str) -> float:
        table = log_success_per_bit(rate_mbps, model)
        at = next(i for i, log_ok in enumerate(table) if math.exp(8 * 1458 * log_ok) > 0.5)
        return ERROR_FLOOR_DB + at / ERROR_STEPS_PER_DB

    assert half_db(6.0, "tables") == pytest.approx(0.3, abs=0.06)
    assert half_db(54.0, "tables") == pytest.approx(17.5, abs=0.06)
    for rate_mbps in (6.0, 12.0, 18.0, 24.0, 36.0, 48.0, 54.0):
        assert 2.5 < half_db(rate_mbps, "nist") - half_db(rate_mbps, "tables") < 5.5
    assert half_db(6.0, "tables") < half_db(9.0, "tables") < half_db(12.0, "tables")


def test_short_frames_have_the_table_of_short_frames(make_scenario: MakeScenario) -> None:
    """At 12 Mb/s and 1.9 dB 65 bytes arrive with 0.63^2, by the table of 1,458 bytes never; 464 have that table."""
    keys = {"nodes.count": 2, **POWERS, "radio.standard": "g", "radio.rate_mbps": 12, "radio.ofdm_errors": "tables"}
    noise_dbm = -174 + 10 * math.log10(20e6) + 7
    got = {}
    for size, snr_db in ((1, 1.9), (400, 2.5)):
        air = Air(make_scenario(**keys), [0, metres(noise_dbm + snr_db)])
        for i in range(300):
            air.send(1, (1 + 2 * i) * MS, payload=bytes(size))
        got[size] = len(receptions(air.run(1000 * MS)))
    assert got[1] / 300 == pytest.approx((1 - 0.371) ** (65 / 32), abs=0.09)
    assert got[400] / 300 == pytest.approx(0.003 ** (464 / 1458), abs=0.09)


# --- long links and large frames --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("standard", "distance_m", "coverage_class", "acked"),
    [("b", 2990.0, 0, True), ("b", 3010.0, 0, False), ("b", 3010.0, 1, True), ("b", 3440.0, 1, True),
     ("b", 3460.0, 1, False), ("a", 1340.0, 0, True), ("a", 1360.0, 0, False), ("a", 1360.0, 1, True)],
)  # fmt: skip
def test_an_ack_is_waited_for_as_long_as_the_coverage_class_says(
    make_scenario: MakeScenario, standard: str, distance_m: float, coverage_class: int, acked: bool
) -> None:
    """802.11-2020, 9.4.2.8: 3 us of air propagation time per class; the timeout is SIFS + slot + PHY header."""
    keys = {"nodes.count": 2, "radio.channel": "range", "radio.range_m": 5000.0, "radio.standard": standard,
            "radio.coverage_class": coverage_class}  # fmt: skip
    air = Air(make_scenario(**keys), [0, distance_m])
    air.send(1, 1 * MS, dst=2)
    ((_, outcome, _, attempts),) = statuses(air.run())
    assert (outcome is TxOutcome.ACKED) == acked
    assert attempts == (1 if acked else 7)
    assert air.medium.report()["air"]["late_acks"] == (0 if acked else 7)


def test_a_frame_is_an_msdu_of_at_most_2304_bytes(make_scenario: MakeScenario) -> None:
    """802.11-2020, 9.2.4.8.1: 2,304 less LLC/SNAP 8, IPv4 20 and UDP 8."""
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 1 * MS, payload=bytes(2268))
    air.send(1, 1 * MS, payload=bytes(2269))
    assert [outcome for _, outcome, _, _ in statuses(air.run())] == [TxOutcome.REFUSED, TxOutcome.SENT]
    with pytest.raises(ConfigError, match="2268"):
        make_scenario(**{"radio.max_frame_bytes": 2269})


def test_a_pose_that_makes_no_sense_leaves_those_of_others_and_the_last_one_of_its_own(
    make_scenario: MakeScenario,
) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 1000])
    states = array("d", [0.0] * 6 + [math.nan] * 6 + [150.0] + [0.0] * 5)
    air.medium.receive(NAMES.pose, Poses(1 * MS, array("H", [1, 2, 3]), states), 1 * MS)
    air.send(1, 2 * MS, now_ns=1 * MS)
    assert {node for node, _, _ in receptions(air.run())} == {2, 3}
    assert air.medium.report()["refused"] == {"poses": 1}


@pytest.mark.parametrize(
    "keys",
    [
        {"radio.tx_power_dbm": 18},
        *({"radio.tx_power_dbm": 16, "radio.standard": "g", "radio.rate_mbps": r} for r in (6, 54)),
    ],
)
@pytest.mark.parametrize("size", [40, 1024])
def test_a_frame_that_was_alone_has_the_chance_that_it_is_told_to_have_had_alone(
    make_scenario: MakeScenario, keys: dict[str, Any], size: int
) -> None:
    """By that it is told whether interference or weakness has cost it: header, data, and no signal extension."""
    base = {"nodes.count": 2, "radio.channel": "log_distance", "radio.sensitivity_dbm": -110}
    air = Air(make_scenario(**base, **keys), [0, 150])
    air.send(1, 1 * MS, payload=bytes(size))
    ((_, _, end_ns, _),) = statuses(air.run())
    a, link = air.medium._kernel.arrays, 0
    t_ns = end_ns + int(a.lk[DELAY, link])
    assert a.lk[LINK_DST, link] == 1
    alone = log_ok_alone(a.p, a.pf, a.st, a.sf, a.lp, a.err, 1, link, t_ns)
    assert alone == pytest.approx(a.sf[LOG_OK, 1], rel=1e-9)
    assert alone < -1e-4, "there is noise"
