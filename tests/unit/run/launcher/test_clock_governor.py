"""When the swarm's clock slows down: timelines of the reports of one second each."""

from typing import Any

import pytest

from fanet_mw.units import S
from sim.run.launcher.clock_governor import ClockGovernor

FRAMES, RECEPTIONS = 1000, 4000
"""What is sent, and received by each of two UAVs, in one second."""


class Swarm:
    """An emulator and two UAVs that report once a second; and the clock's scale by the governor."""

    def __init__(self, *, scale: float = 1.0, least: float = 0.1, end_s: int = 1000) -> None:
        self.scale = scale
        self._governor = ClockGovernor(scale, least=least, late_limit=0.01, end_ns=end_s * S)
        self._late_frames = self._late_receptions = self._seconds = 0

    def second(self, *, late: float = 0.0, heard_late: float = 0.0) -> float:
        """Let a second pass in which these shares were late; returns the scale after it."""
        self._seconds += 1
        self._late_frames += round(late * FRAMES)
        self._late_receptions += round(heard_late * RECEPTIONS)
        agent = {"kind": "agent", "receptions": self._seconds * RECEPTIONS, "heard_late": self._late_receptions}
        late_frames = {"frames": self._seconds * FRAMES, "late_frames": self._late_frames}
        reports: dict[str, dict[str, Any]] = {
            "emulator": {"kind": "emulator", "late": late_frames},
            "agent-1": agent,
            "agent-2": agent,
            "world": {"kind": "world"},
        }
        for _ in range(4):  # the launcher looks more often than actors report
            self.scale = self._governor.slower(reports, self._seconds * S) or self.scale
        return self.scale

    def steps(self) -> list[tuple[int, float]]:
        return self._governor.steps


def test_a_swarm_in_time_is_left_alone() -> None:
    swarm = Swarm()
    assert {swarm.second(late=0.009, heard_late=0.019) for _ in range(300)} == {1.0}


@pytest.mark.parametrize("late", [{"late": 0.05}, {"heard_late": 0.05}])
def test_two_seconds_beyond_a_limit_slow_the_clock(late: dict[str, float]) -> None:
    swarm = Swarm()
    assert swarm.second(**late) == 1.0
    assert swarm.second(**late) == 0.75


def test_one_bad_second_alone_does_not() -> None:
    swarm = Swarm()
    for _ in range(10):
        assert swarm.second(late=0.05) == 1.0
        assert swarm.second() == 1.0


def test_a_second_far_beyond_a_limit_slows_it_at_once_and_more() -> None:
    assert Swarm().second(late=0.5) == 0.5


def test_the_second_after_is_not_held_against_the_slower_clock() -> None:
    """It empties what was waiting."""
    swarm = Swarm()
    assert swarm.second(late=0.5) == 0.5
    assert swarm.second(late=0.5) == 0.5
    assert swarm.second() == 0.5
    assert swarm.second(late=0.5) == 0.25


def test_it_slows_until_the_least_scale_and_no_further() -> None:
    swarm = Swarm(scale=4.0, least=0.6)
    assert [swarm.second(late=0.9) for _ in range(9)] == [2.0, 2.0, 1.0, 1.0, 0.6, 0.6, 0.6, 0.6, 0.6]
    assert swarm.steps() == [(1 * S, 2.0), (3 * S, 1.0), (5 * S, 0.6)]


def test_a_clock_that_may_not_slow_down_never_does() -> None:
    swarm = Swarm(scale=1.0, least=1.0)
    assert {swarm.second(late=0.9) for _ in range(9)} == {1.0}


def test_without_a_report_of_the_emulator_nothing_is_decided() -> None:
    governor = ClockGovernor(1.0, least=0.1, late_limit=0.01, end_ns=9 * S)
    assert governor.slower({}, 0) is None
    assert governor.slower({"world": {"kind": "world"}}, S) is None


@pytest.mark.parametrize(("scale", "left_s"), [(1.0, 1), (4.0, 4)])
def test_a_run_is_left_alone_in_its_last_second_of_real_time(scale: float, left_s: int) -> None:
    """A process that hears late of a slower clock would end before the others do."""
    assert Swarm(scale=scale, end_s=1 + left_s).second(late=0.5) == scale / 2
    assert Swarm(scale=scale, end_s=left_s).second(late=0.5) == scale
