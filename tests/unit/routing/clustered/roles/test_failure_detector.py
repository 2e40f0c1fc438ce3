"""Which neighbors count as silent, as timelines with hellos every second."""

import pytest

from fanet_mw.routing.clustered.roles.failure_detector import Silence
from fanet_mw.routing.clustered.roles.signs_of_life import Signs
from fanet_mw.units import NodeId, S

OTHER = NodeId(7)


@pytest.fixture
def signs() -> Signs:
    return Signs()


@pytest.fixture
def silence(signs: Signs) -> Silence:
    found = Silence(signs, hello_ns=S)
    found.heard(OTHER, now_ns=10 * S)
    signs.heard(OTHER, born_ns=10 * S)
    return found


def everyone(_: NodeId) -> bool:
    return True


def test_a_neighbor_is_silent_after_four_hellos_and_is_told_of_again_after_a_while(silence: Silence) -> None:
    assert silence.next_silent(everyone, now_ns=14 * S - 1) is None
    assert silence.next_silent(everyone, now_ns=14 * S) == OTHER
    silence.said(OTHER, now_ns=14 * S)
    assert silence.next_silent(everyone, now_ns=24 * S - 1) is None
    assert silence.next_silent(everyone, now_ns=24 * S) == OTHER


def test_whose_packets_still_come_over_others_is_not_silent(silence: Silence, signs: Signs) -> None:
    for second in range(11, 40):
        signs.heard(OTHER, born_ns=second * S)
        assert silence.next_silent(everyone, now_ns=second * S) is None


def test_who_objects_is_let_alone_until_it_is_heard_again(silence: Silence, signs: Signs) -> None:
    silence.said(OTHER, now_ns=14 * S)
    signs.heard(OTHER, born_ns=15 * S)
    assert all(silence.next_silent(everyone, now_ns=second * S) is None for second in range(15, 60))
    silence.heard(OTHER, now_ns=60 * S)
    signs.heard(OTHER, born_ns=60 * S)
    assert silence.next_silent(everyone, now_ns=64 * S) == OTHER


def test_who_is_in_no_schedule_and_who_was_never_heard_concern_nobody(silence: Silence) -> None:
    silence.said(NodeId(8), now_ns=12 * S)
    assert silence.next_silent(lambda _: False, now_ns=14 * S) is None
    assert silence.next_silent(everyone, now_ns=15 * S) is None


def test_who_has_been_silent_for_a_minute_is_forgotten_though_nothing_was_said() -> None:
    silence = Silence(Signs(), hello_ns=S)
    silence.heard(NodeId(4), now_ns=0)
    assert silence.next_silent(lambda _: True, now_ns=60 * S) == 4
    assert silence.next_silent(lambda _: True, now_ns=60 * S + 1) is None
