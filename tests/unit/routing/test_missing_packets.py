"""Which packets a node knows to lack: what was skipped or told, after a while, not for ever; and when it says so."""

import pytest

from fanet_mw.routing.missing_packets import MissingPackets
from fanet_mw.units import MS, S

ORIGIN = 7


def heard(*seqs: int) -> MissingPackets:
    missing = MissingPackets(patience_ns=500 * MS, window_ns=10 * S)
    for seq in seqs:
        missing.receive(ORIGIN, seq, now_ns=0)
    return missing


def test_a_skipped_number_is_missing_once_it_cannot_be_under_way_any_more() -> None:
    missing = heard(100, 102)
    assert not missing.any(now_ns=499 * MS)
    assert missing.any(now_ns=500 * MS)


def test_what_comes_later_is_not_missing_any_more() -> None:
    missing = heard(100, 103)
    missing.receive(ORIGIN, 101, now_ns=S)
    assert missing.any(now_ns=2 * S), "102 is"
    missing.receive(ORIGIN, 102, now_ns=2 * S)
    assert not missing.any(now_ns=2 * S)


def test_what_a_neighbor_has_is_missing_too_until_it_comes() -> None:
    missing = heard()
    missing.notice([(ORIGIN, 5)], now_ns=0)
    assert missing.any(now_ns=S)
    missing.receive(ORIGIN, 5, now_ns=S)
    assert not missing.any(now_ns=S)


def test_nothing_is_missed_for_ever_and_what_was_given_up_is_not_missed_anew() -> None:
    missing = heard(100, 102)
    assert missing.any(now_ns=10 * S)
    assert not missing.any(now_ns=10 * S + 1)
    missing.notice([(ORIGIN, 101)], now_ns=11 * S)
    assert not missing.any(now_ns=12 * S)


def test_what_was_given_up_is_forgotten_when_nobody_speaks_of_it_any_more() -> None:
    missing = heard(100, 102, *range(103, 135))
    assert not missing.any(now_ns=S), "33 more were sent"


@pytest.mark.parametrize("seqs", [(100, 101, 101, 102), (100, 133), (0xFFFF_FFFF, 0), (500,)])
def test_packets_in_order_a_new_start_and_numbers_that_wrap_are_no_loss(seqs: tuple[int, ...]) -> None:
    assert not heard(*seqs).any(now_ns=S)


@pytest.mark.parametrize("seqs", [(100, 132), (0xFFFF_FFFF, 1)])
def test_up_to_32_packets_may_be_missing(seqs: tuple[int, ...]) -> None:
    assert heard(*seqs).any(now_ns=S)


def test_a_suspicion_lasts_as_long_as_a_packet_is_missed() -> None:
    missing = heard(100)
    missing.suspect(S)
    assert missing.any(now_ns=11 * S - 1)
    assert not missing.any(now_ns=11 * S)


def test_who_lacks_nothing_states_what_it_has_in_every_fourth_hello_and_who_lacks_something_in_each() -> None:
    missing = heard(100)
    assert [missing.states(now_ns=S) for _ in range(8)] == [False, False, False, True] * 2
    missing.suspect(S)
    assert [missing.states(now_ns=S) for _ in range(3)] == [True] * 3
