"""A sweep with a case in real time: its runs are launched as processes after the others, and are rows beside them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import pytest

from fanet_mw.results import read
from sim.sweep import spec
from sim.sweep.one_run import Finished, carry_out
from sim.sweep.store import Store
from sim.sweep.tasks import Task, tasks_of
from sim.sweep.whole_sweep import RemainingRuns, run

FILE = """
base = "flooding"
set = {duration_s = 2, drain_s = 0.5, nodes.count = 3, traffic.sources = 2, radio.lead_ms = 1000}
case = [
    {name = "real", realtime = true},
    {name = "too late", realtime = true, set = {radio.lead_ms = 0.001}},  # no machine is that fast
    {name = "virtual"},
]
"""
_ATTEMPTS: Final = 3
"""A machine that does something else may spoil a run in real time; it does not spoil three of them."""


class OneByOne:
    """Carries runs out in this process, and notes which."""

    workers = 1

    def __init__(self) -> None:
        self.ran: list[str] = []

    def carry_out(self, tasks: Sequence[Task]) -> Iterator[Finished]:
        for task in tasks:
            self.ran.append(task.case)
            yield carry_out(task)


def swept(folder: Path) -> tuple[list[int], list[str], list[dict[str, Any]]]:
    """Carry the sweep out twice: the numbers of runs, what workers ran, and the rows."""
    sweep, store, workers, counts = spec.parse(FILE, source="test"), Store(folder), OneByOne(), []
    with store.alone():
        for _ in range(2):
            store.read()
            plan = RemainingRuns(tasks_of(sweep), store)
            run(plan, store, workers, sweep.varied())
            counts.append(len(plan.todo))
    return counts, workers.ran, read(folder).to_pylist()


@pytest.mark.slow
def test_runs_in_real_time_are_rows_beside_those_in_virtual_time_and_are_not_repeated(tmp_path: Path) -> None:
    for attempt in range(_ATTEMPTS):
        counts, ran, (real, late, virtual) = swept(tmp_path / str(attempt))
        if not (real["error"] or "").startswith("HostError: not valid: "):
            break
    assert (counts, ran) == ([3, 0], ["virtual"]), "what is in real time is no worker's"
    assert late["status"] == "failed", "what is not valid is no result"
    assert late["error"].startswith("HostError: not valid: ")
    assert "frames announced too late" in late["error"]
    assert real["case"] == "real"
    assert real["command"].startswith("fanet launch flooding ")
    assert (real["status"], real["error"]) == ("ok", None)
    assert real["generated"] == virtual["generated"] > 0, "the births of a seed are the same"
    assert '"mode": "realtime"' in real["summary"]
    assert '"mode": "virtual"' in virtual["summary"]
