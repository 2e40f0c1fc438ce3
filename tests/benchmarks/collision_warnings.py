"""What collision warnings are worth, and how they fare under load.

`python tests/benchmarks/collision_warnings.py [SEEDS]`

Scenario `crossing`, 120 s: p95 / greatest delay over all deliveries to everyone (PDR) of each class; the share of the
warnings that reached the UAV they are about, and how late; how often two were nearer than 15 m; the least distance.
"""

import sys
from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

CASES: tuple[tuple[str, ...], ...] = (
    ("mission.collision_horizon_s=0",),
    (),
    ("traffic.interval_s=1",),
    ("routing.protocol=clustered", "clusters.relay=counter", "clusters.repair_s=10"),
)


def delays(part: dict[str, Any]) -> str:
    """p95 / max [ms] and PDR of a class."""
    delay = part["delay_ms"]
    if delay["p95"] is None:
        return "-"
    return f"{delay['p95']:.0f} / {delay['max']:.0f} ({part['pdr']:.3f})"


def rows(seeds: int) -> list[list[str]]:
    """The table of docs/explanation/protocol.md, header first."""
    found = [
        ["changed", "warning [ms]", "report [ms]", "bulk [ms]", "the other: share, p95 [ms]", "losses", "least [m]"]
    ]
    for case in CASES:
        for seed in range(1, seeds + 1):
            summary = finish(simulate(catalog.find("crossing", [*case, f"seed={seed}"])), out=None)
            apart = summary["separation"]
            late = apart["to_the_other_ms"]
            other = f"{apart['reached_the_other']:.3f}, {late['p95']:.0f}" if late else "-"
            found.append(
                [
                    ", ".join(f"`{key}`" for key in case) or "nothing",
                    delays(summary["warnings"]),
                    delays(summary["reports"]),
                    delays(summary),
                    other,
                    f"{apart['losses']}",
                    f"{apart['least_m']:.1f}",
                ]
            )
    return found


if __name__ == "__main__":
    for row in rows(int(sys.argv[1]) if len(sys.argv) > 1 else 3):
        print("|", " | ".join(row), "|", flush=True)
