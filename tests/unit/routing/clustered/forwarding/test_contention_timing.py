"""The instants from which frames without a turn may go."""

from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import MS

LEAD_NS, DUE_NS = 20 * MS, 1000 * MS


def start_ns(*, late_ns: int, jitter: float = 0.0) -> int:
    contention = ContentionTiming(lead_ns=LEAD_NS, jitter=lambda: jitter, window=lambda: 0.0)
    return contention.start_ns(due_ns=DUE_NS, now_ns=DUE_NS + late_ns, jitter_ns=10 * MS)


def test_a_frame_goes_a_lead_and_its_jitter_after_it_was_due() -> None:
    assert start_ns(late_ns=0) == DUE_NS + LEAD_NS
    assert start_ns(late_ns=0, jitter=0.5) == DUE_NS + LEAD_NS + 5 * MS


def test_a_process_that_was_woken_late_announces_the_same_instant_as_long_as_it_is_ahead() -> None:
    for late_ns in (1, LEAD_NS // 2, LEAD_NS):
        assert start_ns(late_ns=late_ns) == DUE_NS + LEAD_NS
        assert start_ns(late_ns=late_ns, jitter=0.5) == DUE_NS + LEAD_NS + 5 * MS


def test_a_process_that_was_woken_after_the_instant_announces_no_instant_in_the_past() -> None:
    assert start_ns(late_ns=2 * LEAD_NS) == DUE_NS + 2 * LEAD_NS


def in_windows(*, window: float = 0.0) -> ContentionTiming:
    """Windows of 20 ms every 500 ms."""
    contention = ContentionTiming(lead_ns=0, jitter=lambda: 0.0, window=lambda: window)
    contention.turns_at = lambda _: Turns(0, 500 * MS, 20 * MS, 1 * MS, 480)
    return contention


def test_jitter_is_cut_to_the_window_only_where_there_are_windows() -> None:
    """Before the first timetable two relays of a join that do not hear each other would meet at the leader."""
    contention = ContentionTiming(lead_ns=0, jitter=lambda: 0.5, window=lambda: 0.0)
    contention.most_jitter_ns = 4 * MS
    contention.turns_at = lambda _: None
    assert contention.start_ns(due_ns=MS, now_ns=MS, jitter_ns=100 * MS) == 51 * MS
    contention.turns_at = lambda _: Turns(0, 500 * MS, 20 * MS, 1 * MS, 480)
    assert contention.start_ns(due_ns=MS, now_ns=MS, jitter_ns=100 * MS) == 3 * MS


def test_a_quarter_of_a_window_is_for_one_nodes_data_and_the_rest_goes_later() -> None:
    contention = in_windows()
    assert [contention.with_room(400 * MS, 2 * MS) // MS for _ in range(5)] == [500, 500, 1000, 1000, 1500]


def test_what_a_neighbor_will_ask_for_again_is_left_out_of_a_full_window() -> None:
    contention = in_windows()
    assert [contention.has_room(501 * MS, 2 * MS) for _ in range(3)] == [True, True, False]
    assert contention.has_room(1001 * MS, 2 * MS)


def test_a_frame_in_a_window_must_end_within_it_and_no_other_has_an_end() -> None:
    contention = in_windows()
    assert contention.ends_ns(519 * MS, 2 * MS) == 518 * MS
    assert contention.ends_ns(520 * MS, 2 * MS) == 0, "a call, for example"
    contention.turns_at = None
    assert contention.ends_ns(519 * MS, 2 * MS) == 0


def test_a_frame_that_is_longer_than_the_share_has_a_window_for_itself() -> None:
    contention = in_windows()
    assert [contention.with_room(400 * MS, 9 * MS) // MS for _ in range(3)] == [500, 1000, 1500]
