"""The delays of a run against the bounds that the nodes themselves computed. Empty when no node has one.

A packet counts when it was generated while its origin's bound was in force and the application was measured.
"""

from typing import Any

from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import MS
from sim.outcome import Outcome


def against_bounds(outcome: Outcome) -> dict[str, Any]:
    """`bound` of `summary.json`: the largest bound, the largest delay, and deliveries that broke their own bound."""
    bounds = {
        report["node"]: (report["bound_from_ms"] * MS, report["bound_ms"] * MS)
        for report in outcome.reports.values()
        if report.get("bound_ms") is not None
    }
    if not bounds:
        return {}
    start_ns, end_ns = outcome.scenario.traffic_window_ns
    covered = {
        (record.node, record.seq)
        for record in outcome.records
        if type(record) is Generated
        and record.app == "traffic"
        and record.node in bounds
        and max(start_ns, bounds[record.node][0]) <= record.t_ns < end_ns
    }
    delays = [
        (record.delay_ns, record.delay_ns > bounds[record.origin][1])
        for record in outcome.records
        if type(record) is Delivered and (record.origin, record.seq) in covered
    ]
    worst_ns = max(bound_ns for _, bound_ns in bounds.values())
    observed_ns = max((delay_ns for delay_ns, _ in delays), default=0)
    traffic = {
        "worst_ms": round(worst_ns / MS, 3),
        "observed_max_ms": round(observed_ns / MS, 3),
        "deliveries": len(delays),
        "violations": sum(late for _, late in delays),
    }
    return {
        "classes": {"traffic": traffic},
        **{key: traffic[key] for key in ("worst_ms", "observed_max_ms", "violations")},
    }
