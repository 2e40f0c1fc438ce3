"""Carries out the remaining runs of a sweep (`remaining_runs.py`), and stores each result at once."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import pyarrow as pa

from sim.sweep.one_run import Finished, carry_out
from sim.sweep.remaining_runs import RemainingRuns, TimeLeft
from sim.sweep.store import Store
from sim.sweep.tasks import Task

_PUBLISH_S: Final = 15.0
"""The interval at which the table is written again while runs end."""


class Workers(Protocol):
    """Carries out runs, in processes of this machine or on a cluster."""

    workers: int

    def carry_out(self, tasks: Sequence[Task]) -> Iterator[Finished]: ...


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a sweep."""

    done: int
    total: int
    failed: int
    left_s: float | None
    """The estimated time of the rest; None as long as no run has ended."""


def run(
    plan: RemainingRuns,
    store: Store,
    workers: Workers,
    varied: Sequence[str],
    *,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> pa.Table:
    """Carry out the remaining runs, the longest first, real time last; returns the table, written however it ends."""
    left = TimeLeft(plan, workers=workers.workers)
    todo = sorted(plan.todo, key=lambda task: -plan.sizes[task.key])
    waiting = {task.key for task in todo}
    failed = sum(
        1
        for task in plan.tasks
        if task.key not in waiting and (done := store.get(task.key)) is not None and done.failed
    )
    count = plan.total - len(todo)
    on_progress(Progress(count, plan.total, failed, left.seconds()))
    published = time.monotonic()
    try:
        for done in _ended(todo, workers):
            store.add(done)
            count += 1
            failed += done.failed
            left.on_end(done.key, done.wall_s)
            on_progress(Progress(count, plan.total, failed, left.seconds()))
            if time.monotonic() - published > _PUBLISH_S:
                store.publish(plan.tasks, varied)
                published = time.monotonic()
    finally:
        table = store.publish(plan.tasks, varied)
    return table


def _ended(todo: Sequence[Task], workers: Workers) -> Iterator[Finished]:
    """The result of each task. Runs in real time have the machine to themselves, one after the other."""
    virtual = [task for task in todo if not task.realtime]
    if virtual:
        yield from workers.carry_out(virtual)
    for task in todo:
        if task.realtime:
            yield carry_out(task)
