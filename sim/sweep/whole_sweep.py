"""Carries out those runs of a sweep that remain to be done, and stores each result at once, so that an interrupted or
extended sweep goes on where it stopped.

A run remains if the folder of the sweep (`store.py`) has no result under its key. A run that has failed is repeated
only if that is asked for (`fanet sweep --retry`), and one that other code has finished, too (`--rerun-older`).
"""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import pyarrow as pa

from fanet_mw.scenario import config
from sim.sweep.one_run import Finished, carry_out
from sim.sweep.store import Store
from sim.sweep.tasks import Task

_PUBLISH_S: Final = 15.0
"""The interval at which the table is written again while runs end."""


class RemainingRuns:
    """The runs of a sweep, and which of them remain to be done."""

    def __init__(
        self, tasks: Sequence[Task], store: Store, *, retry: bool = False, only_code: str | None = None
    ) -> None:
        """`only_code`: the one code whose results count as finished (`provenance.code`); None: those of any code."""
        self.tasks = tasks
        distinct = {task.key: task for task in tasks}
        self.total = len(distinct)
        finished = {key: store.get(key) for key in distinct}
        self.codes = Counter(done.code for done in finished.values() if done is not None)
        """The number of runs with a result, by the code that has produced it."""
        self.todo = [
            task for key, task in distinct.items() if _remains(finished[key], retry=retry, only_code=only_code)
        ]
        self.sizes = {task.key: _size(task) for task in self.todo}


def _remains(done: Finished | None, *, retry: bool, only_code: str | None) -> bool:
    return done is None or (retry and done.failed) or (only_code is not None and done.code != only_code)


def _size(task: Task) -> float:
    """By what runs are compared: seconds in real time, else simulated seconds of all nodes."""
    scenario = config.build(task.tree)
    return scenario.duration_s / scenario.time_scale if task.realtime else scenario.duration_s * scenario.node_count


class TimeLeft:
    """The remaining time of a sweep, by what its finished runs took."""

    def __init__(self, plan: RemainingRuns, *, workers: int) -> None:
        """Runs in virtual time go side by side, those in real time one after the other."""
        self._left = {task.key: (plan.sizes[task.key], task.realtime) for task in plan.todo}
        self._workers = workers
        self._done = self._took_s = 0.0
        """The sizes of finished runs in virtual time, and the seconds that they took."""

    def on_end(self, key: str, took_s: float) -> None:
        size, realtime = self._left.pop(key)
        if not realtime:
            self._done += size
            self._took_s += took_s

    def seconds(self) -> float | None:
        """The estimated seconds until the last run ends; None as long as nothing shows how fast runs are."""
        virtual, realtime_s = (
            sum(size for size, realtime in self._left.values() if realtime is kind) for kind in (False, True)
        )
        if virtual and not self._done:
            return None
        return realtime_s + (virtual * self._took_s / self._done / self._workers if virtual else 0.0)


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
