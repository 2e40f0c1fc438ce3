"""Drives a `Medium` alone: stations, arrivals and a seed go in, its report comes out. No protocol, no host."""

import heapq
import math
from array import array
from collections.abc import Sequence
from typing import Any

from emulator.medium import Medium
from fanet_mw.bus.messages import Poses, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.rng import stream
from fanet_mw.scenario import config
from fanet_mw.units import BROADCAST, NodeId, seconds_to_ns

Place = tuple[float, float]


def disc(count: int, *, radius_m: float = 100.0, seed: int = 1) -> list[Place]:
    """Uniform in a disc."""
    rng = stream(seed, "disc")
    polar = [(radius_m * math.sqrt(rng.random()), 2 * math.pi * rng.random()) for _ in range(count)]
    return [(r * math.cos(angle), r * math.sin(angle)) for r, angle in polar]


def poses(places: Sequence[Place], *, t_ns: int = 0) -> Poses:
    states = array("d")
    for east, north in places:
        states.extend((east, north, 50.0, 0.0, 0.0, 0.0))
    return Poses(t_ns, array("H", range(1, len(places) + 1)), states)


def medium(count: int, *, duration_s: float = 10.0, seed: int = 1, warmup_s: float = 0.0, **radio: Any) -> Medium:
    tree = {
        "duration_s": duration_s,
        "warmup_s": warmup_s,
        "seed": seed,
        "nodes": {"count": count},
        "routing": {"protocol": "direct"},
        "radio": radio,
    }
    return Medium(config.build(tree), "v")


def contention(
    places: Sequence[Place],
    *,
    interval_s: float,
    sources: Sequence[int],
    arrivals: str = "cbr",
    dst: NodeId | None = BROADCAST,
    size: int = 1024,
    duration_s: float = 10.0,
    drain_s: float = 0.0,
    seed: int = 1,
    warmup_s: float = 0.0,
    **radio: Any,
) -> dict[str, Any]:
    """Every source (a node id) sends `size` bytes to `dst` at `interval_s`, in random phase or as a Poisson process.

    `dst` None: to the next node. The last request is `drain_s` before the end. Returns the report, with
    `pdr_generated`: unique receptions over requests times targets.
    """
    air = medium(len(places), duration_s=duration_s, seed=seed, warmup_s=warmup_s, **radio)
    topics = Topics("v")
    rng = stream(seed, "arrivals")
    air.start(0)
    air.receive(topics.pose, poses(places), 0)
    interval_ns = seconds_to_ns(interval_s)

    def gap_ns() -> int:
        return round(rng.expovariate(1.0) * interval_ns) if arrivals == "poisson" else interval_ns

    first = {n: gap_ns() if arrivals == "poisson" else int(rng.random() * interval_ns) for n in sources}
    due = [(t_ns, n) for n, t_ns in first.items()]
    heapq.heapify(due)
    seq = dict.fromkeys(sources, 0)
    topic_of = {n: topics.radio_tx(n) for n in sources}
    dst_of = {n: NodeId(n % len(places) + 1) if dst is None else dst for n in sources}
    frame = bytes(size)
    last_ns, end_ns = seconds_to_ns(duration_s - drain_s), seconds_to_ns(duration_s)
    receptions = 0
    while True:
        wake_ns = air.next_wake_ns()
        t_ns, node = due[0] if due[0][0] < last_ns else (end_ns, 0)
        if min(t_ns, end_ns if wake_ns is None else wake_ns) >= end_ns:
            break
        if wake_ns is not None and wake_ns <= t_ns:
            air.wake(wake_ns)
        else:
            heapq.heapreplace(due, (t_ns + gap_ns(), node))
            air.receive(topic_of[node], TxRequest(seq[node], t_ns, frame, dst_of[node], wants_status=False), t_ns)
            seq[node] += 1
        receptions += sum(1 for _, message in air.outbox if type(message) is Reception)
        air.outbox.clear()
    air.stop(end_ns)
    receptions += sum(1 for _, message in air.outbox if type(message) is Reception)
    report = dict(air.report())
    targets = len(places) - 1 if dst == BROADCAST else 1
    report["pdr_generated"] = receptions / (max(1, sum(seq.values())) * targets)
    return report
