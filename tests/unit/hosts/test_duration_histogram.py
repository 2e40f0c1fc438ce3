"""The histogram of durations: the maximum is exact, percentiles are within a tenth."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.hosts.wake_lateness import DurationHistogram
from fanet_mw.units import MS, US


@given(st.lists(st.integers(1_000, 10**10), min_size=1, max_size=60), st.sampled_from([0.5, 0.9, 0.99]))
def test_a_percentile_is_good_to_a_tenth_and_never_too_small(durations_ns: list[int], share: float) -> None:
    histogram = DurationHistogram()
    for duration_ns in durations_ns:
        histogram.add(duration_ns)
    ordered = sorted(durations_ns)
    exact_ns = next(ns for rank, ns in enumerate(ordered, start=1) if rank >= share * len(ordered))
    assert 0.999 * exact_ns <= histogram.percentile_ns(share) <= 1.11 * exact_ns + 1
    assert histogram.max_ns == ordered[-1]


def test_a_summary_is_in_milliseconds_and_of_all() -> None:
    histogram = DurationHistogram()
    for duration_ns in (*[100 * US] * 98, 50 * MS, 10 * MS):
        histogram.add(duration_ns)
    summary = histogram.summary()
    assert summary["p50"] == pytest.approx(0.1, rel=0.11)
    assert summary["p99"] == pytest.approx(10, rel=0.11)
    assert (summary["max"], summary["count"]) == (50, 100)
    assert DurationHistogram().summary() == {"p50": 0.0, "p99": 0.0, "max": 0.0, "count": 0}
