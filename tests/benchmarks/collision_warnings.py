"""What collision warnings are worth, and how they fare under load.

`python tests/benchmarks/collision_warnings.py [SEEDS]`

Scenario `crossing`, 120 s. Delays per class are over all deliveries to everyone; `other`: share of the warnings that
reached the UAV they are about, and how late. `losses`: pairs that came nearer than 15 m; `least`: the least distance.
"""

import sys
from typing import Any

from sim import catalog
from sim.results import finish
from sim.run import simulate

CASES: tuple[tuple[str, ...], ...] = (
    ("mission.collision_horizon_s=0",),
    (),
    ("traffic.interval_s=1",),
    ("clusters.relay=counter",),
    ("clusters.relay=all",),
)


def delays(part: dict[str, Any]) -> str:
    """p95 / max [ms] and PDR of a class."""
    delay = part["delay_ms"]
    if delay["p95"] is None:
        return "-"
    return f"{delay['p95']:.0f} / {delay['max']:.0f} ({part['pdr']:.3f})"


def main(seeds: int) -> None:
    print(
        "| changed | seed | foreseen, told | warning | report | bulk | other: share, p95 / max | losses | least | hit |"
    )
    for case in CASES:
        for seed in range(1, seeds + 1):
            found = finish(simulate(catalog.find("crossing", [*case, f"seed={seed}"])), out=None)
            apart = found["separation"]
            late = apart["to_the_other_ms"]
            other = f"{apart['reached_the_other']:.3f}, {late['p95']:.0f} / {late['max']:.0f}" if late else "-"
            print(
                f"| {' '.join(case) or '-'} | {seed} | {apart['foreseen']}, {apart['told']} "
                f"| {delays(found['warnings'])} | {delays(found['reports'])} | {delays(found)} "
                f"| {other} | {apart['losses']} | {apart['least_m']:.1f} | {found['mission']['collisions']} |",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
