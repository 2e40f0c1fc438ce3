"""Heads judged under a timetable: the turns that the running protocol will give them, and the bound of their gaps.

The table is the one that `scheduled` makes. Who knows the turns knows the longest wait; the flood's span comes on top,
whatever other floods run through the swarm meanwhile.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import NamedTuple

from fanet_mw.protocol.delay import (
    Bounded,
    Outcome,
    Periodic,
    Refused,
    Total,
    TurnServer,
    backlog,
    delay_any_order,
    delay_fifo,
)
from fanet_mw.protocol.planner.flood import FloodCost
from fanet_mw.protocol.planner.head import ClusterPlan, Share
from fanet_mw.protocol.scheduled import fit, largest_frame
from fanet_mw.protocol.timetable import Timetable
from fanet_mw.protocol.turns import Turns, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId


class Superframe(NamedTuple):
    """Contention window, then turns."""

    period_ns: int
    contention_ns: int
    turn_ns: int

    @property
    def turns(self) -> int:
        return max(0, self.period_ns - self.contention_ns) // self.turn_ns


class Candidate(NamedTuple):
    """A cluster before it has turns: its head, its size, its greatest way to the head, and its classes' shares."""

    head: NodeId
    members: int
    hops: int
    shares: Sequence[Share]


def superframe_of(scenario: Scenario, *, period_ns: int) -> Superframe:
    """The geometry of a scenario with this flooding period."""
    turn = turn_ns(scenario, payload_bytes=largest_frame(scenario))
    return Superframe(period_ns, round(scenario.clusters.contention_ms * MS), turn)


def table_for(
    scenario: Scenario,
    positions: Sequence[tuple[NodeId, Enu]],
    members: Mapping[NodeId, int],
    superframe: Superframe,
) -> Timetable | Refused:
    """The running protocol's timetable for heads with so many members; refused when one packet each does not fit."""
    found = fit(scenario, tuple(positions), members, Turns(0, *superframe, superframe.turns))
    if found is not None:
        return found
    return Refused(
        f"one packet of each of {len(members)} heads does not fit {superframe.turns} turns of "
        f"{superframe.turn_ns / 1e6:.2f} ms in {superframe.period_ns / 1e6:g} ms"
    )


def judge(
    table: Timetable, candidate: Candidate, superframe: Superframe, *, lead_ns: int, jitter_ns: int
) -> ClusterPlan:
    """One head: its queue before its turns, then the span of the flood."""
    starts_ns = sorted(
        superframe.contention_ns + turn.offset * superframe.turn_ns
        for turn in table.roots()
        if turn.node == candidate.head
    )
    relays = sum(1 for turn in table.turns if turn.root == candidate.head and turn.instance == 0)
    geometry = Turns(0, *superframe, superframe.turns)
    span = table.spans.get(candidate.head, 1)
    offsets = [turn.offset for turn in table.roots() if turn.node == candidate.head]
    duration_ns = max((geometry.flood_ns(offset, span=span) for offset in offsets), default=superframe.turn_ns)
    server = TurnServer(superframe.turn_ns, superframe.period_ns, tuple(starts_ns), lead_ns)
    delays, waiting = _queue(candidate.shares, server, duration_ns - superframe.turn_ns, jitter_ns)
    packets = sum(s.sources * superframe.period_ns / s.interval_ns for s in candidate.shares)
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=len(starts_ns) * superframe.turn_ns,
        usable_ns=len(starts_ns) * superframe.turn_ns,
        work_ns=round(packets * superframe.turn_ns),
        packets=packets,
        flood=FloodCost(duration_ns, superframe.turn_ns, relays, proven=True),
        delays=tuple(delays),
        backlog=waiting,
    )


def _queue(
    shares: Sequence[Share], server: TurnServer, rest_ns: int, jitter_ns: int
) -> tuple[list[Outcome], int | None]:
    """Per class, most urgent first: the wait for a turn, the turn, and the rest of the flood; most packets waiting."""
    flows = [[Periodic(s.interval_ns, jitter_ns)] * s.sources for s in shares]
    everything = Total(tuple(chain.from_iterable(flows)))
    if not everything.parts:
        return [Bounded(0) for _ in shares], None
    server.check()
    alone = sum(1 for row in flows if row) == 1
    delays: list[Outcome] = []
    for index, row in enumerate(flows):
        if not row:
            delays.append(Bounded(0))
            continue
        before = Total((*chain.from_iterable(flows[:index]), *row[1:]))
        queue = delay_fifo(everything, server) if alone else delay_any_order(row[0], before, server)
        delays.append(queue if isinstance(queue, Refused) else Bounded(queue.delay_ns + rest_ns))
    waiting = backlog(everything, server)
    return delays, None if isinstance(waiting, Refused) else waiting
