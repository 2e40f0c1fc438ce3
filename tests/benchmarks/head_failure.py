"""How long a cluster is cut off when its head dies: `python tests/benchmarks/head_failure.py [RUNS]`.

The 9 x 5 grid in 4 clusters, flooding period 1 s, hellos every 1 s, 256 B every 1 s from everyone, no repair. At 15 s
the radio of the largest cluster's head falls silent for good. For each of its members: the time from then until a
packet that it generated after that reaches a node of another cluster.

Stated bound: a route is given up after 4 silent hello intervals at the latest (sooner when a unicast to the dead head
fails), a packet that is then generated waits for one flooding period and its flood: 4 + 1 + 1 + 1 s.
"""

import statistics
import sys
from collections import Counter

from fanet_mw import config
from fanet_mw.trace import Delivered, Generated, RoleChanged
from fanet_mw.units import S
from sim.outcome import Outcome
from sim.run import simulate

KILLED_S = 15
BOUND_S = 7.0


def scenario(seed: int, victim: int | None) -> config.Scenario:
    tree = {
        "name": "head-failure", "seed": seed, "duration_s": 28, "warmup_s": 8,
        "nodes": {"count": 45, "telemetry_hz": 0},
        "clusters": {"count": 4, "flooding_period_s": 1.0, "relay": "counter", "counter": 2},
        "traffic": {"payload_bytes": 256}, "radio": {"lead_ms": 0},
    }  # fmt: skip
    if victim is not None:
        tree["faults"] = [{"at_s": KILLED_S, "kind": "cut", "node": victim}]
    return config.build(tree)


def clusters(outcome: Outcome) -> dict[int, tuple[int, int]]:
    """Cluster and head of each node, before the failure."""
    return {
        r.node: (r.cluster, r.head) for r in outcome.records if isinstance(r, RoleChanged) and r.t_ns < KILLED_S * S
    }


def silences_s(seed: int) -> list[float]:
    """Seconds until each member of the cluster that lost its head is heard in another one again."""
    seen = clusters(simulate(scenario(seed, None)))
    (_, head), _ = Counter(seen.values()).most_common(1)[0]
    outcome = simulate(scenario(seed, head))
    of = clusters(outcome)
    members = [node for node, (_, theirs) in of.items() if theirs == head and node != head]
    born = {(r.node, r.seq) for r in outcome.records if isinstance(r, Generated) and r.t_ns >= KILLED_S * S}
    first: dict[int, int] = {}
    for r in outcome.records:
        if isinstance(r, Delivered) and (r.origin, r.seq) in born and of.get(r.node) != of.get(r.origin):
            first[r.origin] = min(r.t_ns, first.get(r.origin, r.t_ns))
    return [(first[node] / S - KILLED_S) if node in first else float("inf") for node in members]


def main(runs: int) -> None:
    found = [silence for seed in range(1, runs + 1) for silence in silences_s(seed)]
    late = sum(silence > BOUND_S for silence in found)
    quantiles = statistics.quantiles([min(silence, 99.0) for silence in found], n=100)
    print(f"{runs} runs, {len(found)} members")
    print(f"median {quantiles[49]:.2f} s, p99 {quantiles[98]:.2f} s, worst {max(found):.2f} s")
    print(f"bound {BOUND_S:g} s: {late} beyond it")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
