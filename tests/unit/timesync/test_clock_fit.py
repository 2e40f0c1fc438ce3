"""The line through pairs of instants, by hand."""

import pytest

from fanet_mw.timesync.clock_fit import EXACT, PAIRS, ClockFit, Oscillator, Pair
from fanet_mw.units import MS, US, S

OSCILLATOR = Oscillator(rate=40e-6, wander=0.0, stamp_ns=US)


def pair(second: float, *, ppm: float = 10.0, start_us: float = 500.0, error_us: float = 1.0, source: int = 0) -> Pair:
    local_ns = round(second * S)
    return Pair(local_ns, round(start_us * US + ppm * 1e-6 * local_ns), round(error_us * US), source=source)


def fit_of(*pairs: Pair) -> ClockFit:
    fit = ClockFit(OSCILLATOR)
    for one in pairs:
        fit.add(one)
    return fit


def test_who_is_the_reference_has_an_exact_line() -> None:
    for local_ns in (0, S, 10**15):
        assert EXACT.swarm_ns(local_ns) == EXACT.local_ns(local_ns) == local_ns
        assert EXACT.error_ns(local_ns, OSCILLATOR) == 0
    assert EXACT.rate_error(OSCILLATOR) == 0


def test_one_pair_gives_the_offset_and_leaves_the_rate_open() -> None:
    line = fit_of(pair(10)).line
    assert line is not None
    assert line.offset_at(10 * S) == 600 * US
    assert line.rate == 0
    assert line.error_ns(11 * S, OSCILLATOR) >= 40 * US, "a second at the greatest rate"


def test_a_rate_that_pairs_tell_no_better_than_the_data_sheet_is_not_followed() -> None:
    """The first pair states 150 us too little, within its error, so the two give a rate of 350 ppm; it is -25."""
    line = fit_of(pair(0, ppm=-25, start_us=350, error_us=170), pair(0.4, ppm=-25, error_us=5)).line
    assert line is not None
    for later_s in range(1, 9):
        true_ns = pair(later_s, ppm=-25).offset_ns
        assert abs(line.offset_at(later_s * S) - true_ns) <= line.error_ns(later_s * S, OSCILLATOR)
    assert line.rate == 0


def test_pairs_give_the_rate_and_the_line_goes_there_and_back() -> None:
    line = fit_of(*(pair(second) for second in range(10))).line
    assert line is not None
    assert line.rate == pytest.approx(10e-6, abs=1e-9)
    assert line.offset_at(60 * S) == pytest.approx(1100 * US, abs=US)
    assert line.local_ns(line.swarm_ns(60 * S)) == pytest.approx(60 * S, abs=1)


def test_a_rate_that_no_two_clocks_can_have_is_cut() -> None:
    line = fit_of(pair(0, error_us=5), pair(1, start_us=537, error_us=5)).line
    assert line is not None
    assert line.rate == 40e-6


def test_the_error_shrinks_with_pairs_and_grows_after_the_last() -> None:
    few, many = fit_of(*map(pair, range(3))).line, fit_of(*map(pair, range(20))).line
    assert few is not None
    assert many is not None
    assert many.error_ns(20 * S, OSCILLATOR) < few.error_ns(3 * S, OSCILLATOR)
    assert many.error_ns(20 * S, OSCILLATOR) < many.error_ns(40 * S, OSCILLATOR) < many.error_ns(80 * S, OSCILLATOR)


def test_a_pair_far_from_the_line_is_left_out_and_counted() -> None:
    fit = fit_of(*map(pair, range(10)))
    before = fit.line
    assert not fit.add(pair(10, start_us=5000))
    assert (fit.line, fit.outliers, len(fit)) == (before, 1, 10)
    assert fit.add(pair(11))


def test_a_line_is_overthrown_when_more_of_the_window_agree_against_it() -> None:
    fit = fit_of(*map(pair, range(5)))
    believed = [fit.add(pair(5 + second, start_us=9000)) for second in range(6)]
    assert believed == [False] * 5 + [True]
    assert fit.steps == 1
    assert fit.line is not None
    assert fit.line.offset_at(11 * S) == pytest.approx(9110 * US, abs=US)


def test_liars_that_do_not_agree_with_each_other_overthrow_nothing() -> None:
    fit = fit_of(*map(pair, range(3)))
    assert not any(fit.add(pair(3 + second, start_us=9000 * (second + 2))) for second in range(20))
    assert fit.outliers == 20


def test_only_the_last_pairs_count() -> None:
    fit = fit_of(*(pair(second / 4) for second in range(3 * PAIRS)))
    assert len(fit) == PAIRS
    fit.add(pair(200))
    assert len(fit) == 1, "the others are older than the window"


def test_a_wandering_rate_makes_the_error_grow_faster_than_time() -> None:
    wandering = OSCILLATOR._replace(wander=0.1e-6)
    line = fit_of(*map(pair, range(20))).line
    assert line is not None
    errors = [line.error_ns(20 * S + ahead * S, wandering) for ahead in (0, 10, 20)]
    assert errors[2] - errors[1] > errors[1] - errors[0] > 0
    assert errors[2] < MS


def test_one_source_overthrows_no_line_that_another_has_borne_out_however_much_it_says() -> None:
    fit = fit_of(pair(0, source=1), pair(1, source=2))
    assert not any(fit.add(pair(1 + n / 4, start_us=9000, source=3)) for n in range(1, 40))
    assert fit.add(pair(11, start_us=9000, source=4)), "two that agree are heard"
    assert fit.steps == 1


def test_a_source_that_bore_out_a_line_alone_may_overthrow_it() -> None:
    """A neighbor whose own line was overthrown, of a node that has no other."""
    fit = fit_of(pair(0, source=3), pair(1, source=3))
    assert [fit.add(pair(2 + second, start_us=9000, source=3)) for second in range(3)] == [False, False, True]


def test_two_sources_that_state_a_later_time_are_followed_however_many_state_the_earlier_one() -> None:
    """Who repeats frames is always late; an earlier time needs more pairs than the line has."""
    for ahead_ns, followed in ((MS, True), (-MS, False)):
        fit = ClockFit(OSCILLATOR)
        for second in range(8):
            fit.add(Pair(second * S, 0, US, source=3 + second % 4))
        assert [fit.add(Pair(8 * S, ahead_ns, US, source=1)), fit.add(Pair(9 * S, ahead_ns, US, source=1))] == [
            False
        ] * 2
        assert fit.add(Pair(9 * S, ahead_ns, US, source=2)) is followed
