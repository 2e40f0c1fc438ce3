"""What new clusters are worth to a swarm that moves: `python tests/benchmarks/moving_swarm.py [SEEDS]`.

25 nodes on a grid 160 m apart (range 250 m), 256 B every 1 s from everyone, 90 s, no repair. They stay, fly in
formation, or on random waypoints (as fast as stated, within 800 x 800 m); the leader assigns once, or anew when it is
worth it. `counter`: 4 clusters, 1 s; `scheduled`: every node a head, 1 s, links taken to be 200 m in the timetable.

Printed per row: PDR (least of the seeds), epochs of the leader, share of the time that a radio is busy, control frames
per second and node (joins, announcements and their relays), CPU of a run. Node 1, the leader, sends nothing of its own.
"""

import statistics
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

from fanet_mw import wire
from fanet_mw.bus.messages import TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import config
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import actors_of

COUNT, DURATION_S = 25, 90


class Row(NamedTuple):
    pdr: float
    epochs: int
    busy: float
    control: float
    cpu_s: float


def scenario(relay: str, model: str, speed_m_s: float, *, reassign_s: float, seed: int) -> config.Scenario:
    scheduled = relay == "scheduled"
    tree = {
        "name": "moving", "seed": seed, "duration_s": DURATION_S, "warmup_s": 10, "drain_s": 5,
        "nodes": {"count": COUNT, "spacing_m": 160, "columns": 5, "telemetry_hz": 0},
        "clusters": {
            "count": COUNT - 1 if scheduled else 4, "flooding_period_s": 1.0, "relay": relay, "reassign_s": reassign_s,
            **({"guard_ms": 1, "link_m": 200} if scheduled else {"counter": 2, "repair_s": 0}),
        },
        "traffic": {"payload_bytes": 256, "sources": tuple(range(2, COUNT + 1))},
        "radio": {"lead_ms": 0, **({"cw_min": 7} if scheduled else {})},
        "mobility": {"model": model, "speed_m_s": speed_m_s},
        "world": {"area_m": 2500 if model == "formation" else 800},
    }  # fmt: skip
    return config.build(tree)


def measured(chosen: config.Scenario) -> Row:
    control = 0

    def hear(_: str, message: object) -> None:
        nonlocal control
        if isinstance(message, TxRequest):
            control += wire.decode_header(message.frame).kind in (wire.Kind.JOIN, wire.Kind.SCHEDULE)

    records: list = []
    actors = actors_of(chosen, chosen.name)
    host = VirtualHost(actors, on_records=records.extend, listeners=[(Topics(chosen.name).all_tx, hear)])
    began = time.process_time()
    host.start()
    host.run(chosen.duration_ns)
    host.stop()
    cpu_s = time.process_time() - began
    reports = {actor.name: actor.report() for actor in actors}
    outcome = Outcome(scenario=chosen, mode="virtual", wall_s=cpu_s, records=records, reports=reports)
    summary = finish(outcome, out=None)
    epochs = max(report["epoch"] for report in reports.values() if report.get("kind") == "agent")
    return Row(summary["pdr"], epochs, summary["air"]["busy"], control / DURATION_S / COUNT, cpu_s)


def cases() -> Iterator[tuple[str, str, float]]:
    for relay in ("counter", "scheduled"):
        yield relay, "static", 0.0
        yield relay, "formation", 7.5
        yield relay, "random_waypoint", 2.0
        yield relay, "random_waypoint", 5.0
        yield relay, "random_waypoint", 10.0


def main(seeds: int) -> None:
    print("relay      mobility         m/s  reassign  PDR    (least)  epochs  busy   control  CPU [s]")
    for relay, model, speed in cases():
        for reassign_s in (0.0, 10.0):
            rows = [
                measured(scenario(relay, model, speed, reassign_s=reassign_s, seed=seed))
                for seed in range(1, seeds + 1)
            ]
            mean = Row(*(statistics.mean(column) for column in zip(*rows, strict=True)))
            print(
                f"{relay:10} {model:16} {speed:4g} {reassign_s:8g}  {mean.pdr:.3f}  ({min(r.pdr for r in rows):.3f}) "
                f"{mean.epochs:7.1f}  {mean.busy:.3f}  {mean.control:7.2f}  {mean.cpu_s:6.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
