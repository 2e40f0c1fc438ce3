"""The measured tables of the emulator."""

import math
import statistics
from collections.abc import Iterable, Iterator
from typing import Final

from emulator.channel.error_rate import log_success_per_bit
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB
from fanet_mw.airtime import OFDM_RATES_MBPS
from fanet_mw.scenario.tables.radio import DSSS_RATES_MBPS
from fanet_mw.units import NodeId
from tests.tables.markdown import Rows
from tests.validation import held_out as drawn_cases
from tests.validation.medium_driver import contention, disc
from tests.validation.reference import Case, bianchi, cases, means, measure

_AGAINST_NS3: Final = (
    "broadcast A n=2 every 0.001 s", "broadcast A n=10 every 0.001 s", "broadcast A n=45 every 0.001 s",
    "broadcast B n=10 every 0.001 s", "broadcast B n=45 every 0.001 s", "broadcast A n=10 every 0.01 s",
    "unicast 1 senders saturated", "unicast 5 senders saturated", "hidden terminals unicast poisson every 0.01 s",
    "hidden terminals broadcast poisson every 0.01 s", "flooding 9 x 5, 1 sources every 1 s",
    "flooding 9 x 5, 20 sources every 1 s", "flooding 9 x 5, 44 sources every 1 s",
    "flooding 9 x 5, 44 sources every 0.1 s",
)  # fmt: skip
_EXPLAINED: Final = {
    "broadcast A n=10 every 0.005 s": "air.pdr",
    "broadcast B n=10 every 0.01 s": "air.pdr",
    "broadcast B n=45 every 0.01 s": "air.pdr",
    "flooding 9 x 5, 44 sources every 1 s": "pdr",
    "hidden terminals unicast poisson every 0.005 s": "air.mean_retries",
}
"""Cases, and which figure of each."""
_EXPLAINED_BY: Final = 8
"""Runs per figure: the differences are small."""
_EMANE_HALF_DB: Final = {1: -6.3, 2: -3.3, 5.5: 1.1, 11: 4.1, 6: 0.3, 54: 20.5}
"""Where the 802.11abg curves of EMANE pass one half, for frames of 128 bytes."""
_POINTS: Final = ("difs", "eifs", "sums", "onset", "window")


def _chosen(names: Iterable[str]) -> Iterator[Case]:
    known = {case.name: case for case in cases()}
    for name in names:
        yield known[name]


def against_ns3() -> Rows:
    """A sample of what `scripts/validate` prints."""
    rows = [["case", "figure", "ours, `ns3`", "ours, `standard`", "ns-3.44"]]
    for case in _chosen(_AGAINST_NS3):
        for compared in measure(case):
            metric = compared.metric
            figures = [f"{figure:.3f}" for figure in (compared.ours, compared.standard, metric.ns3)]
            rows.append([case.name, f"`{metric.key}`", *figures])
    return rows


def held_out() -> Rows:
    """Ours now beside what ns-3 said in cases drawn by a seed."""
    rows = [["case", "figure", "ours, `ns3`", "ns-3.44", "within", "agrees"]]
    for found in drawn_cases.compared():
        for one in found:
            figures = [f"{figure:.3f}" for figure in (one.ours, one.metric.ns3, one.tolerance)]
            rows.append([one.case, f"`{one.metric.key}`", *figures, "yes" if one.agrees else "no"])
    return rows


def points() -> Rows:
    """What each point in which ns-3 differs does alone, to one figure of a case."""
    rows = [["case", "figure", "`standard`", *(f"`{point}`" for point in _POINTS), "`ns3`", "ns-3.44"]]
    for case in _chosen(_EXPLAINED):
        longer = case._replace(seeds=_EXPLAINED_BY)
        (metric,) = [metric for metric in case.metrics if metric.key == _EXPLAINED[case.name]]
        ways = ("standard", *(f'["{point}"]' for point in _POINTS), "ns3")
        found = [means(longer, [metric.key], access=way)[0] for way in ways]
        rows.append([case.name, f"`{metric.key}`", *(f"{figure:.3f}" for figure in (*found, metric.ns3))])
    return rows


def closed_forms() -> Rows:
    """Saturated unicast at 54 Mb/s beside arithmetic and Bianchi (JSAC 18(3), 2000)."""
    rows = [["54 Mb/s, saturated unicast", "ours", "closed form"]]
    for name, radio, cycle_us in (
        ("`a`, one sender: Mb/s", {"standard": "a"}, 34 + 7.5 * 9 + 184 + 16 + 28),
        ("`g`, one sender: Mb/s", {"standard": "g"}, 50 + 7.5 * 20 + 190 + 10 + 34),
        ("`g`, short slot, one sender: Mb/s", {"standard": "g", "slot": "short"}, 28 + 7.5 * 9 + 190 + 10 + 34),
    ):
        air = contention(
            [(0, 0), (10, 0)], interval_s=0.0002, sources=[1], dst=NodeId(2), duration_s=3, warmup_s=0.5,
            lifetime_ms=1e6, **radio,
        )["air"]  # fmt: skip
        rows.append([name, f"{air['throughput_mbps']:.2f}", f"{8 * 1024 / cycle_us:.2f}"])
    for count in (3, 10, 25):
        mbps, failure = bianchi(
            count, success_us=184 + 16 + 28 + 34, collision_us=184 + 34, payload_bytes=1024, window=16, slot_us=9
        )
        runs = [
            contention(
                disc(count, radius_m=20), interval_s=0.0003 * count, sources=range(1, count + 1), dst=None,
                duration_s=5, warmup_s=1, lifetime_ms=1e6, standard="a", seed=seed,
            )["air"]
            for seed in (1, 2, 3)
        ]  # fmt: skip
        ours = [statistics.fmean(air[key] for air in runs) for key in ("throughput_mbps", "attempt_failure")]
        rows.append([f"`a`, {count} senders: Mb/s", f"{ours[0]:.1f}", f"{mbps:.1f}"])
        rows.append([f"`a`, {count} senders: attempts that fail", f"{ours[1]:.3f}", f"{failure:.3f}"])
    return rows


def error_rates() -> Rows:
    """SINR [dB] at which half of the frames of 128 bytes come through."""
    rates = (*DSSS_RATES_MBPS, *OFDM_RATES_MBPS)
    half = math.log(0.5) / (8 * 128)
    steps = [int((log_success_per_bit(rate) > half).argmax()) for rate in rates]
    ours = [f"{step / ERROR_STEPS_PER_DB + ERROR_FLOOR_DB:.1f}" for step in steps]
    theirs = [f"{_EMANE_HALF_DB[rate]:.1f}" if rate in _EMANE_HALF_DB else "" for rate in rates]
    return [["Mb/s", *(f"{rate:g}" for rate in rates)], ["ours", *ours], ["EMANE", *theirs]]
