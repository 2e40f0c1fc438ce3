"""Every rule of `clusters.relay` in whole swarms: `python tests/benchmarks/relay_rules.py [SECONDS]`.

44 nodes send 1024 B a second each to everyone, every node a head; seeds 1 to 3. `grid`: 9 x 5, 200 m apart, range
250 m; `dense`: 45 nodes at random on a disc of 250 m. Flooding period 1 s, no repair.
"""

import statistics
import sys
from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

RULES = {"all": [], "counter": ["clusters.counter=2", "clusters.repair_s=0"], "scheduled": []}
SWARMS = {"grid": [], "dense": ["nodes.layout=disc", "nodes.radius_m=250"]}


def measured(rule: str, swarm: str, *, seconds: int) -> list[dict[str, Any]]:
    """The summaries of seeds 1 to 3."""
    chosen = [
        f"clusters.relay={rule}", "clusters.flooding_period_s=1", f"duration_s={seconds}",
        *SWARMS[swarm], *RULES[rule],
    ]  # fmt: skip
    return [finish(simulate(catalog.find("clusters", [*chosen, f"seed={seed}"])), out=None) for seed in (1, 2, 3)]


def relays(seconds: int) -> None:
    print("swarm  rule               PDR     frames/packet  delay mean  p95     max [ms]")
    for swarm in SWARMS:
        for rule in RULES:
            found = measured(rule, swarm, seconds=seconds)
            pdr = " ".join(f"{s['pdr']:.4f}" for s in found)
            sent = statistics.mean(s["frames"]["sent"] / s["generated"] for s in found)
            delay = {k: statistics.mean(s["delay_ms"][k] for s in found) for k in ("mean", "p95", "max")}
            print(
                f"{swarm:6} {rule:18} {pdr} {sent:8.1f} {delay['mean']:12.0f} {delay['p95']:8.0f} {delay['max']:8.0f}",
                flush=True,
            )


if __name__ == "__main__":
    relays(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
