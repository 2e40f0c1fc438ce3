"""The pace of the swarm's clock: timelines of the reports of one second each, and its law over drawn loads."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machine import Machine, Taken, alone, beside_others

from fanet_mw.units import S
from sim.run.launcher.clock_governor import ClockGovernor, Instant

FRAMES, RECEPTIONS = 1000, 4000
"""What is sent, and received by each of two UAVs, in one second."""


class Swarm:
    """An emulator and two UAVs that report once a second; and the clock's scale by the governor."""

    def __init__(self, *, scale: float = 1.0, least: float = 0.1, end_s: int = 1000, late_limit: float = 0.01) -> None:
        self.scale = scale
        self._governor = ClockGovernor(scale, least=least, late_limit=late_limit, end_ns=end_s * S, processors=2.0)
        self._seconds = self._late_moments = self._late_frames = self._late_receptions = self._close = 0
        self._late_ms = self._others_s = self._emulator_s = 0.0

    def second(
        self, *, late: float = 0.0, moments: int = 2, by_ms: float = 100.0, heard_late: float = 0.0, close: float = 0.0,
        taken: float = 1.0, emulator: float = 0.5,
    ) -> float:  # fmt: skip
        """Let a second pass in which these shares were late, in so many of its 40 moments; returns the scale after it.

        `taken` is the time of two processors that the launcher and all actors took, `emulator` its part of that.
        """
        self._seconds += 1
        self._late_frames += round(late * FRAMES)
        self._late_moments += moments if late else 0
        self._late_ms += round(late * FRAMES) * by_ms
        self._late_receptions += round(heard_late * RECEPTIONS)
        self._close += round(close * FRAMES)
        self._others_s += taken - emulator
        self._emulator_s += emulator
        agent = {"kind": "agent", "receptions": self._seconds * RECEPTIONS, "heard_late": self._late_receptions}
        frames = {
            "frames": self._seconds * FRAMES, "late_frames": self._late_frames, "close_frames": self._close,
            "late_moments": self._late_moments, "sum_ms": self._late_ms,
        }  # fmt: skip
        reports: dict[str, dict[str, Any]] = {
            "emulator": {"kind": "emulator", "late": frames, "host": {"cpu_s": self._emulator_s}},
            "agent-1": agent,
            "agent-2": agent,
            "world": {"kind": "world", "host": {"cpu_s": self._others_s / 2}},
        }
        at = Instant(self._seconds * S, self._seconds * S, self._others_s / 2)
        for _ in range(4):  # the launcher looks more often than actors report
            self.scale = self._governor.pace(reports, at) or self.scale
        return self.scale

    def ask(self, scale: float) -> None:
        self._governor.ask(scale, swarm_ns=self._seconds * S)
        self.scale = scale

    def steps(self) -> list[tuple[int, float]]:
        return self._governor.steps


def test_a_swarm_in_time_is_left_alone() -> None:
    swarm = Swarm()
    assert {swarm.second(late=0.009, moments=9, heard_late=0.019) for _ in range(300)} == {1.0}


def test_lateness_in_most_moments_of_a_second_slows_the_clock_at_once() -> None:
    assert Swarm().second(late=0.05, moments=20) == 0.75


def test_a_pause_does_not_however_many_requests_it_makes_late() -> None:
    swarm = Swarm()
    for _ in range(10):
        assert swarm.second(late=0.4, moments=8) == 1.0
        for _ in range(60):
            assert swarm.second() == 1.0


@pytest.mark.parametrize("late", [{"late": 0.05}, {"heard_late": 0.1}])
def test_more_lateness_in_a_few_seconds_than_is_allowed_in_20_slows_it(late: dict[str, float]) -> None:
    swarm = Swarm()
    assert [swarm.second(**late) for _ in range(5)] == [1.0, 1.0, 1.0, 1.0, 0.75]
    assert [Swarm().second(late=0.5) for _ in range(3)] == [1.0, 1.0, 1.0], "one second alone may be a pause"


