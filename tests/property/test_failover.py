"""Clusters survive: real nodes over a graph, and any sequence of what can happen to a swarm."""

from collections import Counter

import pytest
from graph_radio import Swarm
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from fanet_mw.routing.clustered.roles import failover
from fanet_mw.routing.clustered.roles.states import TRANSITIONS, Event, Row, State, step
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import Enu, NodeId, S

NODES = 7
SETTLED_S = 60
"""Calm after which all is well again, in superframes of 1 s: 4 s of a leader's silence, 3 s until somebody stands, 4 s
of joins, once more when parts have met; and 45 s until the leader forgets the dead, of whom it may have made heads."""


def scenario(**clusters: object) -> Scenario:
    return config.build(
        {
            "nodes": {"count": NODES, "telemetry_hz": 0},
            "clusters": {"count": 2, "flooding_period_s": 1.0, **clusters},
            "radio": {"lead_ms": 0, "range_m": 310},
        }
    )


def line(step_m: float = 150.0) -> list[Enu]:
    return [Enu(step_m * k, 0.0, 50.0) for k in range(NODES)]


def settled_swarm(**clusters: object) -> Swarm:
    """A line of nodes, 300 m between every other, that has settled."""
    swarm = Swarm(scenario(**clusters), line())
    for node in range(1, NODES + 1):
        swarm.start(node)
    swarm.advance(15 * S)
    assert swarm.settled() == []
    return swarm


def head_of(swarm: Swarm, node: int) -> NodeId:
    return NodeId(swarm.protocol(NodeId(node)).report()["head"])


def calm(swarm: Swarm, most_s: int = SETTLED_S) -> int:
    """Wait until all is well; how many seconds that took."""
    for second in range(most_s + 1):
        if not swarm.settled():
            return second
        swarm.advance(1 * S)
    raise AssertionError(f"after {most_s} superframes of calm: {swarm.settled()}")


# --- timelines ----------------------------------------------------------------------------------------------------


def test_a_backup_takes_over_a_dead_head_s_slot_before_the_leader_confirms() -> None:
    swarm = settled_swarm()
    head = head_of(swarm, 3)
    epoch = swarm.protocol(NodeId(1)).report()["epoch"]
    cluster = swarm.protocol(head).report()["cluster"]
    swarm.kill(head)
    swarm.advance(int(4.2 * S))
    acting = [n for n in sorted(swarm.nodes) if swarm.protocol(n).report()["state"] == "acting"]
    assert len(acting) == 1
    assert swarm.protocol(acting[0]).report()["cluster"] == cluster
    assert swarm.protocol(acting[0]).report()["epoch"] == epoch
    swarm.advance(4 * S)
    assert swarm.settled() == []
    assert swarm.protocol(acting[0]).report()["state"] == "head", "confirmed"


