"""How long the rest of a sweep will take: by what its finished runs took, and nothing else."""

from pathlib import Path

import pytest

from sim.cli.sweep import spoken
from sim.sweep import spec
from sim.sweep.store import Store
from sim.sweep.tasks import tasks_of
from sim.sweep.whole_sweep import RemainingRuns, TimeLeft

FILE = """
base = "flooding"
seeds = 4
set = {duration_s = 10, warmup_s = 1, nodes.count = 5, traffic.sources = 2}
"""


def plan_of(folder: Path, further: str = "") -> RemainingRuns:
    return RemainingRuns(tasks_of(spec.parse(FILE + further, source="test")), Store(folder))


def test_the_rest_takes_as_long_as_the_finished_runs_did_and_is_unknown_before(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    left = TimeLeft(plan, workers=2)
    assert left.seconds() is None
    left.on_end(plan.todo[0].key, 8.0)
    assert left.seconds() == pytest.approx(3 * 8 / 2)
    left.on_end(plan.todo[1].key, 16.0)
    assert left.seconds() == pytest.approx(2 * 12 / 2)


def test_a_run_of_four_times_as_many_nodes_counts_four_times(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "grid = {nodes.count = [5, 20]}\n")
    assert sorted(plan.sizes.values()) == [50.0] * 4 + [200.0] * 4
    left = TimeLeft(plan, workers=1)
    small = [task.key for task in plan.todo if plan.sizes[task.key] == 50]
    for key in small:
        left.on_end(key, 1.0)
    assert left.seconds() == pytest.approx(4 * 4)


@pytest.mark.parametrize(("seconds", "words"), [(0.2, "1 s"), (89.5, "90 s"), (150, "2 min"), (9000, "2.5 h")])
def test_durations_are_said_in_words(seconds: float, words: str) -> None:
    assert spoken(seconds) == words
