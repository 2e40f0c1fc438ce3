"""A drifting clock: its reading at a true instant, the reverse, and the same drift in every run."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from agents.clock.local_clock import LocalClock
from fanet_mw.scenario import Clock
from fanet_mw.units import MS, US, NodeId, S

instants = st.integers(0, 200 * S)


def clock(seed: int = 1, node: int = 3, **keys: float) -> LocalClock:
    made = LocalClock(Clock(**keys), seed=seed, node=NodeId(node))  # type: ignore[arg-type]
    made.pass_time(200 * S, until_ns=200 * S)
    return made


@given(st.integers(0, 99), st.lists(instants, min_size=2, max_size=9))
def test_any_instant_comes_back_within_a_nanosecond_and_order_stays(seed: int, when: list[int]) -> None:
    drifting = clock(seed, offset_ms=1000, drift_ppm=50, wander_ppm=1)
    shown = [drifting.local_ns(true_ns) for true_ns in sorted(when)]
    assert shown == sorted(shown)
    assert all(abs(drifting.true_ns(drifting.local_ns(true_ns)) - true_ns) <= 1 for true_ns in when)


@given(st.integers(0, 99), instants)
def test_a_clock_stays_within_its_offset_and_its_drift(seed: int, true_ns: int) -> None:
    drifting = clock(seed, offset_ms=50, drift_ppm=20, wander_ppm=0.5)
    assert abs(drifting.local_ns(0)) <= 50 * MS
    assert abs(drifting.local_ns(true_ns) - drifting.local_ns(0) - true_ns) <= 20e-6 * true_ns + 200


def test_an_exact_clock_shows_the_truth() -> None:
    assert clock().local_ns(123_456_789) == 123_456_789 == clock().true_ns(123_456_789)


def test_the_walk_does_not_depend_on_when_it_is_asked_for() -> None:
    keys = {"offset_ms": 50.0, "drift_ppm": 20.0, "wander_ppm": 0.1}
    at_once, step_by_step = clock(**keys), LocalClock(Clock(**keys), seed=1, node=NodeId(3))  # type: ignore[arg-type]
    for second in range(101):
        step_by_step.pass_time(second * S, until_ns=200 * S)
    assert [at_once.local_ns(t * S) for t in range(100)] == [step_by_step.local_ns(t * S) for t in range(100)]


def test_clocks_of_two_nodes_and_of_two_seeds_differ() -> None:
    shown = {clock(seed, node, offset_ms=50).local_ns(0) for seed in (1, 2) for node in (1, 2)}
    assert len(shown) == 4


def test_far_beyond_the_walk_the_last_rate_goes_on() -> None:
    drifting = clock(offset_ms=50, drift_ppm=20, wander_ppm=0.1)
    far_ns = 1 << 61
    assert abs(drifting.local_ns(far_ns) - far_ns) < 21e-6 * far_ns
    assert abs(drifting.true_ns(drifting.local_ns(far_ns)) - far_ns) < US * 1000


def test_a_rate_that_wanders_much_stays_within_its_bound_every_second() -> None:
    drifting = clock(drift_ppm=20, wander_ppm=10)
    shown = [drifting.local_ns(second * S) for second in range(200)]
    rates_ppm = [(b - a - S) / 1000 for a, b in pairwise(shown)]
    assert max(abs(rate) for rate in rates_ppm) <= 20.001
    assert sum(abs(rate) > 19.9 for rate in rates_ppm) > 5, "it is pressed against it"
