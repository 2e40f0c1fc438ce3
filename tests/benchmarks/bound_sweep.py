"""The delay bound of scheduled floods against whole swarms: `bound_sweep.py [DELIVERIES [PROCESSES [MINUTES [SEED]]]]`.

Random connected swarms of 5 to 100 nodes over both channels, every node a head or some. Half are `calm`: at rest or
in formation, periodic traffic that `fanet plan` calls feasible. The others are `rough`: random arrivals, survivor
reports, positions with noise, random waypoints, fading and shadowing, and nodes whose process starts again in the
middle of the run. Every packet is held against the bound (b) that its origin stated for it, and against equation (4) of
the paper (a): one flooding period, as every node's slot just holds its packets of a period. A delivery is counted from
application to application.
"""

import math
import os
import random
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

from agents.clocked import make_uav
from agents.traffic import sources_of
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message
from fanet_mw.graph.topology import components, within_range
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.planner import Plan, plan
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import Record
from fanet_mw.units import MS, Enu, NodeId, S
from sim.results.bounds import against_bounds, delays_under_bound
from sim.results.packets import packets_of
from sim.run.outcome import Outcome
from sim.run.virtual import actors_of
from sim.world.mobility.layout import positions


class Result(NamedTuple):
    """One swarm."""

    seed: int
    kind: str
    nodes: int
    deliveries: int
    """Of packets that had a bound."""
    broken: int
    broken_paper: int
    wanted: int
    """Packets times targets, with a bound or without."""
    within: int
    stated_share: float
    tightness: float


class Restarting(Actor):
    """A UAV whose process is lost at an instant, with all that it knew, and starts again at once."""

    def __init__(self, uav: Actor, scenario: Scenario, node: NodeId, swarm: str, *, at_ns: int) -> None:
        super().__init__(uav.name, uav.subscriptions)
        self._uav, self._at_ns, self._again = uav, at_ns, False
        start = positions(scenario)[node - 1]
        self._make = lambda: make_uav(scenario, node, swarm, position=start)

    def start(self, now_ns: int) -> None:
        self._uav.outbox, self._uav.records = self.outbox, self.records
        self._uav.start(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        return self._uav.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        if not self._again and now_ns >= self._at_ns:
            self._again, self._uav = True, self._make()
            self.start(now_ns)
        self._uav.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        wake_ns = self._uav.next_wake_ns()
        return wake_ns if self._again or (wake_ns is not None and wake_ns < self._at_ns) else self._at_ns


def swarm(seed: int) -> tuple[str, Scenario, Sequence[tuple[int, int]]] | None:
    """A random scenario, its kind, and (node, instant) of each that starts again; None when this seed gives none."""
    pick = random.Random(seed)
    rough = seed % 2 == 1
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
        "radio": {
            "lead_ms": pick.choice([0, 0, 5, 20, 40]), "handover_ms": pick.choice([0, 0, 5, 20]),
            "cw_min": pick.choice([1, 7, 31]),
        },
        "mobility": {"model": pick.choice(["static", "formation"])},
    }  # fmt: skip
    tree["radio"]["channel"] = pick.choice(["range", "log_distance"])
    restarts: list[tuple[int, int]] = []
    if rough:
        tree["traffic"]["arrivals"] = pick.choice(["cbr", "poisson", "poisson"])
        tree["mobility"]["model"] = pick.choice(["static", "formation", "random_waypoint"])
        tree["world"] = {"gps_sigma_m": pick.choice([0.0, 1.5, 5.0, 15.0])}
        tree["mission"] = {
            "survivors": pick.choice([0, 10, 40]), "report_interval_s": pick.choice([0.5, 2.0, 5.0]),
            "reports_to_approach": count,
        }  # fmt: skip
        if tree["radio"]["channel"] == "log_distance":
            tree["radio"]["shadowing_db"] = pick.choice([0.0, 4.0])
            tree["radio"]["fading"] = pick.choice(["none", "rician", "nakagami"])
        restarts = [(pick.randint(2, count), pick.randint(20, 60) * S) for _ in range(pick.randint(0, 2))]
    scenario = config.build(tree)
    at = {NodeId(n): place for n, place in zip(scenario.node_ids, positions(scenario), strict=True)}
    rounded = {n: Enu(float(round(p.east)), float(round(p.north)), float(round(p.up))) for n, p in at.items()}
    if len(components(within_range(rounded, range_m=240))) > 1:
        return None
    if rough:
        return "rough", scenario, restarts
    found = plan(scenario, rounded, sources=[NodeId(n) for n in sources_of(scenario)])
    return ("calm", scenario, ()) if isinstance(found, Plan) and found.feasible else None


