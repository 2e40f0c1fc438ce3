"""The instants from which frames without a turn may go."""

from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
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
