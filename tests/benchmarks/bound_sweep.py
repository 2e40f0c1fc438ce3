"""The delay bound of scheduled floods against whole swarms: `bound_sweep.py [DELIVERIES [PROCESSES [MINUTES]]]`.

Random swarms of 5 to 100 nodes, connected, over both channels, at rest or flying in formation, every node a head or
some, loads that `fanet plan` calls feasible. Every delivery is held against the bound (b) that its origin computed in
flight, and
against equation (4) of the paper (a): one flooding period, as every node's slot just holds its packets of a period.
"""

import math
import os
import random
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

from agents.traffic import sources_of
from fanet_mw import config
from fanet_mw.protocol.planner import Plan, plan
from fanet_mw.protocol.topology import components, within_range
from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import MS, Enu, NodeId, S
from sim.layout import positions
from sim.run import simulate


class Result(NamedTuple):
    """One swarm."""

    seed: int
    nodes: int
    deliveries: int
    missing: int
    broken: int
    broken_paper: int
    tightness: float


def swarm(seed: int) -> config.Scenario | None:
    """A random feasible scenario; None when this seed gives none."""
    pick = random.Random(seed)
    count = pick.randint(5, 100)
    tree: dict[str, Any] = {
        "name": "bound", "seed": seed, "duration_s": 80, "warmup_s": 16, "drain_s": 4,
        "nodes": {
            "count": count, "layout": "disc", "radius_m": pick.uniform(60, 75) * math.sqrt(count), "telemetry_hz": 0,
        },
        "traffic": {"interval_s": pick.choice([0.5, 1.0, 2.0]), "payload_bytes": pick.choice([256, 512, 1024])},
        "clusters": {
            "count": pick.choice([count - 1, max(1, count // pick.randint(2, 12))]),
            "relay": "scheduled", "guard_ms": 0, "link_m": 240,
            "flooding_period_s": pick.choice([0.5, 1.0, 2.0, 4.0]),
        },
        "radio": {"lead_ms": pick.choice([0, 0, 5, 20, 40]), "cw_min": pick.choice([1, 7, 31])},
        "mobility": {"model": pick.choice(["static", "formation"])},
    }  # fmt: skip
    tree["radio"]["channel"] = pick.choice(["range", "log_distance"])
    scenario = config.build(tree)
    at = {NodeId(n): place for n, place in zip(scenario.node_ids, positions(scenario), strict=True)}
    rounded = {n: Enu(float(round(p.east)), float(round(p.north)), float(round(p.up))) for n, p in at.items()}
    if len(components(within_range(rounded, range_m=240))) > 1:
        return None
    found = plan(scenario, rounded, sources=[NodeId(n) for n in sources_of(scenario)])
    return scenario if isinstance(found, Plan) and found.feasible else None


def measure(seed: int) -> Result | None:
    scenario = swarm(seed)
    if scenario is None:
        return None
    outcome = simulate(scenario)
    bounds = {
        r["node"]: (r["bound_from_ms"] * MS, r["bound_ms"] * MS) for r in outcome.reports.values() if r.get("bound_ms")
    }
    start_ns, end_ns = scenario.traffic_window_ns
    counted = {
        (r.node, r.seq)
        for r in outcome.records
        if isinstance(r, Generated)
        and r.app == "traffic"
        and r.node in bounds
        and max(start_ns, bounds[r.node][0]) <= r.t_ns < end_ns
    }
    delays = [
        (r.origin, r.delay_ns) for r in outcome.records if isinstance(r, Delivered) and (r.origin, r.seq) in counted
    ]
    if not delays:
        return None
    return Result(
        seed=seed,
        nodes=scenario.nodes.count,
        deliveries=len(delays),
        missing=len(counted) * (scenario.nodes.count - 1) - len(delays),
        broken=sum(delay_ns > bounds[origin][1] for origin, delay_ns in delays),
        broken_paper=sum(delay_ns > scenario.clusters.flooding_period_s * S for _, delay_ns in delays),
        tightness=max(bound_ns for _, bound_ns in bounds.values()) / max(delay_ns for _, delay_ns in delays),
    )


def main(wanted: int, processes: int, minutes: float) -> None:
    found: list[Result] = []
    total, seed, end_s = 0, 0, time.monotonic() + 60 * minutes
    with ProcessPoolExecutor(processes) as pool:
        while total < wanted and time.monotonic() < end_s:
            results = [result for result in pool.map(measure, range(seed, seed + processes)) if result]
            seed += processes
            found += results
            total += sum(result.deliveries for result in results)
            for result in results:
                print(*result, flush=True)
    sizes = [result.nodes for result in found]
    missing = sum(result.missing for result in found)
    paper, hit = sum(result.broken_paper for result in found), sum(result.broken_paper > 0 for result in found)
    print(f"{len(found)} swarms of {min(sizes)} to {max(sizes)} nodes, {total} deliveries")
    print(f"bound (b) broken {sum(result.broken for result in found)} times")
    print(f"never arrived: {missing} ({100 * missing / total:.4f} %)")
    print(f"equation (4) broken {paper} times ({100 * paper / total:.2f} %), in {hit} swarms")
    ordered = sorted(r.tightness for r in found)
    print(f"bound / worst observed: median {ordered[len(ordered) // 2]:.3f}, worst {ordered[-1]:.3f}")
    edges = [1.0, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, math.inf]
    for low, high in pairwise(edges):
        count = sum(low <= value < high for value in ordered)
        print(f"  {low:4.2f} to {high:4.2f}  {count:4}  {'#' * round(60 * count / len(ordered))}")


if __name__ == "__main__":
    given = [float(argument) for argument in sys.argv[1:]]
    main(
        int(given[0]) if given else 10_000_000, int(given[1]) if given[1:] else os.cpu_count() or 1, *given[2:] or [1e6]
    )
