"""The delay bound of scheduled floods against whole swarms: `bound_sweep.py FILE [DELIVERIES [MINUTES [heard]]]`.

Random connected swarms of 5 to 100 nodes over both channels, every node a head or some, at a load that `fanet plan`
calls feasible, for half of them the greatest that it does. Half are `calm`: at rest or in formation, periodic traffic.
The others are `rough`: random arrivals, survivor reports, positions with noise, random waypoints, fading and
shadowing, and nodes whose process starts again in the middle of the run. Links are measured in one swarm of four with
fading or shadowing: no bound is stated there, but a likely delay, which is judged as well.

Every packet is held against the bound (b) that its origin stated for it, and against equation (4) of the paper (a): one
flooding period, as every node's slot just holds its packets of a period. A delivery is counted from application to
application. A line per swarm is appended to the file; what it holds already is not flown again.

With `heard`, nodes are told an interval of the traffic four times as long as the true one, the true one, or a quarter
of it, and make their timetables for what they hear; swarms fly shorter, and no node starts again.
"""

import json
import math
import random
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import count as counted
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

from agents.applications.traffic import Load, sources_of
from agents.clock.clocked_uav import make_uav
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message
from fanet_mw.errors import DropReason
from fanet_mw.graph.topology import components, within_range
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import Dropped
from fanet_mw.units import Enu, NodeId, S
from sim.planner.plan import plan
from sim.planner.scenario_plan import ScenarioPlan
from sim.records.record_kinds import records_of
from sim.results.bounds import Column, deliveries_under_bound, likely
from sim.results.outcome import Outcome
from sim.results.packets import packets_of
from sim.run.virtual import actors_of
from sim.world.environment.layout import positions
from tests.benchmarks.told_swarm import run_of, run_with

_INTERVALS_S: Final = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
_MOST: Final = 400_000
"""Deliveries of one swarm, about; so long it flies."""


_TOLD: Final = (0.25, 1.0, 4.0)
"""The intervals that nodes are told, as multiples of the true one."""
_BRIEF_S: Final = 60
"""The longest flight of a swarm whose loads are heard."""
_MOST_PER_S: Final = 250
"""Packets per second, of all nodes together: more never fit, and take long to plan."""


class Class(NamedTuple):
    """The packets of one class of one swarm that had a bound."""

    deliveries: int
    broken: int
    tightness: float
    """The least (bound / delay) of a delivery, lead and handover in both."""


class Result(NamedTuple):
    """One swarm; None of `kind`: its seed gives no connected swarm with a feasible load."""

    seed: int
    kind: str | None
    classes: Mapping[str, Class]
    nodes: int = 0
    deliveries: int = 0
    """Of packets that had a bound."""
    broken: int = 0
    broken_paper: int = 0
    wanted: int = 0
    """Packets times targets, with a bound or without."""
    stated: int = 0
    """The same of the packets that had a bound."""
    likely: int = 0
    """The same of the packets that had a likely delay instead."""
    within_likely: int = 0
    given_up: int = 0
    """Packets that had a bound, and were dropped at their origin because they could no longer keep it."""
    cpu_s: float = 0.0


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


class Drawn(NamedTuple):
    """A random scenario."""

    kind: str
    scenario: Scenario
    restarts: Sequence[tuple[int, int]]
    """(node, instant) of each that starts again."""


