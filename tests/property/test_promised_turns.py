"""What a root says of a packet when it takes it holds, whatever comes later: of any class, at any time, in any number.

The queue is driven as its host drives it, with random timetables of which one replaces another on the way.
"""

from typing import NamedTuple

import pytest
from graph_radio import Swarm
from hypothesis import example, given
from hypothesis import strategies as st
from kit import examples

from fanet_mw import wire
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.own_bound import BURST, RootTurns
from fanet_mw.routing.clustered.timetable.turn_release import RootRelease, TurnsInForce
from fanet_mw.scenario import Routing, config
from fanet_mw.trace import BoundStated
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, PRIORITY_REPORT, PRIORITY_SAFETY, Header, Kind

ME = NodeId(7)
ROOMS = {PRIORITY_SAFETY: 60, PRIORITY_REPORT: 80}
BULK_BYTES = 200
SIZES = {PRIORITY_CONTROL: 70, PRIORITY_SAFETY: 60, PRIORITY_REPORT: 80, PRIORITY_BULK: BULK_BYTES}


class Case(NamedTuple):
    """Two timetables, the instant of the change, and (instant, class) of what comes."""

    plans: tuple[TurnsInForce, TurnsInForce]
    lead_ns: int
    arrivals: list[tuple[int, int]]


@st.composite
def followings(draw: st.DrawFn, valid_ns: int) -> TurnsInForce:
    per_superframe = draw(st.integers(6, 40))
    turns = Turns(valid_ns, (40 + 2 * per_superframe + draw(st.integers(0, 9))) * MS, 40 * MS, 2 * MS, per_superframe)
    offsets = draw(st.sets(st.integers(0, per_superframe - 1), min_size=1, max_size=3))
    together = draw(st.integers(1, 3))
    return TurnsInForce(
        valid_ns, turns, tuple(sorted(offsets)), together * BULK_BYTES + sum(ROOMS.values()), draw(st.integers(1, 30))
    )


@st.composite
def cases(draw: st.DrawFn) -> Case:
    change_ns = draw(st.integers(100, 900)) * MS
    plans = draw(followings(0)), draw(followings(change_ns))
    times = draw(st.lists(st.integers(0, 1500).map(lambda t: t * MS), min_size=1, max_size=25))
    classes = st.sampled_from((PRIORITY_CONTROL, PRIORITY_SAFETY, PRIORITY_REPORT, PRIORITY_BULK))
    return Case(plans, draw(st.integers(0, 60)) * MS, [(t, draw(classes)) for t in sorted(times)])


