"""The delay that a node states where links lose frames: what is before a packet, its flood, and rounds of repair."""

import pytest

from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.delivery_odds import Odds
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.own_bound import likely_delay_ns
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.routing.packet_repair import RIPE_NS
from fanet_mw.units import MS, NodeId, S

NODE, OTHER = NodeId(1), NodeId(2)
TURNS = Turns(0, 100 * MS, 40 * MS, 2 * MS, 29)


def plan_of(*missed: float, calls: tuple[int, ...] = (20,)) -> NodeTimetable:
    """Two turns of the node's own in a superframe of 100 ms, and the shares of copies that are missing after each round
    of repair.
    """
    turns = (Turn(0, NODE, NODE, 0), Turn(1, OTHER, NODE, 0), Turn(10, NODE, NODE, 1), Turn(11, OTHER, NODE, 1))
    table = Timetable(turns, {NODE: 2}, {}, 4, {NODE: calls})
    odds = Odds({NODE: missed})
    return NodeTimetable.of(
        NODE, 0, FittedTimetable(TURNS, table, together=1, frame_bytes=1024, whole=True, enough=True, odds=odds)
    )


def delay_ns(plan: NodeTimetable, *, waiting: int) -> int | None:
    return likely_delay_ns(plan, NODE, waiting=waiting, interval_ns=S, hello_ns=1 * S)


def test_what_waits_before_a_packet_makes_its_delay_longer_by_a_superframe_for_each_two_turns() -> None:
    plan = plan_of(0.0)
    delays = [delay_ns(plan, waiting=waiting) for waiting in (1, 2, 3, 4, 5, 6)]
    assert None not in delays
    first, second, *later = [delay for delay in delays if delay is not None]
    assert first == TURNS.done_ns(plan.roots, span=2)[0] + 50 * MS
    assert later == [first + 100 * MS, second + 100 * MS, first + 200 * MS, second + 200 * MS]


@pytest.mark.parametrize(("missed", "rounds"), [((0.004,), 0), ((0.01, 0.004), 1), ((0.1, 0.01, 0.004), 2)])
def test_each_round_of_repair_is_twice_a_late_hello_and_three_turns_for_answers(
    missed: tuple[float, ...], rounds: int
) -> None:
    calm, found = delay_ns(plan_of(0.0), waiting=1), delay_ns(plan_of(*missed), waiting=1)
    assert calm is not None
    assert found is not None
    call_ns = TURNS.done_ns((20,), span=1)[0]
    assert found - calm == (RIPE_NS if rounds else 0) + rounds * 2 * (1100 * MS + 3 * call_ns)


def test_a_node_that_cannot_answer_or_whose_copies_stay_away_states_no_delay() -> None:
    assert delay_ns(plan_of(0.006), waiting=1) is None
    assert delay_ns(plan_of(0.0, calls=()), waiting=1) is None