def swarm(seed: int) -> Drawn | None:
    """None when this seed gives none."""
    pick = random.Random(seed)
    rough = seed % 2 == 1
    count = pick.randint(5, 100)
    tree: dict[str, Any] = {
        "name": "bound", "seed": seed, "warmup_s": 16, "drain_s": 4,
        "nodes": {
            "count": count, "layout": "disc", "radius_m": pick.uniform(40, 75) * math.sqrt(count), "telemetry_hz": 0,
        },
        "traffic": {"payload_bytes": pick.choice([64, 256, 512, 1024])},
        "clusters": {
            "count": pick.choice([count - 1, max(1, count // pick.randint(2, 12))]),
            "relay": "scheduled", "guard_ms": 0, "link_m": 240,
            "flooding_period_s": pick.choice([0.5, 1.0, 2.0, 4.0]),
        },
        "radio": {
            "channel": pick.choice(["range", "log_distance"]), "cw_min": pick.choice([1, 7, 31]),
            "lead_ms": pick.choice([0, 0, 5, 20, 40]), "handover_ms": pick.choice([0, 0, 5, 20]),
        },
        "mobility": {"model": pick.choice(["static", "formation"])},
    }  # fmt: skip
    possible_s = [interval_s for interval_s in _INTERVALS_S if count <= _MOST_PER_S * interval_s]
    intervals_s = possible_s if pick.random() < 0.5 else [pick.choice(possible_s)]
    interval_s = next((interval_s for interval_s in intervals_s if feasible(tree, interval_s)), None)
    if interval_s is None:
        return None
    tree["traffic"]["interval_s"] = interval_s
    tree["duration_s"] = 20 + max(20, min(180, int(_MOST * interval_s / count / count)))
    if not rough:
        return Drawn("calm", config.build(tree), ())
    tree["traffic"]["arrivals"] = pick.choice(["cbr", "poisson", "poisson"])
    tree["mobility"]["model"] = pick.choice(["static", "static", "formation", "formation", "random_waypoint"])
    tree["world"] = {"gps_sigma_m": pick.choice([0.0, 1.5, 5.0, 15.0])}
    tree["mission"] = {
        "survivors": pick.choice([0, 10, 40]), "report_interval_s": pick.choice([0.5, 2.0, 5.0]),
        "reports_to_approach": count + 1,
    }  # fmt: skip
    if tree["radio"]["channel"] == "log_distance":
        tree["radio"]["shadowing_db"] = pick.choice([0.0, 4.0])
        tree["radio"]["fading"] = pick.choice(["none", "rician", "nakagami"])
        tree["clusters"]["links"] = "places" if count > 40 else pick.choice(["places", "places", "places", "auto"])
    last_s = tree["duration_s"] - 10
    restarts = [(pick.randint(2, count), pick.randint(20, last_s) * S) for _ in range(pick.randint(0, 2))]
    return Drawn("rough", config.build(tree), restarts)


def feasible(tree: dict[str, Any], interval_s: float) -> bool:
    """Whether all these nodes hear of each other, and their load fits."""
    scenario = config.build({**tree, "traffic": {**tree["traffic"], "interval_s": interval_s}})
    at = {NodeId(n): place for n, place in zip(scenario.node_ids, positions(scenario), strict=True)}
    rounded = {n: Enu(float(round(p.east)), float(round(p.north)), float(round(p.up))) for n, p in at.items()}
    if len(components(within_range(rounded, range_m=240))) > 1:
        return False
    found = plan(scenario, rounded, sources=[NodeId(n) for n in sources_of(scenario)])
    return isinstance(found, ScenarioPlan) and found.feasible


def flown(scenario: Scenario, restarts: Sequence[tuple[int, int]]) -> Outcome:
    actors = actors_of(scenario, scenario.name)
    for node, at_ns in restarts:
        actors[node + 1] = Restarting(actors[node + 1], scenario, NodeId(node), scenario.name, at_ns=at_ns)
    return run_of(scenario, actors)


def flown_by_ear(true: Scenario) -> Outcome:
    """A run in which nodes hear what is sent, and are told another interval than the true one."""
    factor = random.Random(f"{true.seed}/told").choice(_TOLD)
    duration_s = min(true.duration_s, _BRIEF_S)
    first = true.traffic.model_copy(update={"name": "first"})
    scenario = true.model_copy(update={"traffic": first, "duration_s": duration_s})
    silent = true.traffic.model_copy(update={"interval_s": factor * first.interval_s, "start_s": 2 * duration_s})
    told = scenario.model_copy(
        update={"traffic": silent, "clusters": true.clusters.model_copy(update={"load": "heard"})}
    )
    starts = positions(scenario)
    uavs = [
        make_uav(told, node, scenario.name, position=start, applications=[Load(scenario, node, "first")])
        for node, start in zip(map(NodeId, scenario.node_ids), starts, strict=True)
    ]
    return run_with(scenario, uavs)


def measure(seed: int, *, heard: bool = False) -> Result:
    begun_s = time.process_time()
    drawn = swarm(seed)
    if drawn is None:
        return Result(seed, None, {}, cpu_s=time.process_time() - begun_s)
    kind, scenario, restarts = drawn
    outcome = flown_by_ear(scenario) if heard else flown(scenario, restarts)
    scenario = outcome.scenario
    found = packets_of(outcome)
    classes = {name: class_of(*deliveries_under_bound(app)[1:]) for name, app in found.items()}
    classes = {name: of for name, of in classes.items() if of.deliveries}
    period_ns = scenario.clusters.flooding_period_s * S
    targets = scenario.nodes.count - 1
    sent = [packet for app in found.values() for packet in app.sent.values()]
    with_likely = targets * sum(packet.likely is not None for packet in sent)
    return Result(
        seed=seed,
        kind=kind,
        nodes=scenario.nodes.count,
        deliveries=sum(of.deliveries for of in classes.values()),
        broken=sum(of.broken for of in classes.values()),
        broken_paper=sum(int((deliveries_under_bound(app)[1] > period_ns).sum()) for app in found.values()),
        wanted=sum(app.wanted for app in found.values()),
        stated=targets * sum(packet.bound_ns is not None for packet in sent),
        likely=with_likely,
        given_up=sum(record.reason is DropReason.BOUND_LOST for record in records_of(outcome.records, Dropped)),
        within_likely=round(likely(found)["within_share"] * with_likely) if with_likely else 0,
        cpu_s=time.process_time() - begun_s,
        classes=classes,
    )


def class_of(delays_ns: Column, bounds_ns: Column) -> Class:
    broken = int((delays_ns > bounds_ns).sum())
    return Class(len(delays_ns), broken, float((bounds_ns / delays_ns).min(initial=math.inf)))


def main(kept: Path, wanted: int, minutes: float, *, heard: bool) -> None:
    found = read(kept)
    end_s = time.monotonic() + 60 * minutes
    for seed in counted(1 + max((result.seed for result in found), default=-1)):
        if sum(result.deliveries for result in found) >= wanted or time.monotonic() > end_s:
            break
        found.append(measure(seed, heard=heard))
        with kept.open("a") as file:
            file.write(json.dumps(found[-1]._asdict()) + "\n")
    print(f"{len(found)} seeds, {sum(result.cpu_s for result in found):.0f} s of CPU")
    for kind in ("calm", "rough"):
        if some := [result for result in found if result.kind == kind and result.wanted]:
            told(kind, some)


def read(kept: Path) -> list[Result]:
    lines = kept.read_text().splitlines() if kept.exists() else []
    found = [Result(**json.loads(line)) for line in lines]
    return [r._replace(classes={name: Class(*of) for name, of in r.classes.items()}) for r in found]


def told(kind: str, found: Sequence[Result]) -> None:
    total, sizes = sum(result.deliveries for result in found), [result.nodes for result in found]
    wanted, stated = sum(result.wanted for result in found), sum(result.stated for result in found)
    within = total - sum(result.broken for result in found)
    paper, hit = sum(result.broken_paper for result in found), sum(result.broken_paper > 0 for result in found)
    print(f"{kind}: {len(found)} swarms of {min(sizes)} to {max(sizes)} nodes, {total} deliveries under a bound")
    print(f"  bound (b) broken {sum(result.broken for result in found)} times")
    print(f"  given up by their origin, because they would have come late: {sum(r.given_up for r in found)} packets")
    print(f"  within their bound: {within} of {wanted} packets x targets ({100 * within / wanted:.2f} %)")
    print(f"  of packets with a bound: {within} of {stated} ({100 * within / max(1, stated):.2f} %)")
    likely, within_likely = sum(result.likely for result in found), sum(result.within_likely for result in found)
    if likely:
        print(f"  of packets with a likely delay: {within_likely} of {likely} ({100 * within_likely / likely:.2f} %)")
    print(f"  equation (4) broken {paper} times ({100 * paper / max(1, total):.2f} %), in {hit} swarms")
    for name in sorted({name for result in found for name in result.classes}):
        tightness(name, [result.classes[name] for result in found if name in result.classes])


def tightness(name: str, found: Sequence[Class]) -> None:
    ordered, total = sorted(of.tightness for of in found), sum(of.deliveries for of in found)
    print(f"  {name}: {total} deliveries, {sum(of.broken for of in found)} broken; bound / delay, least of a swarm:")
    print(f"    median {ordered[len(ordered) // 2]:.3f}, least {ordered[0]:.3f}")
    edges = [0.0, 1.0, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, math.inf]
    for low, high in pairwise(edges):
        count = sum(low <= value < high for value in ordered)
        print(f"    {low:4.2f} to {high:4.2f}  {count:4}  {'#' * round(60 * count / len(ordered))}")


if __name__ == "__main__":
    kept, *limits = sys.argv[1:]
    given = [float(limit) for limit in limits[:2]]
    main(
        Path(kept),
        int(given[0]) if given else 10_000_000,
        given[1] if given[1:] else 1e6,
        heard=limits[2:] == ["heard"],
    )
