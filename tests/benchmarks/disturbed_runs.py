"""Which disturbances a result survives: `python tests/benchmarks/disturbed_runs.py [SCENARIO ...]`, 10 minutes of CPU.

The limits of `sim/results/validity.py` come from this table. Small swarms (nine UAVs, 20 s) run in virtual time,
undisturbed and then with a host that does what a machine under load does: requests or receptions are lost or come too
late, processes stand still; in `many` (45 UAVs, timetables, 30 s) one UAV does. So nothing differs from the undisturbed
run of the same seed but the disturbance. A line says how much each measure saw of it, how far delivery ratio and delay
went off (mean over the seeds, and the worst), and in how many of the runs the verdict was `valid`. `--real CASE ...`
runs real processes instead, `--list` names the cases: under `none` it shows what the machine itself does.
"""

import asyncio
import heapq
import os
import signal
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any, Final, NamedTuple

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception, TxRequest
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import MS, S
from sim.results.files import finish
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.run.launcher import swarm
from sim.run.virtual import actors_of, simulate
from sim.scenarios import catalog

_SMALL: Final = (
    "nodes.count=9",
    "nodes.layout=grid",
    "duration_s=20",
    "warmup_s=8",
    "drain_s=2",
    "mission.survivors=0",
)
_FLY: Final = ("mobility.model=random_waypoint", "mobility.speed_m_s=10", "world.area_m=600", "world.engine=kinematic")
SCENARIOS: Final = {
    "flooding": ("flooding", (*_SMALL, *_FLY, "traffic.sources=4", "traffic.interval_s=1", "radio.lead_ms=20")),
    "clustered": (
        "rescue-paper",
        (*_SMALL, "mobility.model=static", "clusters.count=3", "clusters.flooding_period_s=1"),
    ),
    "turns": ("clusters", (*_SMALL, "traffic.sources=8", "clusters.count=8", "radio.lead_ms=40")),
    "many": ("clusters", ("duration_s=30", "warmup_s=8", "drain_s=2")),
}
_SEEDS: Final = (1, 2, 3)
_SHARES: Final = ("late_frames", "lost_on_bus", "copies_lost", "dropped_late", "missed_turns", "lost", "heard_late")
_STALLS: Final = ("stall_ms", "uav_stall_ms")
_ACTS_NS: Final = 10 * S
"""When processes are frozen: the traffic runs."""


# --- a host that does what a machine under load does ------------------------------------------------------------------


class Disturbance(NamedTuple):
    """What happens to the actors of these kinds; shares are of the messages that come to them."""

    kind: str = ""
    of: type[Any] = TxRequest
    lost: float = 0.0
    late: float = 0.0
    """So many come up to 40 ms too late, evenly: later than a handover and a lead."""
    frozen_s: float = 0.0


class Disturbed(Actor):
    """An actor on a machine that disturbs it."""

    def __init__(self, inner: Actor, disturbance: Disturbance, scenario: Scenario) -> None:
        super().__init__(inner.name, inner.subscriptions)
        self._inner = inner
        self._what = disturbance
        self._random = Random(f"{scenario.seed}/{inner.name}")
        self._late_ns = scenario.radio.lead_ns + scenario.radio.handover_ns
        self._thaw_ns = _ACTS_NS + round(disturbance.frozen_s * S)
        self._waiting: list[tuple[int, int, str, Message]] = []
        self._count = 0
        self._last_ns: dict[str, int] = {}
        """When the last message of each topic comes: a bus keeps their order."""

    def start(self, now_ns: int) -> None:
        self._inner.outbox, self._inner.records = self.outbox, self.records
        self._inner.start(now_ns)

    def _awake_ns(self, at_ns: int) -> int:
        return self._thaw_ns if _ACTS_NS <= at_ns < self._thaw_ns else at_ns

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        due_ns = now_ns
        if isinstance(message, self._what.of):
            dice = self._random.random()
            if dice < self._what.lost:
                return
            if dice < self._what.lost + self._what.late:
                due_ns += self._late_ns + round(self._random.random() * 40 * MS)
        due_ns = self._last_ns[topic] = max(due_ns, self._last_ns.get(topic, 0))
        self._count += 1
        heapq.heappush(self._waiting, (self._awake_ns(due_ns), self._count, topic, message))
        self._take(now_ns)

    def _take(self, now_ns: int) -> None:
        while self._waiting and self._waiting[0][0] <= now_ns:
            _, _, topic, message = heapq.heappop(self._waiting)
            self._inner.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        self._take(now_ns)
        wanted_ns = self._inner.next_wake_ns()
        if wanted_ns is not None and self._awake_ns(wanted_ns) <= now_ns:
            self._inner.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        wanted_ns = self._inner.next_wake_ns()
        instants = [] if wanted_ns is None else [self._awake_ns(wanted_ns)]
        return min([*instants, *(item[0] for item in self._waiting[:1])], default=None)

    def stop(self, now_ns: int) -> None:
        self._take(2 * now_ns)
        self._inner.stop(now_ns)

    def report(self) -> Mapping[str, Any]:
        return self._inner.report()


