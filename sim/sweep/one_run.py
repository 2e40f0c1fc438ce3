"""Carries out one run of a sweep, in any process; it returns the result or the error, and never raises."""

import asyncio
import json
import os
import time
import traceback
from dataclasses import dataclass

from fanet_mw.errors import FanetError, HostError
from fanet_mw.scenario import Scenario, config
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.sweep.measures import MEASURES, Value
from sim.sweep.provenance import code
from sim.sweep.tasks import Task, require_same


@dataclass(frozen=True, slots=True)
class Finished:
    """The result of one run. Only `wall_s` and `cpu_s` depend on the machine."""

    key: str
    code: str
    wall_s: float
    summary: str | None = None
    """The summary as JSON, without figures that depend on the machine; None if the run failed."""
    measured: str = "{}"
    """The additional measures, as JSON."""
    error: str | None = None
    """Why there is no summary: the last line of the traceback, and below it the whole traceback."""
    cpu_s: float = 0.0
    """The processor time of the run, which a busy machine lengthens less than the wall time."""

    @property
    def failed(self) -> bool:
        return self.summary is None


def _launched(scenario: Scenario, *, slow_down_to: float | None) -> Outcome:
    """Run a scenario as processes; only a run in real time needs the bus and its packages."""
    from sim.run.launcher.swarm import launch

    name = f"{scenario.name}-sweep"
    return asyncio.run(launch(scenario, swarm=name, slow_down_to=slow_down_to, heed_signals=False))


def processor_s() -> float:
    """The processor time of this process and of its finished children."""
    return sum(os.times()[:4])


def carry_out(task: Task) -> Finished:
    began, began_cpu = time.perf_counter(), processor_s()

    def ended(**came_to: str) -> Finished:
        wall_s, cpu_s = time.perf_counter() - began, processor_s() - began_cpu
        return Finished(task.key, code(), wall_s, cpu_s=cpu_s, **came_to)

    try:
        scenario = config.build(task.tree)
        require_same(task, scenario)
        outcome = _launched(scenario, slow_down_to=task.slow_down_to) if task.realtime else simulate(scenario)
        summary = finish(outcome, out=None)
        if task.realtime and not summary["valid"]:
            raise HostError(f"not valid: {'; '.join(summary['invalid_because'])}")
        del summary["wall_s"], summary["unwritten"], summary["files"]
        measured: dict[str, Value] = {name: MEASURES[name](outcome) for name in task.measure}
    except Exception as error:  # noqa: BLE001 one run of many: the others go on, and the table names this one
        lines = error.args[0] if isinstance(error, FanetError) and error.args else traceback.format_exc()
        return ended(error=f"{type(error).__name__}: {error}\n{lines}")
    return ended(summary=json.dumps(summary), measured=json.dumps(measured))
