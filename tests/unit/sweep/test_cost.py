"""How long a sweep will take: on an idle machine, on one that does something else, and while its runs end."""

import os

import pytest

from sim.sweep import cost
from sim.sweep.cost import TimeLeft, pace_of_workers


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2, 3})
    return monkeypatch


@pytest.mark.parametrize(
    ("load", "share", "workers", "pace"),
    [
        (0.0, 1.0, 4, 1.0), (0.0, 1.0, 2, 1.0), (0.0, 1.0, 16, 0.25), (12.0, 0.3, 4, 0.25), (24.0, 0.15, 4, 1 / 7),
        (24.0, 1.0, 4, 4 / 7), (2.0, 0.1, 4, 4 / 6),
    ],
)  # fmt: skip
def test_workers_share_the_cores_with_what_else_runs(
    machine: pytest.MonkeyPatch, load: float, share: float, workers: int, pace: float
) -> None:
    """A load that is over, or only waits, leaves this process more of a core than the mean of a minute would."""
    machine.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    machine.setattr(cost, "share_of_core", lambda: share)
    assert pace_of_workers(workers) == pytest.approx(pace)


def test_a_machine_that_is_seven_times_slower_is_foreseen_and_then_measured() -> None:
    idle = TimeLeft(400.0, 0.0, workers=4, pace=1.0)
    assert idle.seconds() == pytest.approx(100, rel=0.05)
    busy = TimeLeft(400.0, 0.0, workers=4, pace=1 / 7)
    assert busy.seconds() == pytest.approx(700, rel=0.05)
    for _ in range(10):
        idle.done(20.0, 140.0, realtime=False)  # nothing else ran when it began
    assert idle.seconds() == pytest.approx(350, rel=0.05), "200 s of work are left, each takes seven"
    for _ in range(10):
        busy.done(20.0, 20.0, realtime=False)  # what else ran has ended
    assert busy.seconds() == pytest.approx(50, rel=0.35)


def test_runs_in_real_time_come_one_after_the_other_and_take_as_long_as_they_say() -> None:
    left = TimeLeft(0.0, 100.0, workers=4, pace=0.5)
    assert left.seconds() == 100
    left.done(50.0, 53.0, realtime=True)
    assert left.seconds() == 50
