"""Which runs of a sweep remain to be done, so that an interrupted or extended sweep goes on where it stopped.

A run remains if the folder of the sweep (`store.py`) has no result under its key. A run that has failed is repeated
only if that is asked for (`fanet sweep --retry`), and one that other code has finished, too (`--rerun-older`).
"""

from collections import Counter
from collections.abc import Sequence

from fanet_mw.scenario import config
from sim.sweep.cost import TimeLeft, guess_s, launch_s
from sim.sweep.one_run import Finished
from sim.sweep.store import Store
from sim.sweep.tasks import Task


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
        self.guesses_s = {task.key: _guess_s(task) for task in self.todo}

    def time_left(self, *, workers: int, pace: float) -> TimeLeft:
        """The estimated time that the remaining runs will take."""
        sums = dict.fromkeys((False, True), 0.0)
        for task in self.todo:
            sums[task.realtime] += self.guesses_s[task.key]
        return TimeLeft(sums[False], sums[True], workers=workers, pace=pace)


def _remains(done: Finished | None, *, retry: bool, only_code: str | None) -> bool:
    return done is None or (retry and done.failed) or (only_code is not None and done.code != only_code)


def _guess_s(task: Task) -> float:
    scenario = config.build(task.tree)
    return launch_s(scenario) if task.realtime else guess_s(scenario)