def flown(scenario: Scenario, restarts: Sequence[tuple[int, int]]) -> Outcome:
    actors = actors_of(scenario, scenario.name)
    for node, at_ns in restarts:
        actors[node + 1] = Restarting(actors[node + 1], scenario, NodeId(node), scenario.name, at_ns=at_ns)
    records: list[Record] = []
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    return Outcome(scenario=scenario, mode="virtual", wall_s=0.0, records=records, reports={})


def measure(seed: int) -> Result | None:
    drawn = swarm(seed)
    if drawn is None:
        return None
    kind, scenario, restarts = drawn
    found = packets_of(flown(scenario, restarts))
    bound = against_bounds(found)
    if not bound or not bound["deliveries"]:
        return None
    wanted = sum(app.wanted for app in found.values())
    return Result(
        seed=seed,
        kind=kind,
        nodes=scenario.nodes.count,
        deliveries=bound["deliveries"],
        broken=bound["violations"],
        broken_paper=sum(
            int((delays_under_bound(app)[0] > scenario.clusters.flooding_period_s * S).sum()) for app in found.values()
        ),
        wanted=wanted,
        within=bound["deliveries"] - bound["violations"],
        stated_share=bound["stated_share"],
        tightness=min(c["worst_ms"] / max(c["observed_max_ms"], 1 / MS) for c in bound["classes"].values()),
    )


def main(wanted: int, processes: int, minutes: float, seed: int) -> None:
    found: list[Result] = []
    total, end_s = 0, time.monotonic() + 60 * minutes
    with ProcessPoolExecutor(processes) as pool:
        while total < wanted and time.monotonic() < end_s:
            results = [result for result in pool.map(measure, range(seed, seed + 2 * processes)) if result]
            seed += 2 * processes
            found += results
            total += sum(result.deliveries for result in results)
            for result in results:
                print(*result, flush=True)
    for kind in ("calm", "rough"):
        if some := [result for result in found if result.kind == kind]:
            told(kind, some)


def told(kind: str, found: Sequence[Result]) -> None:
    total, sizes = sum(result.deliveries for result in found), [result.nodes for result in found]
    wanted, within = sum(result.wanted for result in found), sum(result.within for result in found)
    paper, hit = sum(result.broken_paper for result in found), sum(result.broken_paper > 0 for result in found)
    print(f"{kind}: {len(found)} swarms of {min(sizes)} to {max(sizes)} nodes, {total} deliveries under a bound")
    print(f"  bound (b) broken {sum(result.broken for result in found)} times")
    print(f"  within their bound: {within} of {wanted} packets x targets ({100 * within / wanted:.2f} %)")
    print(f"  packets with a bound: {100 * sum(r.stated_share for r in found) / len(found):.1f} %, mean of the swarms")
    print(f"  equation (4) broken {paper} times ({100 * paper / total:.2f} %), in {hit} swarms")
    ordered = sorted(r.tightness for r in found)
    print(f"  bound / worst observed: median {ordered[len(ordered) // 2]:.3f}, worst {ordered[-1]:.3f}")
    edges = [1.0, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, math.inf]
    for low, high in pairwise(edges):
        count = sum(low <= value < high for value in ordered)
        print(f"    {low:4.2f} to {high:4.2f}  {count:4}  {'#' * round(60 * count / len(ordered))}")


if __name__ == "__main__":
    given = [float(argument) for argument in sys.argv[1:]]
    main(
        int(given[0]) if given else 10_000_000,
        int(given[1]) if given[1:] else os.cpu_count() or 1,
        given[2] if given[2:] else 1e6,
        int(given[3]) if given[3:] else 0,
    )
