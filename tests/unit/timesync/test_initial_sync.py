"""A node without a time, and what its neighbors say of it: whose word is taken, when, and against whom."""

from fanet_mw.timesync.clock_fit import Oscillator, Pair
from fanet_mw.timesync.ftsp import InitialSync
from fanet_mw.units import MS, US, NodeId, S

LEADER = NodeId(1)
TRUE_NS, LIE_NS = 30 * MS, 2 * S


def nobody_believed() -> InitialSync:
    return InitialSync(Oscillator(40e-6, 0.0, US), leader=LEADER, wait_ns=1500 * MS, memory_ns=4 * S)


def says(first: InitialSync, src: int, at_ms: int, offset_ns: int = TRUE_NS, *, reference: int = 1) -> bool:
    pair = Pair((at_ms - 1000) * MS, offset_ns, 5 * US)
    return first.on_statement(NodeId(src), reference, pair, local_ns=at_ms * MS)


def test_the_leader_s_own_word_of_its_own_time_is_taken_at_once() -> None:
    assert says(nobody_believed(), 1, 5000)


def test_nobody_else_s_first_time_is_not_even_of_a_time_of_its_own() -> None:
    assert not says(nobody_believed(), 4, 5000)
    assert not says(nobody_believed(), 4, 5000, reference=4)
    assert not says(nobody_believed(), 1, 5000, reference=4), "the leader follows another: one of many"


def test_a_second_neighbor_that_says_the_same_is_enough() -> None:
    first = nobody_believed()
    assert not says(first, 3, 5000)
    assert not says(first, 3, 6000), "however often it says so"
    assert says(first, 4, 6100, TRUE_NS + 15 * US), "5 us of error each, two stamps of 1 us, 4 us of drift in 0.1 s"


def test_a_second_neighbor_that_says_otherwise_or_follows_another_is_none() -> None:
    first = nobody_believed()
    assert not says(first, 3, 5000)
    assert not says(first, 4, 5100, TRUE_NS + 20 * US)
    assert not says(first, 6, 5200, reference=2)


def test_a_liar_that_speaks_first_is_outvoted_by_two() -> None:
    first = nobody_believed()
    assert not says(first, 5, 5000, LIE_NS)
    assert not says(first, 3, 5100)
    assert says(first, 4, 5200)


def test_two_against_two_is_no_majority_until_the_wait_is_over() -> None:
    first = nobody_believed()
    assert not says(first, 5, 5000, LIE_NS)
    assert not says(first, 3, 5100)
    assert says(first, 6, 5200, LIE_NS), "two liars who meet one honest neighbor"
    first = nobody_believed()
    assert not says(first, 5, 5000, LIE_NS)
    assert not says(first, 3, 5100)
    assert not says(first, 7, 5150, 5 * S)
    assert not says(first, 4, 5200), "two of four are not more than contradict"
    assert says(first, 8, 5250), "three of five are"


def test_who_has_one_neighbor_takes_its_word_after_a_while() -> None:
    first = nobody_believed()
    assert not says(first, 3, 5000)
    assert not says(first, 3, 6499)
    assert says(first, 3, 6500)


def test_after_a_while_the_fewer_are_still_not_believed() -> None:
    first = nobody_believed()
    assert not says(first, 5, 5000, LIE_NS)
    assert not says(first, 3, 6400)
    assert not says(first, 7, 6450, 5 * S)
    assert not says(first, 5, 6600, LIE_NS), "one of three"


def test_what_was_said_long_ago_counts_no_longer() -> None:
    first = nobody_believed()
    assert not says(first, 6, 5000, 5 * S)
    assert not says(first, 5, 6400, LIE_NS)
    assert says(first, 3, 9001), "one of two, since node 6 has been silent"


def test_a_statement_that_was_forgotten_has_not_waited_for_a_later_one() -> None:
    first = nobody_believed()
    assert not says(first, 3, 5000, LIE_NS)
    assert not says(first, 4, 100_000), "the wait begins again, because nobody's statement counts any more"
    assert not says(first, 4, 101_000)
    assert says(first, 4, 101_500)
