"""Admission: the shortest interval that meets a deadline, who is refused, and what is said when it is lost."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.admission import Admission, least_interval_ns
from fanet_mw.routing.clustered.timetable.own_bound import RootTurns
from fanet_mw.trace import DeadlineLost, DeadlineMet
from fanet_mw.units import MS, Enu, NodeId, S
from sim.scenarios import catalog

ME = NodeId(7)
EXPECTED_NS = 8 * S


@st.composite
def owns(draw) -> RootTurns:
    per_superframe = draw(st.integers(4, 60))
    turns = Turns(0, (40 + 2 * per_superframe) * MS, 40 * MS, 2 * MS, per_superframe)
    roots = draw(st.sets(st.integers(0, per_superframe - 1), min_size=1, max_size=6))
    return RootTurns(turns, tuple(sorted(roots)), draw(st.integers(1, per_superframe)))


@given(owns(), st.integers(1 * MS, 600 * MS))
def test_the_least_interval_meets_the_deadline_and_nothing_shorter_does(own: RootTurns, deadline_ns: int) -> None:
    least = least_interval_ns(own, deadline_ns=deadline_ns)
    if least is None:
        assert own.turns.worst_ns(own.roots, span=own.span, interval_ns=10 * S) > deadline_ns
        return
    assert own.turns.worst_ns(own.roots, span=own.span, interval_ns=least) <= deadline_ns
    shorter = own.turns.worst_ns(own.roots, span=own.span, interval_ns=least - 1)
    assert shorter is None or shorter > deadline_ns


def test_packets_that_come_too_soon_are_refused_and_do_not_count() -> None:
    own = RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0,), 10)
    admission = Admission(ME, deadline_ns=600 * MS, interval_ns=1 * S, expected_ns=EXPECTED_NS)
    assert admission.admit(0), "until a timetable is in force everyone may send"
    assert admission.follow(own, now_ns=0) == DeadlineMet(0, ME, 520 * MS, 600 * MS, 1 * S)
    born = range(1000 * MS, 3001 * MS, 100 * MS)
    assert [t for t in born if admission.admit(t)] == [1000 * MS, 1500 * MS, 2000 * MS, 2500 * MS, 3000 * MS]


def test_packets_that_each_come_a_little_too_soon_do_not_add_up() -> None:
    """Half a microsecond is rounding, again and again it is a higher rate."""
    own = RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0,), 10)
    admission = Admission(ME, deadline_ns=600 * MS, interval_ns=500 * MS, expected_ns=EXPECTED_NS)
    admission.follow(own, now_ns=0)
    admitted = [admission.admit(number * (500 * MS - 500)) for number in range(10)]
    assert admitted[:2] == [True, True]
    assert False in admitted


def test_a_deadline_is_lost_and_met_again_with_the_timetable_and_said_once_each() -> None:
    near, far = (RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0,), span) for span in (10, 60))
    admission = Admission(ME, deadline_ns=600 * MS, interval_ns=1 * S, expected_ns=EXPECTED_NS)
    said = [admission.follow(own, now_ns=t) for t, own in enumerate((near, near, far, far, None, near))]
    assert [type(record) for record in said if record] == [DeadlineMet, DeadlineLost, DeadlineMet]
    assert [record.t_ns for record in said if record] == [0, 2, 5]
    assert said[2].bound_ns == 620 * MS


def test_where_no_rate_meets_the_deadline_what_the_turns_carry_is_let_in() -> None:
    admission = Admission(ME, deadline_ns=100 * MS, interval_ns=1 * S, expected_ns=EXPECTED_NS)
    lost = admission.follow(RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0, 100), 10), now_ns=0)
    assert isinstance(lost, DeadlineLost)
    assert [t for t in range(0, 1001 * MS, 50 * MS) if admission.admit(t)] == [0, 250 * MS, 500 * MS, 750 * MS, S]


def test_before_there_should_be_a_bound_its_absence_is_not_said_and_then_once() -> None:
    admission = Admission(ME, deadline_ns=600 * MS, interval_ns=1 * S, expected_ns=EXPECTED_NS)
    admission.start(2 * S)
    due_ns = 2 * S + EXPECTED_NS
    assert admission.follow(None, now_ns=4 * S) is None
    assert admission.next_wake_ns() == due_ns
    assert admission.wake(due_ns - 1) is None
    assert admission.wake(due_ns) == DeadlineLost(due_ns, ME, 0, 600 * MS, 1 * S)
    assert admission.next_wake_ns() is None
    assert admission.follow(None, now_ns=due_ns + S) is None
    own = RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0,), 10)
    assert isinstance(admission.follow(own, now_ns=due_ns + 2 * S), DeadlineMet)
    assert isinstance(admission.follow(None, now_ns=due_ns + 3 * S), DeadlineLost)


def test_who_had_a_bound_says_at_once_that_it_is_gone() -> None:
    admission = Admission(ME, deadline_ns=600 * MS, interval_ns=1 * S, expected_ns=EXPECTED_NS)
    admission.start(0)
    own = RootTurns(Turns(0, 500 * MS, 40 * MS, 2 * MS, 230), (0,), 10)
    assert isinstance(admission.follow(own, now_ns=4 * S), DeadlineMet)
    assert admission.next_wake_ns() is None
    assert isinstance(admission.follow(None, now_ns=5 * S), DeadlineLost)


@pytest.mark.parametrize(("node", "sources", "says"), [(2, 8, True), (1, 8, False), (1, "all", True)])
def test_who_has_packets_of_its_own_says_so_if_no_timetable_comes_for_them(
    node: int, sources: object, says: bool
) -> None:
    """A leader, node 1 here, is in no cluster: its packets have turns only where it is named as a source."""
    keys = ["nodes.count=9", "clusters.count=8", "traffic.deadline_s=1", f"traffic.sources={json.dumps(sources)}"]
    alone = Node(NodeId(node), catalog.find("clusters", keys), make_protocol, position=Enu(0, 0, 50))
    alone.start(0)
    while (wake_ns := alone.next_wake_ns()) is not None and wake_ns < 30 * S:
        alone.wake(wake_ns)
    assert any(isinstance(record, DeadlineLost) for record in alone.records) == says
