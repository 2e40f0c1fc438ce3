"""Worker processes on this machine, each of which carries out one run at a time.

If a worker dies, its run is given to another worker once; if that dies, too, the run has failed. Workers are killed
when the process that started them ends, for whatever reason.
"""

import multiprocessing
import signal
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Final

from sim.results.outcome import described
from sim.run.launcher import process_setup
from sim.run.launcher.process_setup import be_killed_with_parent
from sim.sweep.one_run import Finished, carry_out
from sim.sweep.provenance import code
from sim.sweep.tasks import Task

_LIVES: Final = 2
"""A run that has killed this number of workers is not tried again."""


def _work(tasks: Connection) -> None:
    """Receive tasks and return their results, until the other end of the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the sweep receives the signal, and ends its workers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    be_killed_with_parent()
    process_setup.restore()
    while True:
        try:
            task: Task = tasks.recv()
            tasks.send(carry_out(task))
        except (EOFError, BrokenPipeError):  # the sweep is gone
            return


@dataclass(slots=True)
class _Worker:
    process: SpawnProcess
    tasks: Connection
    task: Task | None = None


class Pool:
    """A fixed number of workers."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._context = multiprocessing.get_context("spawn")
        self._running: list[_Worker] = []

    def carry_out(self, tasks: Sequence[Task]) -> Iterator[Finished]:
        """The result of each task, in the order in which they end."""
        waiting = deque(tasks)
        deaths: dict[str, int] = {}
        try:
            while waiting or any(worker.task for worker in self._running):
                self._hand_out(waiting)
                for worker in self._ready():
                    task = worker.task
                    assert task is not None, "only a worker that has a task is waited for"
                    try:
                        done: Finished = worker.tasks.recv()
                    except (EOFError, OSError):
                        exit_code = self._bury(worker)
                        deaths[task.key] = deaths.get(task.key, 0) + 1
                        if deaths[task.key] < _LIVES:
                            waiting.appendleft(task)
                        else:
                            why = f"the process that ran it died with {described(exit_code)}, {_LIVES} times"
                            yield Finished(task.key, code(), 0.0, error=why)
                        continue
                    worker.task = None
                    yield done
        finally:
            self.close()

    def _hand_out(self, waiting: deque[Task]) -> None:
        """Give a task to each idle worker, and start workers while there are too few."""
        while waiting:
            idle = next((worker for worker in self._running if worker.task is None), None)
            if idle is None:
                if len(self._running) >= self.workers:
                    return
                idle = self._start()
            try:
                idle.tasks.send(waiting[0])
            except OSError:  # it died while it was idle
                self._bury(idle)
                continue
            idle.task = waiting.popleft()

    def _start(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_work, args=(theirs,), name="fanet sweep", daemon=True)
        with process_setup.without_working_folder():
            process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._running.append(worker)
        return worker

    def _ready(self) -> list[_Worker]:
        """The workers that have a result or have died; waits for the first."""
        busy = {worker.tasks: worker for worker in self._running if worker.task is not None}
        return [busy[end] for end in wait(list(busy)) if isinstance(end, Connection)]

    def _bury(self, worker: _Worker) -> int:
        """Remove a dead worker; returns its exit code."""
        self._running.remove(worker)
        worker.tasks.close()
        worker.process.join()
        return worker.process.exitcode or 0

    def close(self) -> None:
        """End all workers, even in the middle of a run."""
        for worker in self._running:
            worker.process.kill()  # one that was stopped (SIGSTOP) heeds nothing else
        for worker in list(self._running):
            self._bury(worker)
