"""The pace of bulk: it grows while frames end in their windows, and is halved for a window in which one did not."""

from fanet_mw.routing.rounds.bulk_pacing import BulkPacing
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.units import MS

TIMING = RoundTiming(
    nodes=10, turn_ns=MS, period_ns=100 * MS, turn_bytes=500, window_ns=90 * MS, bulk_bytes=1024, bulk_ns=MS
)
WINDOW = 10 * MS
"""The first window begins here."""


def frames_allowed(pacing: BulkPacing, number: int) -> int:
    at_ns = WINDOW + number * TIMING.period_ns
    return sum(pacing.take(at_ns + i, again=False) for i in range(300))


def test_a_node_may_send_so_many_frames_per_window_and_again_in_the_next() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    assert [frames_allowed(pacing, number) for number in (0, 1)] == [8, 8]


def test_a_frame_beyond_its_window_halves_the_pace_and_a_second_one_there_does_not() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    for late_ns in (1, 2 * MS):
        pacing.ended(WINDOW + TIMING.window_ns + late_ns)
    assert frames_allowed(pacing, 1) == 4
    pacing.ended(WINDOW + 2 * TIMING.period_ns - 5 * MS)
    assert frames_allowed(pacing, 2) == 2


def test_the_pace_grows_by_about_one_per_window_full_of_frames() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    for _ in range(9):
        pacing.ended(WINDOW + 50 * MS)
    assert frames_allowed(pacing, 1) == 9


def test_one_frame_per_window_is_always_allowed() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    for number in range(20):
        pacing.ended(WINDOW + number * TIMING.period_ns + TIMING.window_ns + 1)
    assert frames_allowed(pacing, 21) == 1


def test_a_wait_is_a_part_of_the_windows() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    assert pacing.start_ns(WINDOW, windows=0.5) == WINDOW + TIMING.window_ns // 4


def test_repetitions_are_in_proportion_to_what_is_new_so_that_an_overload_ends() -> None:
    pacing = BulkPacing(TIMING, lambda: 0.5)
    for _ in range(2000):
        pacing.ended(WINDOW + 50 * MS)
    assert sum(pacing.take(WINDOW + i, again=True) for i in range(60)) == 16, "what it has saved"
    for i in range(20):
        assert pacing.take(WINDOW + 100 + i, again=False)
    assert sum(pacing.take(WINDOW + 200 + i, again=True) for i in range(60)) == 15, "three for four new ones"
