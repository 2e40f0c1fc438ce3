"""What the real-time host and the bus cost, without any protocol: `python tests/benchmarks/realtime_bus.py [RATE ...]`.

47 processes start and join; 45 of them say something to each other at a given total rate [messages/s]. The delay is
from the call of `put` to the actor that receives: publisher, router, subscriber, and the wake-up of the loop.
"""

import asyncio
import json
import resource
import sys
import time
from collections.abc import Mapping
from typing import Any

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import MavlinkTap, Message
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import ClockKeeper
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.hosts.wake_lateness import DurationHistogram
from fanet_mw.units import S
from sim.run.launcher.child_processes import Processes
from sim.run.launcher.swarm import Collector, free_endpoint

NAMES = Topics("bench")
AGENTS = 45
RUN_S = 6
BODY = bytes(200)


class Talker(Actor):
    """Says a frame's worth to one other after the other, and notes how old what it hears is."""

    def __init__(self, node: int, rate_hz: float) -> None:
        super().__init__(f"agent-{node}", (NAMES.mavlink(node),))
        self._node = node
        self._every_ns = round(S / rate_hz) if rate_hz else None
        self._next_ns = 0
        self._count = 0
        self._delay = DurationHistogram()

    def start(self, now_ns: int) -> None:
        self._next_ns = now_ns + (self._every_ns or 0) * self._node // AGENTS

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        assert isinstance(message, MavlinkTap), "nothing else is said here"
        if message.t_ns > S:  # the first second is for warming up
            self._delay.add(max(0, now_ns - message.t_ns))

    def wake(self, now_ns: int) -> None:
        assert self._every_ns is not None, "only talkers wake"
        self._next_ns += self._every_ns
        self._count += 1
        to = (self._node + self._count) % AGENTS + 1
        self.outbox.append((NAMES.mavlink(to), MavlinkTap(now_ns, BODY)))

    def next_wake_ns(self) -> int | None:
        return self._next_ns if self._every_ns else None

    def report(self) -> Mapping[str, Any]:
        return {"said": self._count, "delay_ms": self._delay.summary()}


def talk(*, node: int, rate_hz: float, endpoint: str) -> int:
    asyncio.run(run_actor(Talker(node, rate_hz), SwarmAddress("bench", endpoint), until_ns=RUN_S * S))
    return 0


async def measure(rate: float) -> dict[str, Any]:
    """One run at a total rate."""
    endpoint = free_endpoint()
    with Bus.serve(endpoint) as bus:
        reported = Reports(bus)
        nodes = range(1, AGENTS + 3)
        keeper = ClockKeeper(bus, NAMES, time_scale=1.0, expected=[f"agent-{node}" for node in nodes])
        ended: list[tuple[str, int]] = []
        processes = Processes(lambda name, code: ended.append((name, code)))
        began = time.monotonic()
        for node in nodes:
            share = rate / AGENTS if node <= AGENTS else 0.0
            processes.start(f"agent-{node}", talk, {"node": node, "rate_hz": share, "endpoint": endpoint})
        await keeper.start(timeout_s=60)
        ready_s = time.monotonic() - began
        cpu_s = -time.process_time()
        try:
            await processes.wait(RUN_S + 10)
        finally:
            await processes.end_all()
        cpu_s += time.process_time()
        reports = list(reported.reports().values())
    hosts = [report["host"] for report in reports]
    heard = [report["delay_ms"] for report in reports if report["delay_ms"]["count"]]
    late = [host["wake_lateness_ms"] for host in hosts if host["wake_lateness_ms"]["count"]]
    middle = len(reports) // 2
    return {
        "messages_per_s": round(sum(report["said"] for report in reports) / RUN_S),
        "ready_s": round(ready_s, 2),
        "processes": len(reports),
        "uss_mb": sorted(host["uss_mb"] for host in hosts)[middle],
        "delay_ms": _middle_and_worst(heard),
        "wake_lateness_ms": _middle_and_worst(late),
        "cpu_s_children": round(sum(host["cpu_s"] for host in hosts), 1),
        "cpu_s_router": round(cpu_s, 1),
        "not_zero": [end for end in ended if end[1]],
    }


class Reports(Collector):
    """Only the reports of a swarm: with the taps, the launcher would add a copy of each message to the load."""

    def __init__(self, bus: Bus) -> None:
        self._reports = {}
        bus.subscribe(NAMES.all_reports, self._reports.__setitem__)


def _middle_and_worst(summaries: list[dict[str, float]]) -> dict[str, float]:
    """The median process' p50 and p99, and the worst of all."""
    if not summaries:
        return {}
    middle = len(summaries) // 2
    return {
        "p50": sorted(s["p50"] for s in summaries)[middle],
        "p99": sorted(s["p99"] for s in summaries)[middle],
        "worst p99": max(s["p99"] for s in summaries),
        "max": max(s["max"] for s in summaries),
        "count": sum(s["count"] for s in summaries),
    }


def main() -> None:
    for rate in [float(text) for text in sys.argv[1:]] or [0.0, 2000.0, 5000.0]:
        sys.stdout.write(json.dumps(asyncio.run(measure(rate))) + "\n")
        sys.stdout.flush()
    usage = resource.getrusage(resource.RUSAGE_SELF)
    sys.stdout.write(f"launcher: {usage.ru_maxrss / 1024:.0f} MB\n")


if __name__ == "__main__":
    main()
