"""Carries out a sweep: finished runs are not repeated, and each result is stored at once."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import pyarrow as pa

from fanet_mw.scenario import config
from sim.sweep.cost import TimeLeft, guess_s, launch_s
from sim.sweep.one_run import Finished, carry_out
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
    left_s: float


class SweepPlan:
    """The runs of a sweep, and which of them remain to be done."""

    def __init__(self, tasks: Sequence[Task], store: Store, *, retry: bool = False) -> None:
        self.tasks = tasks
        distinct = {task.key: task for task in tasks}
        self.total = len(distinct)
        self.todo = [task for key, task in distinct.items() if _wanted(store.get(key), retry=retry)]
        self.guesses_s = {task.key: _guess_s(task) for task in self.todo}

    def seconds(self, workers: int) -> float:
        """The estimated time that they will take."""
        return TimeLeft(self.guesses_s.values(), workers=workers).seconds()


def _guess_s(task: Task) -> float:
    scenario = config.build(task.tree)
    return launch_s(scenario) if task.realtime else guess_s(scenario)


def _wanted(done: Finished | None, *, retry: bool) -> bool:
    return done is None or (retry and done.failed)


def run(
    plan: SweepPlan,
    store: Store,
    workers: Workers,
    varied: Sequence[str],
    *,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> pa.Table:
    """Carry out the remaining runs, the longest first and those in real time last; returns the table.

    However it ends, the table with the finished runs has been written.
    """
    left = TimeLeft(plan.guesses_s.values(), workers=workers.workers)
    todo = sorted(plan.todo, key=lambda task: -plan.guesses_s[task.key])
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
            left.done(plan.guesses_s[done.key], done.wall_s)
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
