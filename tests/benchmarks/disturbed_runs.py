"""Real runs that are disturbed on purpose, beside virtual time: `python tests/benchmarks/disturbed_runs.py [CASE ...]`.

Each case is a small swarm of real processes (nine UAVs, 20 s) and one disturbance. A line says how much each measure of
`sim/validity.py` saw of it, how far delivery ratio and delay are from those of the same seed in virtual time, and
whether the result would be taken for valid. The first lines say how far seeds of virtual time are from each other: a
difference within that is none. 25 s a case; `--list` names them. What the machine does besides is in the figures too.
"""

import asyncio
import contextlib
import multiprocessing
import os
import random
import signal
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final, NamedTuple

from agents.__main__ import run as run_agent
from fanet_mw.hosts.bus import Bus
from fanet_mw.scenario import Scenario
from sim import catalog, swarm
from sim.results import finish
from sim.run import simulate

_SMALL: Final = (
    "nodes.count=9",
    "nodes.layout=grid",
    "duration_s=20",
    "warmup_s=8",
    "drain_s=2",
    "mission.survivors=0",
)
SCENARIOS: Final = {
    "flooding": ("flooding", (*_SMALL, "traffic.sources=8", "traffic.interval_s=0.5", "radio.lead_ms=20")),
    "clustered": ("rescue", (*_SMALL, "mobility.model=static", "clusters.count=3", "clusters.flooding_period_s=1")),
    "turns": ("clusters", (*_SMALL, "traffic.sources=8", "clusters.count=8", "radio.lead_ms=40")),
}


_SHARES: Final = ("late_frames", "lost_on_bus", "copies_lost", "dropped_late", "missed_turns", "lost", "heard_late")


class Disturbance(NamedTuple):
    """Keys to set, a context around the run, and what to do to the swarm when the traffic has begun."""

    keys: tuple[str, ...] = ()
    around: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext
    act: Callable[[swarm.Swarm], Any] | None = None


def _spin() -> None:
    while True:
        pass


@contextlib.contextmanager
def busy(loops: int) -> Iterator[None]:
    """So many processes that compute as fast as they can."""
    context = multiprocessing.get_context("spawn")
    loads = [context.Process(target=_spin, daemon=True) for _ in range(loops)]
    for load in loads:
        load.start()
    try:
        yield
    finally:
        for load in loads:
            load.kill()
            load.join()


def lossy_agent(share: float, **arguments: Any) -> int:
    """A UAV of whose requests the bus loses this share."""
    dice, put = random.Random(arguments["node"]), Bus.put

    def lose(bus: Bus, topic: str, payload: bytes, *, reliable: bool = False) -> None:
        if not topic.endswith("/tx") or dice.random() >= share:
            put(bus, topic, payload, reliable=reliable)

    Bus.put = lose  # type: ignore[method-assign]
    return run_agent(**arguments)


@contextlib.contextmanager
def loss(share: float) -> Iterator[None]:
    """A bus that loses this share of the requests."""
    module: Any = swarm
    module.run_agent = partial(lossy_agent, share)
    try:
        yield
    finally:
        module.run_agent = run_agent


def freeze(name: str, seconds: float, *, times: int = 1) -> Callable[[swarm.Swarm], Any]:
    """Stop a process for so long, and let it go on."""

    async def act(run: swarm.Swarm) -> None:
        for _ in range(times):
            pid = run.processes.pid(name)
            os.kill(pid, signal.SIGSTOP)
            await asyncio.sleep(seconds)
            os.kill(pid, signal.SIGCONT)
            await asyncio.sleep(0.5)

    return act


