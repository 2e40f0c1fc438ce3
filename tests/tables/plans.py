"""Measured tables of plans: what `fanet plan` states before take-off, and what simulated swarms then do."""

from typing import Final

from tests.benchmarks import plan_against_runs
from tests.tables.markdown import Rows
from tests.tables.summaries import summarized

_SIGMAS_M: Final = (0, 10, 15, 30)


def contending() -> Rows:
    """Plans in which relays contend."""
    rows = [["interval, clusters, period", "plan", "slot used", "bound", "greatest delay", "PDR"]]
    for interval_s, clusters, period_s in plan_against_runs.CASES:
        found = plan_against_runs.compared(interval_s, clusters, period_s, seconds=60)
        rows.append([
            f"{interval_s:g} s, {clusters}, {period_s:g} s",
            "feasible" if found.feasible else "not feasible",
            f"{100 * found.used:.0f} %",
            "-" if found.bound_s is None else f"{found.bound_s:.2f} s",
            f"{found.greatest_delay_s:.2f} s",
            f"{found.pdr:.3f}",
        ])  # fmt: skip
    return rows


def wrong_places() -> Rows:
    """Timetables made of places that GPS gives wrongly, and of measured links."""
    rows = [["SIGMA [m]", "links by places", "links as measured"]]
    for sigma_m in _SIGMAS_M:
        keys = [f"world.gps_sigma_m={sigma_m}", "duration_s=45", "nodes.telemetry_hz=1"]
        pdr = [summarized("clusters", *keys, f"clusters.links={links}")["pdr"] for links in ("places", "measured")]
        rows.append([f"{sigma_m}", *(f"{share:.3f}" for share in pdr)])
    return rows