DISTURBANCES: Final = {
    "none": Disturbance(),
    **{f"requests lost {p:.1%}": Disturbance("emulator", lost=p) for p in (0.002, 0.005, 0.01, 0.05)},
    **{f"requests late {p:.1%}": Disturbance("emulator", late=p) for p in (0.005, 0.01, 0.02, 0.05)},
    **{f"receptions lost {p:.1%}": Disturbance("agent", Reception, lost=p) for p in (0.002, 0.005, 0.01, 0.05)},
    **{f"receptions late {p:.1%}": Disturbance("agent", Reception, late=p) for p in (0.005, 0.01, 0.02, 0.05)},
    **{f"agent-5 frozen {t:g} s": Disturbance("agent-5", frozen_s=t) for t in (0.1, 0.3, 0.5, 1, 2)},
    **{f"emulator frozen {t:g} s": Disturbance("emulator", frozen_s=t) for t in (0.1, 0.3, 0.5, 1)},
    **{f"world frozen {t:g} s": Disturbance("world", frozen_s=t) for t in (0.5, 5)},
}


ONE_OF_MANY: Final = {
    f"agent-{node} frozen {t:g} s": Disturbance(f"agent-{node}", frozen_s=t) for node in (1, 5, 23) for t in (0.5, 1, 2)
}
"""One UAV of a large swarm stands still: its leader, and two others."""


def disturbed(scenario: Scenario, what: Disturbance) -> dict[str, Any]:
    """The summary of a run under a disturbance, judged as if real processes had made it."""
    records: list[Record] = []
    actors: Sequence[Actor] = [
        Disturbed(actor, what, scenario) if what.kind and (actor.name + "-").startswith(what.kind + "-") else actor
        for actor in actors_of(scenario, scenario.name)
    ]
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    reports = {actor.name: {**actor.report(), **_host_figures(actor, what)} for actor in actors}
    return summarize(Outcome(scenario, "realtime", 1.0, records, reports), trace_sha256="")


def _host_figures(actor: Actor, what: Disturbance) -> dict[str, Any]:
    frozen_ms = what.frozen_s * 1000 if isinstance(actor, Disturbed) else 0.0
    return {"final": True, "host": {"stall_ms": frozen_ms}}


# --- real processes ---------------------------------------------------------------------------------------------------


def real(scenario: Scenario, what: Disturbance) -> dict[str, Any]:
    """The same with real processes, for what can be done to them from outside: freezing."""
    assert what.lost + what.late == 0, "a bus that loses or delays is for virtual time"
    tasks = []

    def started(run: swarm.SwarmRun) -> None:
        async def later() -> None:
            while run._clock is None or run._clock.now_ns() < _ACTS_NS:  # noqa: ASYNC110  (real time passes)
                await asyncio.sleep(0.02)
            pid = run.processes.pid(what.kind)
            os.kill(pid, signal.SIGSTOP)
            await asyncio.sleep(what.frozen_s)
            os.kill(pid, signal.SIGCONT)

        if what.frozen_s:
            tasks.append(asyncio.ensure_future(later()))

    return finish(asyncio.run(swarm.launch(scenario, swarm="disturbed", on_started=started)), out=None)


# --- the table --------------------------------------------------------------------------------------------------------


def line(case: str, runs: Sequence[dict[str, Any]], calm: Sequence[dict[str, Any]]) -> str:
    """Means over the runs, and the greatest difference from the calm run of the same seed."""
    seen = {name: statistics.mean(run["disturbance"][name]["value"] for run in runs) for name in _SHARES}
    stall = statistics.mean(max(run["disturbance"][name]["value"] for name in _STALLS) for run in runs)
    off = [run["pdr"] - quiet["pdr"] for run, quiet in zip(runs, calm, strict=True)]
    p95 = [
        (run["delay_ms"]["p95"] or 0) - (quiet["delay_ms"]["p95"] or 0) for run, quiet in zip(runs, calm, strict=True)
    ]
    shares = " ".join(f"{100 * seen[name]:6.2f}" for name in _SHARES)
    worst = min(off, key=lambda difference: -abs(difference))
    return (
        f"{case:27} {shares} {stall:6.0f}  {statistics.mean(off):+.4f} {worst:+.4f} "
        f"{statistics.mean(p95):+6.0f}  {sum(run['valid'] for run in runs)} of {len(runs)}"
    )


def scenarios(what: str, seeds: Sequence[int] = _SEEDS) -> list[Scenario]:
    name, keys = SCENARIOS[what]
    return [catalog.find(name, [*keys, f"seed={seed}"]) for seed in seeds]


Run = Callable[[Scenario, Disturbance], dict[str, Any]]


def table(what: str, cases: Sequence[str], run: Run, seeds: Sequence[int] = _SEEDS) -> None:
    chosen = scenarios(what, seeds)
    calm = [finish(simulate(scenario), out=None) for scenario in chosen]
    pdr = ", ".join(f"{summary['pdr']:.4f}" for summary in calm)
    print(f"\n{what}: PDR of the undisturbed seeds {pdr}")
    print(f"{'':27}   late    bus copies   late missed   lost  heard  stall     PDR off     p95  valid")
    print(f"{'':27}      %      %      %   drop  turns    all   late     ms    mean   worst     ms", flush=True)
    for case in cases:
        what_happens = (DISTURBANCES | ONE_OF_MANY)[case]
        print(line(case, [run(scenario, what_happens) for scenario in chosen], calm), flush=True)


def main(arguments: list[str]) -> None:
    if arguments == ["--list"]:
        print("\n".join(DISTURBANCES | ONE_OF_MANY))
    elif arguments[:1] == ["--real"]:
        for what in ("flooding", "clustered", "turns"):
            table(what, arguments[1:] or ["none", "agent-5 frozen 1 s", "emulator frozen 0.3 s"], real, seeds=(1,))
    else:
        for what in arguments or SCENARIOS:
            if what == "many":
                table(what, list(ONE_OF_MANY), disturbed, seeds=(1, 2))
            else:
                table(what, list(DISTURBANCES), disturbed)


if __name__ == "__main__":
    main(sys.argv[1:])