def test_where_no_frame_may_be_late_one_in_each_of_three_seconds_slows_it() -> None:
    swarm = Swarm(late_limit=0.0)
    assert [swarm.second(late=late) for late in (0.0, 0.001, 0.001, 0.001)] == [1.0, 1.0, 1.0, 0.75]


@pytest.mark.slow
def test_pauses_that_the_limit_allows_on_average_do_not() -> None:
    swarm = Swarm()
    assert {swarm.second(late=0.03 if second % 5 == 0 else 0.0) for second in range(300)} == {1.0}


def test_lateness_of_more_than_20_seconds_ago_is_forgotten() -> None:
    swarm = Swarm()
    assert {swarm.second(late=0.15), swarm.second(late=0.15)} == {1.0}
    assert {swarm.second() for _ in range(20)} == {1.0}
    assert swarm.second(late=0.15) == 1.0, "it is the third bad second, and the first of the last 20"


def test_a_swarm_that_catches_up_is_given_the_time() -> None:
    swarm = Swarm()
    assert swarm.second(late=1.0, moments=40, by_ms=400) == 0.75
    assert swarm.second(late=1.0, moments=40, by_ms=500) == 0.75, "the last ones were 600 ms late"
    assert swarm.second(late=1.0, moments=40, by_ms=300) == 0.75
    assert swarm.second(late=1.0, moments=40, by_ms=300) == 0.5625


def test_it_slows_until_the_least_scale_and_no_further() -> None:
    swarm = Swarm(scale=4.0, least=2.0)
    assert [swarm.second(late=0.9, moments=40) for _ in range(4)] == [3.0, 2.25, 2.0, 2.0]
    assert swarm.steps() == [(1 * S, 3.0), (2 * S, 2.25), (3 * S, 2.0)]


def test_a_clock_that_may_not_slow_down_never_does() -> None:
    swarm = Swarm(scale=1.0, least=1.0)
    assert {swarm.second(late=0.9, moments=40) for _ in range(9)} == {1.0}


def slowed() -> Swarm:
    swarm = Swarm()
    assert swarm.second(late=0.2, moments=40) == 0.75
    return swarm


def test_the_pace_returns_by_a_curve_with_a_plateau() -> None:
    swarm = slowed()
    paces = [swarm.second() for _ in range(24)]
    assert paces == sorted(paces)
    assert paces[11] == 0.9, "where it was too fast, less a tenth"
    assert paces.count(0.85) + paces.count(0.9) > 12, "it lingers there"
    assert (paces[22] < 1, paces[23]) == (True, 1.0)


@pytest.mark.parametrize("spent", [{"taken": 1.8}, {"emulator": 0.9}])
def test_when_the_swarm_takes_all_processor_time_it_stays_below_the_pace_of_the_overload(
    spent: dict[str, float],
) -> None:
    swarm = slowed()
    assert max(swarm.second(**spent) for _ in range(100)) == 0.85
    assert [swarm.second() for _ in range(18)][-1] == 1.0


@pytest.mark.parametrize("strain", [{"late": 0.006}, {"heard_late": 0.012}, {"close": 0.06}])
def test_it_does_not_rise_in_a_second_that_was_nearly_too_much(strain: dict[str, float]) -> None:
    swarm = slowed()
    assert {swarm.second(**strain) for _ in range(50)} == {0.75}


def test_an_emulator_that_was_started_again_counts_from_nothing() -> None:
    swarm = Swarm()
    for _ in range(5):
        swarm.second(late=0.001)
    swarm._seconds = swarm._late_frames = swarm._late_receptions = 0
    assert {swarm.second() for _ in range(9)} == {1.0}


def test_without_a_report_of_the_emulator_nothing_is_decided() -> None:
    governor = ClockGovernor(1.0, least=0.1, late_limit=0.01, end_ns=9 * S, processors=2.0)
    assert governor.pace({}, Instant(0, 0, 0.0)) is None
    assert governor.pace({"world": {"kind": "world"}}, Instant(S, S, 0.0)) is None