DISTURBANCES: Final = {
    "none": Disturbance(),
    "2 busy loops": Disturbance(around=lambda: busy(2)),
    "4 busy loops": Disturbance(around=lambda: busy(4)),
    "lead 10 ms": Disturbance(keys=("radio.lead_ms=10", "radio.handover_ms=0")),
    "lead 3 ms": Disturbance(keys=("radio.lead_ms=3", "radio.handover_ms=0")),
    "bus loses 0.3 %": Disturbance(around=lambda: loss(0.003)),
    "bus loses 1 %": Disturbance(around=lambda: loss(0.01)),
    "bus loses 5 %": Disturbance(around=lambda: loss(0.05)),
    "emulator 0.2 s": Disturbance(act=freeze("emulator", 0.2)),
    "emulator 1 s": Disturbance(act=freeze("emulator", 1.0)),
    "agent 0.4 s": Disturbance(act=freeze("agent-5", 0.4)),
    "agent 2 s": Disturbance(act=freeze("agent-5", 2.0)),
    "world 5 s": Disturbance(act=freeze("world", 5.0)),
}


def launch(scenario: Scenario, disturbance: Disturbance) -> dict[str, Any]:
    tasks = []

    def started(run: swarm.Swarm) -> None:
        async def later() -> None:
            while run._clock is None or run._clock.now_ns() < 10e9:  # noqa: ASYNC110  (real time passes)
                await asyncio.sleep(0.02)
            assert disturbance.act is not None
            await disturbance.act(run)

        if disturbance.act is not None:
            tasks.append(asyncio.ensure_future(later()))

    with disturbance.around():
        outcome = asyncio.run(swarm.launch(scenario, swarm="disturbed", on_started=started))
    return finish(outcome, out=None)


def row(what: str, case: str, summary: dict[str, Any], virtual: dict[str, Any]) -> str:
    seen = {name: item["value"] for name, item in summary["disturbance"].items()}
    shares = " ".join(f"{100 * seen[name]:6.2f}" for name in _SHARES)
    p95, wanted = summary["delay_ms"]["p95"] or 0.0, virtual["delay_ms"]["p95"] or 0.0
    verdict = "valid" if summary["valid"] else "; ".join(summary["invalid_because"])
    pdr, off = summary["pdr"], summary["pdr"] - virtual["pdr"]
    return (
        f"{what:9} {case:16} {shares} {seen['stall_ms']:6.0f}  {pdr:.4f} {off:+.4f}  {p95:6.0f} {p95 - wanted:+6.0f}  "
        f"{verdict}"
    )


def spread(what: str, seeds: int = 5) -> str:
    """How far virtual runs with other seeds are from each other."""
    name, keys = SCENARIOS[what]
    runs = [finish(simulate(catalog.find(name, [*keys, f"seed={seed}"])), out=None) for seed in range(1, seeds + 1)]
    pdr, p95 = [run["pdr"] for run in runs], [run["delay_ms"]["p95"] for run in runs]
    return (
        f"{what:9} {seeds} virtual seeds: PDR {min(pdr):.4f} to {max(pdr):.4f} (sd {statistics.stdev(pdr):.4f}), "
        f"p95 {min(p95):.0f} to {max(p95):.0f} ms"
    )


def main(cases: list[str]) -> None:
    known = [f"{what}/{case}" for what in SCENARIOS for case in DISTURBANCES]
    if cases == ["--list"]:
        print("\n".join(known))
        return
    if not cases:
        print("\n".join(spread(what) for what in SCENARIOS))
        print(" " * 29 + "late    bus copies   late missed    all  heard  stall     PDR    diff     p95   diff")
        print(" " * 29 + "   %      %      %   drop      %   lost   late     ms                    ms     ms")
    for case in cases or known:
        what, _, disturbed = case.partition("/")
        name, keys = SCENARIOS[what]
        disturbance = DISTURBANCES[disturbed]
        scenario = catalog.find(name, [*keys, *disturbance.keys])
        virtual = finish(simulate(scenario), out=None)
        began = time.monotonic()
        print(row(what, disturbed, launch(scenario, disturbance), virtual), flush=True)
        assert time.monotonic() - began < 120, "a case takes less than two minutes"


if __name__ == "__main__":
    main(sys.argv[1:])
