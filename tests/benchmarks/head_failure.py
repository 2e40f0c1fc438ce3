"""How long a swarm is cut off when a head or the leader dies.

`python tests/benchmarks/head_failure.py [RUNS] [head|leader]`

The 9 x 5 grid in 4 clusters, flooding period 1 s, hellos every 1 s, 256 B every 1 s from everyone, no repair. At 15 s
a radio falls silent for good.

`head`: that of the largest cluster's head. For each of its members: the time from then until a packet that it generated
after that reaches a node of another cluster. Stated bound: the head is silent for 4 hello intervals at most when the
first in the succession takes over, a packet that is then generated waits for one flooding period and its flood:
4 + 1 + 1 + 1 s; sooner when a unicast to the dead head fails (2 intervals).

`leader`: that of node 1. The time until the last node obeys a schedule of the new leader. Stated bound: 4 s of silence,
counted from the last announcement, at most 3 s until one stands, 3.5 s for joins, 1 s for the schedule: 11.5 s; and the
PDR among the others meanwhile.
"""

import statistics
import sys
from collections import Counter

from fanet_mw.scenario import config
from fanet_mw.trace import Delivered, Generated, RoleChanged
from fanet_mw.units import S
from sim.results.outcome import Outcome
from sim.run.virtual import simulate

KILLED_S = 15
HEAD_BOUND_S = 7.0
LEADER_BOUND_S = 11.5
LEADER = 1


def scenario(seed: int, victim: int | None, *, duration_s: float = 28) -> config.Scenario:
    tree = {
        "name": "head-failure", "seed": seed, "duration_s": duration_s, "warmup_s": 8,
        "nodes": {"count": 45, "telemetry_hz": 0},
        "clusters": {"count": 4, "flooding_period_s": 1.0, "relay": "counter", "counter": 2, "repair_s": 0},
        "traffic": {"payload_bytes": 256}, "radio": {"lead_ms": 0},
    }  # fmt: skip
    if victim is not None:
        tree["faults"] = [{"at_s": KILLED_S, "kind": "cut", "node": victim}]
    return config.build(tree)


def clusters(outcome: Outcome) -> dict[int, tuple[int, int]]:
    """Cluster and head of each node, before the failure."""
    return {
        r.node: (r.cluster, r.head)
        for r in outcome.records
        if isinstance(r, RoleChanged) and r.t_ns < KILLED_S * S and r.head
    }


def silences_s(seed: int) -> list[float]:
    """Seconds until each member of the cluster that lost its head is heard in another one again."""
    seen = clusters(simulate(scenario(seed, None, duration_s=KILLED_S)))
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


def leaderless(seed: int) -> tuple[float, float, int]:
    """Seconds until all obey one new leader; PDR until then among those who live; who leads."""
    outcome = simulate(scenario(seed, LEADER, duration_s=32))
    reports = {r["node"]: r for r in outcome.reports.values() if r.get("kind") == "agent" and r["node"] != LEADER}
    leaders = Counter(r["leader"] for r in reports.values())
    leader, followers = leaders.most_common(1)[0]
    # The leader gives up its own role when it announces its first schedule; the others take theirs when they hear it.
    assigned = [r.t_ns for r in outcome.records if isinstance(r, RoleChanged) and r.node == leader and not r.head]
    agreed = followers == len(reports) and len({r["epoch"] for r in reports.values()}) == 1 and assigned
    until_ns = assigned[-1] if assigned else KILLED_S * S
    others = len(reports) - 1
    born = {
        (r.node, r.seq)
        for r in outcome.records
        if isinstance(r, Generated) and KILLED_S * S <= r.t_ns < until_ns and r.node != LEADER
    }
    heard = sum(1 for r in outcome.records if isinstance(r, Delivered) and (r.origin, r.seq) in born)
    return (until_ns / S - KILLED_S if agreed else float("inf")), heard / max(1, len(born) * others), leader


def told(found: list[float], bound_s: float) -> None:
    quantiles = statistics.quantiles([min(value, 99.0) for value in found], n=100)
    print(f"median {quantiles[49]:.2f} s, p99 {quantiles[98]:.2f} s, worst {max(found):.2f} s")
    print(f"bound {bound_s:g} s: {sum(value > bound_s for value in found)} beyond it")


def heads_die(runs: int) -> None:
    found = [silence for seed in range(1, runs + 1) for silence in silences_s(seed)]
    print(f"head: {runs} runs, {len(found)} members")
    told(found, HEAD_BOUND_S)


def leaders_die(runs: int) -> None:
    found = [leaderless(seed) for seed in range(1, runs + 1)]
    print(f"leader: {runs} runs; next leaders {Counter(leader for *_, leader in found).most_common()}")
    told([time_s for time_s, *_ in found], LEADER_BOUND_S)
    shares = [pdr for _, pdr, _ in found]
    print(f"PDR meanwhile: mean {statistics.mean(shares):.4f}, least {min(shares):.4f}")


if __name__ == "__main__":
    RUNS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    if "leader" not in sys.argv[2:]:
        heads_die(RUNS)
    if "head" not in sys.argv[2:]:
        leaders_die(RUNS)
