"""How missions go, over seeds in virtual time: `python tests/benchmarks/mission_seeds.py [--set KEY=VALUE] SEED ...`.

One line per seed as it ends, then the shares over all seeds: of seeds in which everyone was confirmed, of the time in
which the swarm was connected, and the median instant at which 95 % of the area had been covered. `--scenario NAME` runs
another scenario than `rescue`; `--json FILE` keeps the rows. Speed is by CPU time: other work does not count.
"""

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios.catalog import find

HEAD = "seed confirmed  last s error m  covered  95 % s connected contacts x real"


def row(scenario: str, settings: list[str], seed: int) -> dict[str, Any]:
    """The mission of one run."""
    began = time.process_time()
    outcome = simulate(find(scenario, [*settings, f"seed={seed}"]))
    summary = finish(outcome, out=None)
    mission = summary["mission"]
    return {"seed": seed, "speed": summary["simulated_s"] / (time.process_time() - began), **mission}


def line(found: dict[str, Any]) -> str:
    last_s = max(found["time_to_confirm_s"], default=0.0)
    error_m, covered_s = found["confirmed_error_m"], found["covered_95_s"]
    return (
        f"{found['seed']:>4} {found['confirmed']:>4} of {found['survivors']:<2} {last_s:>7.0f} "
        f"{'-' if error_m is None else format(error_m, '.1f'):>7} {found['coverage']:>8.1%} "
        f"{'-' if covered_s is None else format(covered_s, '.0f'):>7} {found['connected']:>9.1%} "
        f"{found['collisions']:>8} {found['speed']:>6.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    rows = []
    print(HEAD)
    for seed in asked.seeds:
        rows.append(row(asked.scenario, asked.settings, seed))
        print(line(rows[-1]), flush=True)
        if asked.json is not None:
            asked.json.write_text(json.dumps(rows))
    everyone = sum(found["confirmed"] == found["survivors"] for found in rows)
    covered = [found["covered_95_s"] for found in rows if found["covered_95_s"] is not None]
    print(
        f"everyone confirmed in {everyone} of {len(rows)} seeds; connected at least "
        f"{min(found['connected'] for found in rows):.1%} of the time; 95 % covered after "
        f"{statistics.median(covered) if covered else float('nan'):.0f} s at the median ({len(covered)} seeds)"
    )


if __name__ == "__main__":
    main()
