"""One slot: the bound is never violated, is reached to the nanosecond, and refuses exactly what grows without limit."""

from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples
from single_slot_bound import single_slot_bound
from slot_simulator import Slot, delays

from fanet_mw.bounds import Bounded, Periodic, Refused, SlotServer, delay_fifo, paper
from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import seconds_to_ns

ORACLES = [  # C, S, P, p [s]; equation (4); corrected (None: refused)
    (0.4, 1, 4, 1.9, 4.2, None),
    (1, 1.1, 5, 5, 5.0, 5.9),
    (0.001, 0.0011, 0.1, 0.1, 0.1, 0.1009),
    (0.4, 1, 4, 2, 4.0, 3.8),
    (1, 3.5, 10, 3.4, 10, 8.5),
    (0.001, 0.0625, 0.5, 0.1, 0.5, 0.4395),
]


def servers(c, s, big_p):
    return SlotServer(seconds_to_ns(c), seconds_to_ns(s), seconds_to_ns(big_p))


def estimate(server: SlotServer, interval_ns: int):
    return paper.cluster_estimate(
        airtime_ns=server.airtime_ns, slot_ns=server.slot_ns, period_ns=server.period_ns, interval_ns=interval_ns
    )


@pytest.mark.parametrize(("c", "s", "big_p", "p", "equation_4", "corrected"), ORACLES)
def test_the_published_table_to_the_nanosecond(c, s, big_p, p, equation_4, corrected) -> None:
    server = servers(c, s, big_p)
    assert estimate(server, seconds_to_ns(p)) == Bounded(seconds_to_ns(equation_4))
    found = single_slot_bound(server, interval_ns=seconds_to_ns(p))
    if corrected is None:
        assert isinstance(found, Refused)
        assert "unstable" in found.reason
    else:
        assert found == Bounded(seconds_to_ns(corrected))


@st.composite
def slots(draw, *, feasible: bool = True):
    """C, S, P, p as small integers: every phase can be tried."""
    airtime = draw(st.integers(1, 12))
    slot = draw(st.integers(airtime, 40))
    period = draw(st.integers(slot, 90))
    least = -(-period // (slot // airtime))
    interval = draw(st.integers(least, 2 * least) if feasible else st.integers(1, least - 1 if least > 1 else 1))
    return SlotServer(airtime, slot, period), interval


def worst_of_all_phases(server: SlotServer, interval: int, packets: int) -> int:
    slot = Slot(*server)
    return max(max(delays(slot, [phase + n * interval for n in range(packets)])) for phase in range(server.period_ns))


@examples(80)
@given(slots())
@example((SlotServer(1, 1, 1), 1))
def test_no_phase_is_worse_and_the_worst_is_one_tick_below(case) -> None:
    server, interval = case
    bound = single_slot_bound(server, interval_ns=interval)
    assert isinstance(bound, Bounded)
    worst = worst_of_all_phases(server, interval, 4 * server.frames + 2)
    assert worst == bound.delay_ns - 1, "the worst phase is one tick after the last start that fits"


@given(slots())
def test_examining_all_q_as_davis_does_gives_the_same(case) -> None:
    server, interval = case
    c, s, p = server
    k = s // c
    letter = max(
        (p - s + c) + (q - 1) // k * p + ((q - 1) % k + 1) * c - (q - 1) * interval for q in range(1, 4 * k + 3)
    )
    assert single_slot_bound(server, interval_ns=interval) == Bounded(letter)
    assert delay_fifo(Periodic(interval), server) == Bounded(letter)


@examples(25)
@given(slots(feasible=False))
def test_what_is_refused_does_grow_without_limit(case) -> None:
    server, interval = case
    if server.frames * interval >= server.period_ns:
        return
    assert isinstance(single_slot_bound(server, interval_ns=interval), Refused)
    few = worst_of_all_phases(server, interval, 2 * server.period_ns)
    many = worst_of_all_phases(server, interval, 8 * server.period_ns)
    assert many > few


def test_a_frame_longer_than_the_slot_is_refused() -> None:
    assert isinstance(single_slot_bound(SlotServer(11, 10, 50), interval_ns=1000), Refused)


def test_impossible_geometry_is_our_callers_mistake() -> None:
    with pytest.raises(LocalProtocolError, match="slot_ns = 60"):
        single_slot_bound(SlotServer(1, 60, 50), interval_ns=100)


# --- the paper's equations ---


def q_by_q(c: int, s: int, period: int, p: int) -> int:
    """Equations (2)-(4) as they stand, one q after the other."""
    worst = q = 0
    while True:
        q += 1
        w = -(-q * c // s) * period
        worst = max(worst, w - (q - 1) * p)
        if w <= q * p:
            return worst


@examples(50)
@given(st.integers(1, 30), st.integers(1, 60), st.integers(1, 100), st.integers(1, 200))
def test_the_paper_s_q_rule_is_followed_to_the_letter(c, s, period, p) -> None:
    found = paper.cluster_estimate(airtime_ns=c, slot_ns=s, period_ns=period, interval_ns=p)
    if c * period > s * p:
        assert isinstance(found, Refused)
        assert "no Q" in found.reason
    else:
        assert found == Bounded(q_by_q(c, s, period, p))


@given(st.integers(1, 10**9), st.integers(1, 500), st.integers(1, 500))
def test_with_the_paper_s_own_slot_the_estimate_is_one_period_whatever_the_load(c, period, p) -> None:
    """Utilization is exactly 1, and (4) collapses to p_c, even when one packet is longer than the period.

    (With p > p_c, S is shorter than a packet and the first q of a slot is not 1.)
    """
    found = paper.cluster_estimate(airtime_ns=c, slot_ns=None, period_ns=period * p, interval_ns=p)
    assert found == Bounded(period * p)


@examples(50)
@given(st.integers(1, 30), st.integers(1, 60), st.integers(1, 60))
def test_with_the_paper_s_own_slot_the_equations_are_followed_to_the_letter_for_any_periods(c, period, p) -> None:
    slot = paper.paper_slot(airtime_ns=c, interval_ns=p, period_ns=period)
    found = paper.cluster_estimate(airtime_ns=c, slot_ns=None, period_ns=period, interval_ns=p)
    assert found == Bounded(q_by_q(c, slot, period, p))


def test_the_estimate_ends_soon_whatever_the_periods() -> None:
    """With periods that share no factor the equations run through as many slots as an interval has nanoseconds."""
    period, p = 500_000_000, 18_181_819
    assert paper.cluster_estimate(airtime_ns=1, slot_ns=None, period_ns=period, interval_ns=p) == Bounded(
        period + p - 1
    )
    barely = Fraction(period, p) + Fraction(1, 10**15)
    found = paper.cluster_estimate(airtime_ns=1, slot_ns=barely, period_ns=period, interval_ns=p)
    assert isinstance(found, Refused)
    assert "beyond 100000 slots" in found.reason
