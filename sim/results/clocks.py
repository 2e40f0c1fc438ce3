"""The effect of inaccurate clocks on a run: true delays for the trace, and the errors of swarm time.

A node knows only its own estimate of swarm time. The simulation also knows the true time, so it can correct the delays
that nodes have measured, and tell how wrong each clock was.
"""

from bisect import bisect
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fanet_mw.trace import ClockSampled, Delivered, Generated, Record
from fanet_mw.units import US, S
from sim.records.record_kinds import records_of
from sim.records.trace_log import TraceLog
from sim.results.outcome import Outcome

_FASTEST: Final = 1e-3
"""The greatest rate error of a clock (`clock.drift_ppm`)."""


def true_delays(records: TraceLog) -> Collection[Record]:
    """The records with delays that count from the true instant of generation, where the trace has that instant."""
    born = {(record.node, record.seq): record.t_ns for record in records_of(records, Generated)}
    return records.changed(lambda record: _true_delay(record, born))


def _true_delay(record: Delivered, born: Mapping[tuple[int, int], int]) -> Delivered:
    born_ns = born.get((record.origin, record.seq))
    return record if born_ns is None else record._replace(delay_ns=record.t_ns - born_ns)


def errors_ns(samples: Sequence[ClockSampled]) -> list[tuple[ClockSampled, int]]:
    """Each sample with its true error: against the reference's clock at that instant, or without a reference against
    true time.
    """
    own: dict[int, dict[int, int]] = defaultdict(dict)
    for sample in samples:
        own[sample.node][sample.t_ns] = sample.ahead_ns
    clocks = {node: _Clock(ahead_ns) for node, ahead_ns in own.items()}
    return [
        (sample, sample.ahead_ns - (clocks[sample.reference].ahead_ns(sample.t_ns) if sample.reference in own else 0))
        for sample in samples
    ]


class _Clock:
    """By how much one node's swarm time was ahead. While its program does not run it has no samples, and its clock,
    which others follow on, goes on as before.
    """

    def __init__(self, samples: Mapping[int, int]) -> None:
        """`samples`: ahead [ns] by instant [ns]."""
        self._samples = samples
        self._instants = sorted(samples)

    def ahead_ns(self, t_ns: int) -> int:
        found = self._samples.get(t_ns)
        if found is not None:
            return found
        last = max(0, bisect(self._instants, t_ns) - 1)
        last_ns, before_ns = self._instants[last], self._instants[max(0, last - 1)]
        gained_ns = self._samples[last_ns] - self._samples[before_ns]
        if abs(gained_ns) > _FASTEST * (last_ns - before_ns):
            gained_ns = 0  # the clock jumped, or was set
        rate = gained_ns / (last_ns - before_ns) if last_ns > before_ns else 0.0
        return self._samples[last_ns] + round(rate * (t_ns - last_ns))


def clock_errors(outcome: Outcome) -> dict[str, Any]:
    """The table `clock` of `summary.json`; empty if clocks are exact."""
    samples = [*records_of(outcome.records, ClockSampled)]
    if not samples:
        return {}
    start_ns, end_ns = outcome.scenario.traffic_window_ns
    measured = [
        (sample, abs(error))
        for sample, error in errors_ns(samples)
        if start_ns <= sample.t_ns < end_ns and (sample.bound_ns >= 0 or outcome.scenario.clock.sync == "none")
    ]
    values = np.asarray([error for _, error in measured], dtype=np.float64) / US
    bounds = [sample.bound_ns / US for sample, _ in measured if sample.bound_ns >= 0]
    return {
        "error_us": _quantiles(values) if len(values) else dict.fromkeys(("p50", "p99", "max")),
        "bound_us": round(max(bounds), 3) if bounds else None,
        "beyond_bound": sum(error > sample.bound_ns >= 0 for sample, error in measured),
        "samples": len(measured),
        "jumps": sum(report.get("clock", {}).get("jumps", 0) for report in outcome.reports.values()),
        "lost": sum(report.get("clock", {}).get("lost", 0) for report in outcome.reports.values()),
        "without_time": _without_time(samples) if outcome.scenario.clock.sync != "none" else 0,
        "synced_after_s": _synced_after_s(samples, outcome.scenario.node_count),
    }


def _quantiles(values: npt.NDArray[np.float64]) -> dict[str, float]:
    p50, p99 = np.percentile(values, (50, 99))
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(values.max()), 3)}


def _without_time(samples: Sequence[ClockSampled]) -> int:
    """The number of nodes that have no swarm time at the end."""
    last = {sample.node: sample.bound_ns for sample in samples}
    return sum(bound_ns < 0 for bound_ns in last.values())


def _synced_after_s(samples: Sequence[ClockSampled], nodes: int) -> float | None:
    """The instant at which the last node first stated a bound; None if some node never did."""
    first: dict[int, int] = defaultdict(lambda: -1)
    for sample in samples:
        if sample.bound_ns >= 0 and first[sample.node] < 0:
            first[sample.node] = sample.t_ns
    return max(first.values()) / S if sum(at >= 0 for at in first.values()) == nodes else None
