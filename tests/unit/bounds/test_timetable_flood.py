"""The bound of floods in turns against every phase of a periodic source, in a superframe of 29 turns."""

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.bounds import turn_service
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import MS

TURNS = Turns(origin_ns=7 * MS, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)


def exact_worst_ns(roots: tuple[int, ...], interval_ns: int, span: int, together: int) -> int:
    """Every phase of a periodic source, in steps finer than anything in the geometry, first come first served."""
    worst = 0
    for phase_ns in range(1, TURNS.period_ns + interval_ns, 1_000_000):
        free_ns = 0
        born = [phase_ns + packet * interval_ns for packet in range(24)]
        while born:
            start_ns = TURNS.next_start_ns(roots, not_before_ns=max(born[0], free_ns))
            free_ns = start_ns + 1
            worst = max(worst, last_turn_ends_ns(start_ns, span) - born[0])
            born = born[sum(1 for born_ns in born[:together] if born_ns <= start_ns) :]
    return worst


def last_turn_ends_ns(start_ns: int, span: int) -> int:
    """Turn after turn, over the contention windows."""
    left, t_ns = span - 1, start_ns
    while left:
        t_ns += TURNS.turn_ns
        left -= TURNS.turn_at(t_ns) is not None
    return t_ns + TURNS.turn_ns


@given(st.sets(st.integers(0, 28), min_size=1, max_size=4), st.integers(10, 250), st.integers(1, 10), st.integers(1, 3))
def test_the_bound_is_never_broken_and_nearly_reached(
    roots: set[int], interval_ms: int, span: int, together: int
) -> None:
    ordered, interval_ns = tuple(sorted(roots)), interval_ms * MS
    bound_ns = TURNS.worst_ns(ordered, span=span, interval_ns=interval_ns, together=together)
    if together * len(roots) * interval_ns < TURNS.period_ns:
        assert bound_ns is None
        return
    assert bound_ns is not None
    worst_ns = exact_worst_ns(ordered, interval_ns, span, together)
    assert worst_ns <= bound_ns
    if len(roots) == 1:
        assert worst_ns >= bound_ns - 2 * MS


def test_a_backlog_that_no_turn_drains_has_no_bound() -> None:
    assert TURNS.worst_ns((3,), span=1, interval_ns=99 * MS) is None
    assert TURNS.worst_ns((3,), span=1, interval_ns=100 * MS) is not None


def test_the_worst_packet_may_be_one_that_waits_for_a_later_turn() -> None:
    assert turn_service.worst_ns([100, 190], period_ns=150, interval_ns=40, together=2) == 190 - 80
    assert turn_service.worst_ns([100, 150], period_ns=150, interval_ns=40, together=2) == 100


def test_a_flood_lasts_as_long_as_in_the_turn_that_carries_the_packet() -> None:
    """Turns at 0 and 30 of 100: who misses one waits for the next, or the one after."""
    assert turn_service.done_ns([0, 30], [5, 50], period_ns=100) == [30 + 50, 100 + 50]
    assert turn_service.done_ns([0, 30], [50, 5], period_ns=100) == [70 + 50, 100 + 50]
