"""The superframe of collision-free floods, by hand: a window of 40 ms, turns of 2 ms, 100 ms in all."""

import pytest

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import MS

TURNS = Turns(origin_ns=7 * MS, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)


@pytest.mark.parametrize(
    ("at_ms", "turn"),
    [(7, None), (46.999, None), (47, 0), (48.999, 0), (49, 1), (103, 28), (104.999, 28), (105, None), (147, 0)],
)
def test_an_instant_belongs_to_a_turn_or_to_none(at_ms: float, turn: int | None) -> None:
    assert TURNS.turn_at(round(at_ms * MS)) == turn


def test_offsets_reach_into_later_superframes() -> None:
    assert TURNS.start_ns(0, superframe_start_ns=7 * MS) == 47 * MS
    assert TURNS.start_ns(28, superframe_start_ns=7 * MS) == 103 * MS
    assert TURNS.start_ns(29, superframe_start_ns=7 * MS) == 147 * MS


def test_the_next_of_some_turns_is_found_over_the_end_of_the_superframe() -> None:
    assert TURNS.next_start_ns((3, 10), not_before_ns=0) == 53 * MS - 100 * MS + 100 * MS
    assert TURNS.next_start_ns((3, 10), not_before_ns=53 * MS) == 53 * MS
    assert TURNS.next_start_ns((3, 10), not_before_ns=53 * MS + 1) == 67 * MS
    assert TURNS.next_start_ns((3, 10), not_before_ns=68 * MS) == 153 * MS


def test_what_contends_waits_for_a_window_and_leaves_its_end_free() -> None:
    assert TURNS.contending_ns(10 * MS, lambda: 0.5) == 10 * MS
    assert TURNS.contending_ns(41 * MS, lambda: 0.5) == 41 * MS
    assert TURNS.contending_ns(42 * MS, lambda: 0.5) == 107 * MS + round(0.5 * 35 * MS)
    assert TURNS.contending_ns(90 * MS, lambda: 0.999) < 147 * MS - 5 * MS


def test_a_flood_that_reaches_into_the_next_superframe_waits_for_its_contention_window() -> None:
    assert TURNS.flood_ns(3, span=4) == 8 * MS
    assert TURNS.flood_ns(27, span=2) == 4 * MS
    assert TURNS.flood_ns(27, span=3) == 4 * MS + 42 * MS + 2 * MS
