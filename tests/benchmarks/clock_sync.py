"""How well a swarm keeps time, and what that does to its turns: `python tests/benchmarks/clock_sync.py [SEEDS]`.

`clusters`: 9 x 5 grid, the reference in a corner, up to 12 hops, hellos every 1 s. Errors are true ones, against the
reference's clock (beacons) or true time (GPS, none), sampled once a second from 70 s to 120 s; traffic is measured
from 70 s on.
"""

import statistics
import sys
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

from fanet_mw.trace import ClockSampled
from fanet_mw.units import US, S
from sim.results.clocks import errors_ns
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog

BEGIN_S, END_S = 70, 120
GRID = [f"duration_s={END_S}", f"warmup_s={BEGIN_S}"]
CRYSTAL = ["clock.drift_ppm=20", "clock.offset_ms=50"]
CASES: Sequence[tuple[str, Sequence[str]]] = (
    ("exact clocks, slack 50 us", []),
    ("none, 20 ppm, no offset", ["clock.drift_ppm=20"]),
    ("none, 20 ppm, 50 ms", CRYSTAL),
    ("beacons, 20 ppm, 50 ms, slack 50 us", [*CRYSTAL, "clock.sync=beacons"]),
    ("beacons, 20 ppm, 50 ms, slack 250 us", [*CRYSTAL, "clock.sync=beacons", "clusters.turn_slack_us=250"]),
    ("beacons, 20 ppm, 1 s, slack 250 us",
     ["clock.drift_ppm=20", "clock.offset_ms=1000", "clock.sync=beacons", "clusters.turn_slack_us=250"]),
    ("beacons, walk 0.02 ppm, slack 400 us",
     [*CRYSTAL, "clock.wander_ppm=0.02", "clock.sync=beacons", "clusters.turn_slack_us=400"]),
    ("gps 100 ns, 20 ppm, 50 ms", [*CRYSTAL, "clock.sync=gps"]),
    ("gps 1 us, 20 ppm, 50 ms", [*CRYSTAL, "clock.sync=gps", "clock.gps_sigma_ns=1000"]),
)  # fmt: skip


def outcome_of(seed: int, settings: Sequence[str]) -> Outcome:
    return simulate(catalog.find("clusters", [*GRID, f"seed={seed}", *settings]))


def by_hops(outcome: Outcome) -> dict[int, list[tuple[float, float]]]:
    """(true error, stated bound) [us] of each sample, by hops from the reference."""
    found: dict[int, list[tuple[float, float]]] = defaultdict(list)
    samples = [record for record in outcome.records if isinstance(record, ClockSampled)]
    for sample, error in errors_ns(samples):
        if sample.t_ns >= BEGIN_S * S and sample.bound_ns >= 0 and sample.reference:
            found[sample.hops].append((abs(error) / US, sample.bound_ns / US))
    return found


def told(name: str, summaries: Sequence[dict[str, Any]]) -> list[str]:
    """One row of the second table; the worst of all seeds."""
    pdr = ", ".join(f"{summary['pdr']:.4f}" for summary in summaries)
    clocks = [summary["clock"] for summary in summaries if summary["clock"]]
    worst = max((clock["error_us"]["max"] for clock in clocks), default=0.0)
    bounds = [summary["bound"] for summary in summaries if summary["bound"]]
    bound = max((b["worst_ms"] for b in bounds), default=None)
    seen = max((b["observed_max_ms"] for b in bounds), default=None)
    stated = "-" if bound is None else f"{seen:.0f} / {bound:.0f}"
    violations = sum(b["violations"] for b in bounds)
    synced = [clock["synced_after_s"] for clock in clocks]
    after = "-" if not synced or None in synced else f"{max(synced):.0f}"
    return [name, f"{worst:.1f}", after, pdr, stated, f"{violations} of {len(bounds)}"]


class Measured(NamedTuple):
    """Two tables, heads first."""

    errors: list[list[str]]
    cases: list[list[str]]


def measured(seeds: int) -> Measured:
    """All cases, with this many seeds each."""
    errors: dict[int, list[tuple[float, float]]] = defaultdict(list)
    cases = [
        ["clocks", "greatest error [us]", "synced after [s]", "PDR per seed", "worst delay / bound [ms]", "violations"]
    ]
    for name, settings in CASES:
        summaries = []
        for seed in range(1, seeds + 1):
            outcome = outcome_of(seed, settings)
            if name.startswith("beacons, 20 ppm"):
                for hops, found in by_hops(outcome).items():
                    errors[hops] += found
            summaries.append(finish(outcome, out=None))
        cases.append(told(name, summaries))
    rows = [["hops", "samples", "error p50, p99, max [us]", "greatest stated bound [us]", "beyond it"]]
    for hops, found in sorted(errors.items()):
        values = sorted(error for error, _ in found)
        p99 = values[min(len(values) - 1, len(values) * 99 // 100)]
        rows.append(
            [
                f"{hops}",
                f"{len(values)}",
                f"{statistics.median(values):.2f}, {p99:.2f}, {values[-1]:.2f}",
                f"{max(bound for _, bound in found):.1f}",
                f"{sum(error > bound for error, bound in found)}",
            ]
        )
    return Measured(rows, cases)


def main(seeds: int) -> None:
    for table in measured(seeds):
        for cells in table:
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