def packet(seq: int, priority: int, born_ns: int) -> Packet:
    kind = Kind.JOIN if priority == PRIORITY_CONTROL else Kind.DATA
    header = Header(born_ns // 1000, seq, ME, 0xFFFF, ME, kind, 32, 0, priority, 0)
    return Packet(header, header.encode().ljust(SIZES[priority], b"\0"))


class Run(NamedTuple):
    """By sequence number: what was said, and when the flood was over."""

    said_ns: dict[int, int]
    through_ns: dict[int, int]
    born_ns: dict[int, int]


def drive(case: Case) -> Run:
    release = RootRelease(ME, TxQueue(Routing(queue_frames=1000)), reserved=ROOMS, lead_ns=case.lead_ns)
    release.follow(case.plans, now_ns=0)
    run = Run({}, {}, {})

    def let_out(until_ns: int) -> None:
        while (wake_ns := release.next_wake_ns()) is not None and wake_ns < until_ns:
            for packets, start_ns in release.due(now_ns=wake_ns):
                plan = max((p for p in case.plans if p.valid_ns <= start_ns), key=lambda p: p.valid_ns)
                offset = plan.turns.turn_at(start_ns)
                assert offset in plan.offsets, "only turns of ours are used"
                end_ns = start_ns + plan.turns.flood_ns(offset, span=plan.span)
                assert plan is case.plans[1] or end_ns <= case.plans[1].valid_ns, "no flood outlives its timetable"
                assert sum(len(p.frame) for p in packets) <= plan.frame_bytes
                run.through_ns.update({p.header.seq: end_ns for p in packets})

    for seq, (now_ns, priority) in enumerate(case.arrivals):
        let_out(now_ns)
        run.born_ns[seq] = now_ns
        taken = packet(seq, priority, now_ns)
        release.push(taken, now_ns=now_ns)
        said_ns = release.through_ns(taken, now_ns=now_ns)
        assert said_ns is not None
        run.said_ns[seq] = said_ns
    let_out(1 << 60)
    assert len(release) == 0
    return run


@examples(20)
@given(cases())
@example(
    Case(
        (
            TurnsInForce(0, Turns(0, 100 * MS, 40 * MS, 2 * MS, 30), (5,), 340, 3),
            TurnsInForce(900 * MS, Turns(900 * MS, 100 * MS, 40 * MS, 2 * MS, 30), (9,), 340, 3),
        ),
        0,
        [(0, PRIORITY_BULK), (0, PRIORITY_REPORT), (1 * MS, PRIORITY_REPORT), (2 * MS, PRIORITY_SAFETY)],
    )
)
def test_no_packet_is_through_later_than_was_said_when_it_was_taken(case: Case) -> None:
    run = drive(case)
    assert run.through_ns.keys() == run.said_ns.keys()
    for seq, said_ns in run.said_ns.items():
        assert run.through_ns[seq] <= said_ns


@examples(12)
@given(cases())
def test_who_finds_fewer_than_a_burst_of_its_class_waiting_keeps_the_bound_of_a_burst(case: Case) -> None:
    """One timetable, and at most so many reports within any superframe that fewer than `BURST` wait."""
    plan = case.plans[0]._replace(span=3)
    single = case._replace(plans=(plan, plan._replace(valid_ns=1 << 50)), arrivals=[])
    gap_ns = plan.turns.period_ns
    reports = [(n * gap_ns // BURST * BURST, PRIORITY_REPORT) for n in range(12)]
    bulk = [(n * 3 * MS, PRIORITY_BULK) for n in range(50)]
    run = drive(single._replace(arrivals=sorted(reports + bulk)))
    bound_ns = RootTurns(plan.turns, plan.offsets, plan.span, 1, case.lead_ns).burst_ns(per_turn=1)
    classes = [priority for _, priority in sorted(reports + bulk)]
    delays = [run.through_ns[s] - run.born_ns[s] for s, priority in enumerate(classes) if priority == PRIORITY_REPORT]
    assert max(delays) <= bound_ns


SCHEDULED = config.build(
    {
        "nodes": {"count": 9, "telemetry_hz": 0},
        "clusters": {"relay": "scheduled", "count": 8, "flooding_period_s": 0.5},
        "radio": {"lead_ms": 0, "range_m": 310}, "traffic": {"payload_bytes": 200, "interval_s": 1.0},
    }
)  # fmt: skip


@pytest.mark.parametrize(("to", "priority"), [(BROADCAST, PRIORITY_BULK), (7, PRIORITY_BULK), (9, PRIORITY_BULK)])
def test_who_has_a_timetable_states_when_a_packet_is_there_be_it_for_all_a_neighbor_or_far_away(
    to: int, priority: int
) -> None:
    """In spare turns or as a flood; and it is there by then, where nothing is lost."""
    swarm = Swarm(SCHEDULED, [Enu(180.0 * (n % 3), 180.0 * (n // 3), 50.0) for n in range(9)])
    for node in range(1, 10):
        swarm.start(node)
    swarm.advance(10 * S)
    four = swarm.nodes[NodeId(4)]
    four.records.clear()
    sent_ns = swarm.now_ns
    four.send(
        wire.filler(60), destination=NodeId(to), priority=priority, app="traffic", born_ns=sent_ns, now_ns=sent_ns
    )
    ((bound_ns, seq),) = [(said.bound_ns, said.seq) for said in four.records if isinstance(said, BoundStated)]
    swarm._drain(NodeId(4))
    swarm.advance(bound_ns)
    boots = {boot: node for node, boot in swarm._boots.items()}
    there = {boots[boot] for boot, *name in swarm.delivered if name == [4, seq]}
    assert there == ({node for node in range(1, 10) if node != 4} if to == BROADCAST else {to})
