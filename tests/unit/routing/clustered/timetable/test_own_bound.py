"""The bounds of one node's own packets, by hand: a window of 40 ms, turns of 2 ms, superframes of 100 ms."""

import pytest

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.own_bound import BURST, RootTurns
from fanet_mw.units import MS

TURNS = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)
AROUND_NS = 7 * MS


def test_bulk_waits_for_a_turn_and_its_flood_between_lead_and_receipt() -> None:
    own = RootTurns(TURNS, (5,), span=4, around_ns=AROUND_NS)
    assert own.worst_ns(interval_ns=100 * MS) == (100 + 4 * 2 + 7) * MS
    assert own.worst_ns(interval_ns=99 * MS) is None, "more comes than is let out"


@pytest.mark.parametrize(
    ("roots", "per_turn", "worst_ms"),
    [
        ((5,), BURST, 100 + 8),
        ((5,), 1, BURST * 100 + 8),
        ((5, 15), 1, 100 + 80 + 8),  # just after the turn at 70 ms: 150, 170, and 250 ms
        ((5, 15), BURST, 80 + 8),
        ((5,), BURST - 1, 2 * 100 + 8),  # the last is alone in the second turn
        ((5, 15), BURST - 1, 100 + 8),
    ],
)
def test_a_burst_is_through_with_the_turn_that_lets_out_its_last(
    roots: tuple[int, ...], per_turn: int, worst_ms: int
) -> None:
    own = RootTurns(TURNS, roots, span=4, around_ns=AROUND_NS)
    assert own.burst_ns(per_turn=per_turn) == worst_ms * MS + AROUND_NS
