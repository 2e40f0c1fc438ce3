"""Every rule of `clusters.relay` in whole swarms: `python tests/benchmarks/relay_rules.py [SECONDS]`.

44 nodes send 1024 B a second each to everyone, every node a head; seeds 1 to 3. `grid`: 9 x 5, 200 m apart, range
250 m; `dense`: 45 nodes at random on a disc of 250 m. Flooding period 1 s. First the superframes that claims need, in
the running protocol, for more nodes at the density of the grid, with no traffic.
"""

import statistics
import sys
from collections import Counter
from collections.abc import Mapping
from typing import Any

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

RULES = {
    "all": [], "gossip": ["clusters.gossip_degree=6"], "counter": ["clusters.counter=2"], "heads": [], "cds": [],
    "mpr": [], "scheduled": [], "claimed": [], "claimed, 10 slots": ["clusters.slots=10"],
}  # fmt: skip
SWARMS = {"grid": [], "dense": ["nodes.layout=disc", "nodes.radius_m=250"]}
FEWER = ["clusters.count=8"]
"""With every node a head `heads` is `all`."""


def measured(rule: str, swarm: str, *, seconds: int) -> list[dict[str, Any]]:
    """The summaries of seeds 1 to 3; none for a rule that is not measured in this swarm."""
    if rule == "claimed, 10 slots" and swarm == "dense":
        return []
    chosen = [
        f"clusters.relay={rule.split(',')[0]}", "clusters.flooding_period_s=1", f"duration_s={seconds}",
        *SWARMS[swarm], *RULES[rule], *(FEWER if rule == "heads" else []),
    ]  # fmt: skip
    return [finish(simulate(catalog.find("clusters", [*chosen, f"seed={seed}"])), out=None) for seed in (1, 2, 3)]


def claiming(layout: str, count: int) -> list[Mapping[str, Any]]:
    """What nodes report after 20 s in which they claimed slots and sent no data."""
    side = ["nodes.layout=disc", f"nodes.radius_m={112.8 * count**0.5:.0f}"] if layout == "disc" else []
    keys = [
        "clusters.relay=claimed", f"nodes.count={count}", f"clusters.count={count - 1}", "duration_s=20",
        "traffic.arrivals=none", "traffic.sources=all", "clusters.guard_ms=0", *side,
    ]  # fmt: skip
    outcome = simulate(catalog.find("clusters", keys))
    return [report for report in outcome.reports.values() if report.get("kind") == "agent"]


def relays(seconds: int) -> None:
    print("swarm  rule               PDR     frames/packet  delay mean  p95     max [ms]")
    for swarm in SWARMS:
        for rule in RULES:
            found = measured(rule, swarm, seconds=seconds)
            if not found:
                continue
            pdr = " ".join(f"{s['pdr']:.4f}" for s in found)
            sent = statistics.mean(s["frames"]["sent"] / s["generated"] for s in found)
            delay = {k: statistics.mean(s["delay_ms"][k] for s in found) for k in ("mean", "p95", "max")}
            print(
                f"{swarm:6} {rule:18} {pdr} {sent:8.1f} {delay['mean']:12.0f} {delay['p95']:8.0f} {delay['max']:8.0f}",
                flush=True,
            )


def superframes() -> None:
    print("layout   UAVs  superframe (UAVs)   highest slot + 1  clashes settled after [s]  without a slot")
    for layout in ("grid", "disc"):
        for count in (45, 100, 200):
            nodes = claiming(layout, count)
            lengths = Counter(report["superframe"] for report in nodes)
            slots = [report["slot"] for report in nodes if report["slot"] is not None]
            last_s = max(report["claimed_ms"] or 0 for report in nodes) / 1000
            print(
                f"{layout:7} {count:5}  {dict(sorted(lengths.items()))}  {max(slots) + 1:8} {last_s:12.1f} "
                f"{count - len(slots):8}",
                flush=True,
            )


if __name__ == "__main__":
    superframes()
    relays(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
