"""Which neighbors count as silent, as timelines with hellos every second."""

import pytest

from fanet_mw.routing.clustered.roles.failure_detectors import Liveness, NeighborFailureDetector
from fanet_mw.units import NodeId, S

OTHER = NodeId(7)


@pytest.fixture
def liveness() -> Liveness:
    return Liveness()


@pytest.fixture
def detector(liveness: Liveness) -> NeighborFailureDetector:
    found = NeighborFailureDetector(liveness, hello_ns=S)
    found.on_hello(OTHER, now_ns=10 * S)
    liveness.on_sign_of_life(OTHER, born_ns=10 * S)
    return found


def everyone(_: NodeId) -> bool:
    return True


def test_a_neighbor_is_silent_after_four_hellos_and_is_told_of_again_after_a_while(
    detector: NeighborFailureDetector,
) -> None:
    assert detector.find_suspect(everyone, now_ns=14 * S - 1) is None
    assert detector.find_suspect(everyone, now_ns=14 * S) == OTHER
    detector.on_report(OTHER, now_ns=14 * S)
    assert detector.find_suspect(everyone, now_ns=24 * S - 1) is None
    assert detector.find_suspect(everyone, now_ns=24 * S) == OTHER


def test_whose_packets_still_come_over_others_is_not_silent(
    detector: NeighborFailureDetector, liveness: Liveness
) -> None:
    for second in range(11, 40):
        liveness.on_sign_of_life(OTHER, born_ns=second * S)
        assert detector.find_suspect(everyone, now_ns=second * S) is None


def test_who_objects_is_let_alone_until_it_is_heard_again(
    detector: NeighborFailureDetector, liveness: Liveness
) -> None:
    detector.on_report(OTHER, now_ns=14 * S)
    liveness.on_sign_of_life(OTHER, born_ns=15 * S)
    assert all(detector.find_suspect(everyone, now_ns=second * S) is None for second in range(15, 60))
    detector.on_hello(OTHER, now_ns=60 * S)
    liveness.on_sign_of_life(OTHER, born_ns=60 * S)
    assert detector.find_suspect(everyone, now_ns=64 * S) == OTHER


def test_who_is_in_no_schedule_and_who_was_never_heard_concern_nobody(detector: NeighborFailureDetector) -> None:
    detector.on_report(NodeId(8), now_ns=12 * S)
    assert detector.find_suspect(lambda _: False, now_ns=14 * S) is None
    assert detector.find_suspect(everyone, now_ns=15 * S) is None


def test_who_has_been_silent_for_a_minute_is_forgotten_though_nothing_was_said() -> None:
    for now_ns, found in ((60 * S, OTHER), (60 * S + 1, None)):
        detector = NeighborFailureDetector(Liveness(), hello_ns=S)
        detector.on_hello(OTHER, now_ns=0)
        assert detector.find_suspect(everyone, now_ns=now_ns) == found


def test_of_several_that_fell_silent_each_is_reported_five_seconds_after_the_one_before(
    detector: NeighborFailureDetector, liveness: Liveness
) -> None:
    silent = (OTHER, NodeId(8), NodeId(9))
    for node in silent[1:]:
        detector.on_hello(node, now_ns=10 * S)
        liveness.on_sign_of_life(node, born_ns=10 * S)
    for at_s, node in zip((14, 19, 24, 29), (*silent, OTHER), strict=True):
        detector.on_hello(NodeId(10), now_ns=at_s * S - 1)
        assert detector.find_suspect(everyone, now_ns=at_s * S - 1) is None
        assert detector.find_suspect(everyone, now_ns=at_s * S) == node
        detector.on_report(node, now_ns=at_s * S)


def test_who_hears_nobody_any_more_is_deaf_or_alone_and_reports_nobody(
    detector: NeighborFailureDetector, liveness: Liveness
) -> None:
    detector.on_hello(NodeId(8), now_ns=10 * S)
    assert all(detector.find_suspect(everyone, now_ns=second * S) is None for second in range(11, 70))
    liveness.on_sign_of_life(NodeId(8), born_ns=70 * S)
    detector.on_hello(OTHER, now_ns=66 * S)
    assert detector.find_suspect(everyone, now_ns=70 * S) == OTHER, "whoever hears somebody can tell who is silent"


def test_a_neighbor_that_hears_nobody_is_told_of_at_once_until_it_hears_again(
    detector: NeighborFailureDetector, liveness: Liveness
) -> None:
    """It goes on to send, so that it is never silent."""
    liveness.on_sign_of_life(OTHER, born_ns=11 * S)
    detector.on_deaf(OTHER, now_ns=12 * S)
    assert detector.find_suspect(everyone, now_ns=12 * S) == OTHER
    detector.on_hello(OTHER, now_ns=13 * S)
    assert all(detector.find_suspect(everyone, now_ns=second * S) is None for second in range(13, 17))