@pytest.mark.parametrize(("scale", "left_s"), [(1.0, 1), (4.0, 4)])
def test_a_run_is_left_alone_in_its_last_second_of_real_time(scale: float, left_s: int) -> None:
    """A process that hears late of another pace would not end with the others."""
    assert Swarm(scale=scale, end_s=1 + left_s).second(late=0.5, moments=40) == scale * 0.75
    assert Swarm(scale=scale, end_s=left_s).second(late=0.5, moments=40) == scale


# --- the law ----------------------------------------------------------------------------------------------------------

LOADED_S = 90
FREE = 3.0
"""What the machine gets done without the load: it runs the swarm in a third of its time."""


@settings(deadline=None, max_examples=20)
@given(st.floats(0.3, 0.95), st.integers(0, 40), st.sampled_from([alone, beside_others]))
def test_under_a_load_the_pace_settles_near_what_it_allows_and_returns_within_30_s(
    capacity: float, from_s: int, taken: Taken
) -> None:
    machine = Machine(lambda t: capacity if from_s <= t < from_s + LOADED_S else FREE, taken)
    machine.run(from_s + LOADED_S)
    assert machine.slowest() > 0.55 * capacity, "a step below what the load needs, and one to catch up"
    settled = [scale for t, scale in machine.history if t > from_s + 30] or [machine.scale]
    falls = sum(later < earlier for earlier, later in pairwise(settled))
    assert falls <= (2 if taken is alone else 6), "it does not swing"
    if taken is alone:
        assert 0.65 * capacity <= machine.scale <= 1.25 * capacity
    machine.run(from_s + LOADED_S + 30)
    assert machine.scale == 1.0
    falls_before = len(machine.history)
    machine.run(from_s + LOADED_S + 200)
    assert len(machine.history) == falls_before, "and there it stays"


@settings(deadline=None, max_examples=20)
@given(st.lists(st.tuples(st.floats(10.5, 30), st.floats(0.02, 0.145)), max_size=12), st.floats(2.0, 4.0))
@pytest.mark.slow
def test_pauses_of_which_the_lead_covers_most_pass(pauses: list[tuple[float, float]], capacity: float) -> None:
    """Pauses of: the seconds since the one before, and its length."""
    starts: list[tuple[float, float]] = []
    for gap_s, length_s in pauses:
        starts.append(((starts[-1][0] if starts else 0.0) + gap_s, length_s))
    machine = Machine(lambda t: 0.0 if any(at <= t < at + length for at, length in starts) else capacity, alone)
    machine.run(60 + (starts[-1][0] if starts else 0))
    assert machine.history == [(0.0, 1.0)]


def test_an_operator_sets_the_pace_and_it_stays() -> None:
    governor = ClockGovernor(1.0, least=1.0, late_limit=0.01, end_ns=100 * S, processors=2.0)
    governor.ask(0.25, swarm_ns=7 * S)
    assert (governor.scale, governor.steps) == (0.25, [(7 * S, 0.25)])
    for second in range(1, 60):
        calm = {"emulator": {"late": {"frames": 100 * second}}}
        assert governor.pace(calm, Instant(7 * S + second * S // 4, second * S, 0.1 * second)) is None
    governor.ask(1.0, swarm_ns=30 * S)
    assert governor.scale == 1.0


@pytest.mark.parametrize("asked", [(0.25, 1.0), (2.0,)])
def test_a_clock_that_may_not_slow_down_keeps_every_pace_that_an_operator_sets(asked: tuple[float, ...]) -> None:
    swarm = Swarm(least=1.0)
    for scale in asked:
        swarm.ask(scale)
        assert {swarm.second(late=0.5, moments=30) for _ in range(5)} == {scale}


def test_one_that_may_slow_down_does_not_fall_below_its_least_because_an_operator_once_did() -> None:
    swarm = Swarm(least=0.5)
    swarm.ask(0.25)
    assert {swarm.second(late=0.5, moments=30) for _ in range(5)} == {0.25}
    swarm.ask(1.0)
    assert [swarm.second(late=0.5, moments=30) for _ in range(8)][-1] == 0.5