def test_unicasts_that_fail_make_the_backup_act_sooner() -> None:
    swarm = settled_swarm()
    head = head_of(swarm, 3)
    near = next(n for n in swarm.neighbors(head) if n != 1)
    swarm.kill(head)
    for _ in range(26):
        swarm.send(near)
        swarm.advance(S // 10)
    assert any(swarm.protocol(n).report()["state"] == "acting" for n in sorted(swarm.nodes))


def test_a_new_leader_is_elected_and_a_restarted_one_is_junior() -> None:
    swarm = settled_swarm()
    swarm.kill(1)
    swarm.advance(20 * S)
    assert swarm.settled() == []
    assert {swarm.protocol(n).report()["leader"] for n in sorted(swarm.nodes)} == {2}
    swarm.start(1)
    swarm.advance(12 * S)
    assert swarm.settled() == []
    assert {swarm.protocol(n).report()["leader"] for n in sorted(swarm.nodes)} == {2}


def test_parts_lead_themselves_and_the_senior_leader_keeps_the_whole() -> None:
    swarm = settled_swarm()
    swarm.walls = {frozenset((NodeId(a), NodeId(b))) for a in (1, 2, 3) for b in (4, 5, 6, 7)}
    calm(swarm, 30)
    assert {swarm.protocol(NodeId(n)).report()["leader"] for n in (1, 2, 3)} == {1}
    assert {swarm.protocol(NodeId(n)).report()["leader"] for n in (4, 5, 6, 7)} == {4}
    swarm.walls = set()
    swarm.advance(10 * S)
    assert swarm.settled() == []
    assert {swarm.protocol(n).report()["leader"] for n in sorted(swarm.nodes)} == {1}


def test_a_head_that_was_only_out_of_reach_objects_and_keeps_its_slot() -> None:
    swarm = settled_swarm()
    head = head_of(swarm, 3)
    others = [n for n in sorted(swarm.nodes) if n != head]
    swarm.walls = {frozenset((head, n)) for n in others}
    swarm.advance(5 * S)
    assert any(swarm.protocol(n).report()["state"] == "acting" for n in others)
    swarm.walls = set()
    swarm.advance(6 * S)
    assert swarm.settled() == []
    assert head_of(swarm, 3) in (head, *others)


def test_a_swarm_at_rest_keeps_its_epoch_and_floods_only_announcements() -> None:
    swarm = settled_swarm()
    before = swarm.protocol(NodeId(1)).report()["epoch"]
    swarm.relayed.clear()
    for _ in range(60):
        for node in range(1, NODES + 1):
            swarm.send(node)
        swarm.advance(1 * S)
    assert swarm.protocol(NodeId(1)).report()["epoch"] == before
    assert {seq for _, _, seq in swarm.relayed if seq >= 1 << 31} == set(), "no joins"


def test_a_swarm_that_turns_inside_out_gets_other_clusters_at_a_bounded_rate() -> None:
    swarm = settled_swarm(reassign_s=5)
    before = swarm.protocol(NodeId(1)).report()["epoch"]
    for node, place in zip((2, 5, 3, 6, 4, 7), line()[1:], strict=True):
        swarm.move(node, place)
    swarm.advance(30 * S)
    assert swarm.settled() == []
    assert 1 <= swarm.protocol(NodeId(1)).report()["epoch"] - before <= 6


def timetabled() -> Swarm:
    """Every node a head, the leader in the middle of a line: whoever dies between it and the others is a relay."""
    return settled_swarm(relay="scheduled", count=NODES - 1)


def listed(swarm: Swarm, node: int) -> bool:
    return swarm.membership(NodeId(1)).lists(node)


def joins(swarm: Swarm) -> set[tuple[int, int]]:
    """(origin, sequence number) of all control floods but announcements, once each."""
    return {(origin, seq) for _, origin, seq in swarm.relayed if seq >= 1 << 31}


def busy(swarm: Swarm, for_s: int) -> None:
    """All send something every second, so nobody need show otherwise that it keeps the timetable."""
    for _ in range(for_s):
        for node in swarm.nodes:
            swarm.send(node)
        swarm.advance(1 * S)


def test_a_dead_relay_leaves_the_timetable_as_soon_as_its_neighbors_miss_it() -> None:
    swarm = timetabled()
    swarm.relayed.clear()
    swarm.kill(3)
    busy(swarm, 4)
    assert listed(swarm, 3)
    busy(swarm, 8)
    assert not listed(swarm, 3)
    assert swarm.settled() == []
    assert max(Counter(origin for origin, _ in joins(swarm)).values()) == 1, "nobody says it twice"


def test_a_node_that_one_neighbor_no_longer_hears_keeps_its_place_unreported() -> None:
    """Its packets arrive another way."""
    swarm = timetabled()
    swarm.walls = {frozenset((NodeId(3), NodeId(2)))}
    epoch = swarm.protocol(NodeId(1)).report()["epoch"]
    swarm.relayed.clear()
    busy(swarm, 16)
    assert joins(swarm) == set()
    assert all(listed(swarm, node) for node in range(2, NODES + 1))
    assert swarm.protocol(NodeId(1)).report()["epoch"] == epoch


def test_who_has_nothing_to_send_shows_that_it_keeps_the_timetable() -> None:
    swarm = timetabled()
    swarm.relayed.clear()
    swarm.advance(16 * S)
    said = Counter(origin for origin, _ in joins(swarm))
    assert sorted(said) == list(range(2, NODES + 1)), "the leader announces the timetable in each superframe"
    assert all(4 <= times <= 10 for times in said.values()), "within five superframes, and not in each"


# --- the table ----------------------------------------------------------------------------------------------------


def test_the_running_nodes_take_rows_of_the_table_only_and_most_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: Counter[tuple[State, Event]] = Counter()

    def watched(state: State, event: Event) -> Row:
        taken[state, event] += 1
        return step(state, event)

    monkeypatch.setattr(failover, "step", watched)
    for test in (
        test_a_backup_takes_over_a_dead_head_s_slot_before_the_leader_confirms,
        test_a_new_leader_is_elected_and_a_restarted_one_is_junior,
        test_parts_lead_themselves_and_the_senior_leader_keeps_the_whole,
        test_a_head_that_was_only_out_of_reach_objects_and_keeps_its_slot,
    ):
        test()
    assert set(taken) <= set(TRANSITIONS)
    assert len(taken) >= 15


def test_a_state_without_a_row_for_an_event_is_our_mistake() -> None:
    with pytest.raises(AssertionError, match="leading has no transition"):
        step(State.LEADING, Event.HEAD_SILENT)


# --- anything in any order ----------------------------------------------------------------------------------------

nodes = st.integers(1, NODES)


class AnySwarm(RuleBasedStateMachine):
    """Joins, deaths, restarts, moves, walls and losses; then calm."""

    @initialize(started=st.sets(nodes, min_size=2), relay=st.sampled_from(["all", "counter", "scheduled"]))
    def begin(self, started: set[int], relay: str) -> None:
        self.swarm = Swarm(scenario(relay=relay, assess_ms=50, resume=False, repair_s=0), line())
        for node in sorted(started):
            self.swarm.start(node)

    @rule(node=nodes)
    def starts_or_dies(self, node: int) -> None:
        if NodeId(node) in self.swarm.nodes:
            self.swarm.kill(node)
        else:
            self.swarm.start(node)

    @rule(node=nodes)
    def restarts(self, node: int) -> None:
        if NodeId(node) in self.swarm.nodes:
            self.swarm.kill(node)
            self.swarm.start(node)

    @rule(node=nodes, east=st.integers(0, 900), north=st.integers(0, 200))
    def moves(self, node: int, east: int, north: int) -> None:
        self.swarm.move(node, Enu(east, north, 50.0))

    @rule(side=st.sets(nodes, max_size=NODES // 2))
    def falls_apart_or_meets(self, side: set[int]) -> None:
        rest = set(range(1, NODES + 1)) - side
        self.swarm.walls = {frozenset((NodeId(a), NodeId(b))) for a in sorted(side) for b in sorted(rest)}

    @rule(loss=st.sampled_from([0.0, 0.1, 0.4]))
    def hears_worse(self, loss: float) -> None:
        self.swarm.loss = loss

    @rule(node=nodes)
    def sends(self, node: int) -> None:
        if NodeId(node) in self.swarm.nodes:
            self.swarm.send(node)

    @rule(tenths=st.sampled_from([1, 7, 30, 100, 250]))
    def lives_on(self, tenths: int) -> None:
        self.swarm.advance(tenths * S // 10)

    @precondition(lambda self: self.swarm.nodes)
    @rule()
    def is_well_after_calm(self) -> None:
        self.swarm.loss = 0.0
        calm(self.swarm)

    @invariant()
    def nothing_happens_twice(self) -> None:
        if hasattr(self, "swarm"):
            self.swarm.never_twice()

    def teardown(self) -> None:
        if hasattr(self, "swarm") and self.swarm.nodes:
            self.swarm.loss = 0.0
            calm(self.swarm)
            self.swarm.never_twice()


def _case(examples: int, steps: int) -> type:
    class Case(AnySwarm):
        """Sized for hypothesis."""

    found = Case.TestCase
    found.settings = settings(
        max_examples=examples, stateful_step_count=steps, deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
    )  # fmt: skip
    return found


TestAnySwarm = _case(10, 12)
TestAnySwarmForLong = pytest.mark.slow(_case(400, 25))
