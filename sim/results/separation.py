"""The table `separation` of `summary.json`: how near UAVs came to each other, and what they knew of it beforehand."""

from typing import Any

import numpy as np

from fanet_mw.trace import ConflictForeseen, Delivered, Warned
from fanet_mw.units import MS
from sim.records.record_kinds import records_of
from sim.results.outcome import Outcome


def separation(outcome: Outcome) -> dict[str, Any]:
    """The true separation, and the conflicts that UAVs foresaw; empty if separation was not watched."""
    seen = outcome.reports.get("world", {}).get("separation")
    if not seen:
        return {}
    foreseen = [*records_of(outcome.records, ConflictForeseen)]
    about = {(r.node, r.seq): r.other for r in records_of(outcome.records, Warned)}
    delivered = records_of(outcome.records, Delivered) if about else ()
    delays_ms = [r.delay_ns / MS for r in delivered if about.get((r.origin, r.seq)) == r.node]
    ahead_s = sorted(r.closest_ms / 1000 for r in foreseen)
    return {
        **seen,
        "foreseen": len(foreseen),
        "told": sum(r.told for r in foreseen),
        "ahead_s": {"least": ahead_s[0], "p50": ahead_s[len(ahead_s) // 2]} if ahead_s else {},
        "warnings": len(about),
        "reached_the_other": round(len(delays_ms) / len(about), 6) if about else None,
        "to_the_other_ms": {
            "p50": round(float(np.percentile(delays_ms, 50)), 3),
            "p95": round(float(np.percentile(delays_ms, 95)), 3),
            "max": round(max(delays_ms), 3),
        } if delays_ms else {},
    }  # fmt: skip
