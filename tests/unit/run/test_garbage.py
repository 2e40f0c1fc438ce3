"""What runs leave behind is collected between runs, and rarely."""

import gc
import weakref
from typing import Any

import pytest

from fanet_mw.actor import Actor
from sim.run import virtual
from sim.run.virtual import GarbageOfRuns, actors_of, simulate
from sim.scenarios.catalog import find


class Clock:
    """CPU time that passes as a test says."""

    s: float = 0.0

    def __call__(self) -> float:
        return self.s


def test_garbage_is_collected_before_the_run_that_follows_five_seconds_of_runs() -> None:
    clock, collected = Clock(), []
    garbage = GarbageOfRuns(every_s=5.0, collect=lambda: collected.append(clock.s), cpu_s=clock)
    for _ in range(8):
        with garbage.not_collected():
            clock.s += 2.0
        clock.s += 100.0  # what the program does between runs does not count
    assert collected == [306.0, 612.0]


def test_the_collector_is_off_in_a_run_and_on_again_after_one_that_failed() -> None:
    during: list[bool] = []

    def failing_run() -> None:
        with GarbageOfRuns().not_collected():
            during.append(gc.isenabled())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        failing_run()
    assert [*during, gc.isenabled()] == [False, True]


def test_a_program_that_has_switched_the_collector_off_finds_it_off() -> None:
    gc.disable()
    try:
        with GarbageOfRuns().not_collected():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_what_a_program_has_frozen_is_still_frozen_after_a_run() -> None:
    before = gc.get_freeze_count()
    gc.freeze()
    try:
        frozen = gc.get_freeze_count()
        with GarbageOfRuns().not_collected():
            pass
        assert gc.get_freeze_count() == frozen
        assert gc.isenabled()
    finally:
        if not before:  # the tests have frozen what they hold themselves
            gc.unfreeze()


def test_the_uavs_of_an_ended_run_are_freed_before_a_later_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual, "GARBAGE", GarbageOfRuns(every_s=0.0))
    seen: list[weakref.ref[Actor]] = []

    def actors_seen(*args: Any, **keys: Any) -> list[Actor]:
        actors = actors_of(*args, **keys)
        seen.extend(map(weakref.ref, actors))
        return actors

    monkeypatch.setattr(virtual, "actors_of", actors_seen)
    for _ in range(2):
        simulate(find("flooding", ["nodes.count=3", "traffic.sources=2", "duration_s=2"]))
    first, second = seen[:5], seen[5:]
    assert len(first) == len(second) == 5, "three UAVs, the world and the link emulator"
    assert not any(actor() for actor in first)
