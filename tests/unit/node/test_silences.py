"""How long each neighbor has sent nothing, and how long it usually does."""

import pytest

from fanet_mw.node.neighbors import Silences
from fanet_mw.units import MS, NodeId, S

OTHER = NodeId(2)


def silent_after(silences: Silences, *, from_ns: int) -> int:
    """How long after an instant a silence counts as unusual [ms]."""
    return next(
        ms for ms in range(0, 20_000, 10) if silences.is_unusual(OTHER, least_ns=700 * MS, now_ns=from_ns + ms * MS)
    )


def test_a_silence_is_unusual_if_it_is_much_longer_than_those_of_late() -> None:
    for every_ms, after_ms in ((100, 710), (500, 1260), (1000, 2510)):
        silences, now_ns = Silences(count=3), 5 * S
        for _ in range(200):
            now_ns += every_ms * MS
            silences.on_frame(OTHER, now_ns)
        assert silent_after(silences, from_ns=now_ns) == after_ms


@pytest.mark.parametrize("quiet_s", [0, 10])
def test_after_a_burst_of_frames_a_station_with_nothing_to_say_is_not_missed_before_its_next_hello(
    quiet_s: int,
) -> None:
    silences, now_ns = Silences(count=3), 0
    for pause_ms in (*[1000] * quiet_s, *[30] * 100):
        now_ns += pause_ms * MS
        silences.on_frame(OTHER, now_ns)
    assert silent_after(silences, from_ns=now_ns) > 1000


def test_whoever_was_only_just_heard_or_never_is_not_missed_soon() -> None:
    silences = Silences(count=3)
    assert not silences.is_unusual(OTHER, least_ns=700 * MS, now_ns=100 * S)
    silences.on_frame(OTHER, 100 * S)
    assert silent_after(silences, from_ns=100 * S) > 9000


def test_a_long_absence_is_forgotten_and_a_station_that_is_none_is_passed_over() -> None:
    silences, now_ns = Silences(count=3), S
    silences.on_frame(9999, now_ns)
    for pause_ns in (0, 300 * S):
        now_ns += pause_ns
        for _ in range(200):
            now_ns += 100 * MS
            silences.on_frame(OTHER, now_ns)
    assert silent_after(silences, from_ns=now_ns) < 800
