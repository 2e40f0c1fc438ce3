"""Heads judged under a timetable: the turns that the running protocol will give them, and the bound of their gaps.

The table is the one that `scheduled` makes. Who knows the turns knows the longest wait; the flood's span comes on top,
whatever other floods run through the swarm meanwhile.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Final, NamedTuple

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
from fanet_mw.protocol.packing import Effort
from fanet_mw.protocol.planner.flood import FloodCost
from fanet_mw.protocol.planner.head import ClusterPlan, Share
from fanet_mw.protocol.timetable import Timetable, timetable
from fanet_mw.protocol.turn_plan import Fitted, Places, fit, links, superframe
from fanet_mw.protocol.turns import Turns
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId

_MOST_TURNS: Final = 20_000


class Candidate(NamedTuple):
    """A cluster before it has turns: its head, its size, its greatest way to the head, and its classes' shares."""

    head: NodeId
    members: int
    hops: int
    shares: Sequence[Share]


class Superframe(NamedTuple):
    """The timetable of a plan: its geometry, and how full it is."""

    turns: Turns
    used: int
    """Turns in which some node sends; 0: there is no table."""
    packets: int
    """Root turns per superframe."""
    table: Timetable | None
    together: int = 1
    """Packets that a turn holds."""
    least_interval_ns: int | None = None
    """The traffic interval down to which everything arrives, when it was asked for."""


def table_for(
    scenario: Scenario, places: Places, head_of: Mapping[NodeId, NodeId], *, quick: bool = False
) -> Fitted | Refused:
    """The running protocol's timetable for nodes with these heads; refused when one packet of each does not fit.

    `quick`: also when the load does not.
    """
    found = fit(scenario, places, head_of, quick=quick)
    if found is not None:
        return found
    turns = superframe(scenario)
    unlimited = Turns(0, turns.period_ns, 0, turns.turn_ns, _MOST_TURNS)
    roots = tuple(sorted({scenario.leader, *head_of.values()}))
    table = timetable(places, roots, links(scenario, unlimited), (), Effort(pace=0.0))
    needed = f"{table.used}" if table else f"more than {_MOST_TURNS}"
    return Refused(
        f"one packet of each of {len(roots)} roots needs {needed} turns of {turns.turn_ns / 1e6:.3f} ms, "
        f"a superframe has {turns.per_frame}"
    )


def judge(
    found: Fitted, candidate: Candidate, *, lead_ns: int, receipt_ns: int, jitter_ns: int, control: int = 0
) -> ClusterPlan:
    """One root: its queue before its turns, then the span of the flood, then up to `receipt_ns` until applications
    have it. `control`: more urgent packets per period.

    A turn that lets out k packets counts as k parts of it, one packet each. A packet must be announced before the whole
    turn, which counts as a longer lead; and all of them are through when the turn is.
    """
    table, turns, together = found.table, found.turns, found.together
    part_ns = turns.turn_ns // together
    starts_ns = sorted(
        turns.start_ns(turn.offset, frame_start_ns=0) for turn in table.roots() if turn.node == candidate.head
    )
    parts_ns = tuple(start_ns + part * part_ns for start_ns in starts_ns for part in range(together))
    relays = sum(1 for turn in table.turns if turn.root == candidate.head and turn.instance == 0)
    span = table.spans.get(candidate.head, 1)
    offsets = [turn.offset for turn in table.roots() if turn.node == candidate.head]
    duration_ns = max((turns.flood_ns(offset, span=span) for offset in offsets), default=turns.turn_ns)
    server = TurnServer(part_ns, turns.period_ns, parts_ns, lead_ns + turns.turn_ns - part_ns)
    delays, waiting = _queue(candidate.shares, server, duration_ns - part_ns + receipt_ns, jitter_ns, control)
    if not jitter_ns and not control and sum(s.sources for s in candidate.shares) == 1:
        delays = [_alone(s, turns, sorted(offsets), span, together, lead_ns + receipt_ns) for s in candidate.shares]
    packets = sum(s.sources * turns.period_ns / s.interval_ns for s in candidate.shares)
    packets += control if packets else 0
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=len(starts_ns) * turns.turn_ns,
        usable_ns=len(starts_ns) * turns.turn_ns,
        work_ns=round(packets * part_ns),
        packets=packets,
        flood=FloodCost(duration_ns, turns.turn_ns, relays, proven=True),
        delays=tuple(delays),
        backlog=waiting,
    )


def _alone(share: Share, turns: Turns, offsets: Sequence[int], span: int, together: int, around_ns: int) -> Outcome:
    """What the node itself computes for its only class: the longest wait need not be for the longest flood."""
    if not share.sources:
        return Bounded(0)
    worst_ns = turns.worst_ns(offsets, span=span, interval_ns=share.interval_ns, together=together)
    if worst_ns is None:
        return Refused(f"{len(offsets) * together} packets are let out per superframe, more come")
    return Bounded(worst_ns + around_ns)


def _queue(
    shares: Sequence[Share], server: TurnServer, rest_ns: int, jitter_ns: int, control: int
) -> tuple[list[Outcome], int | None]:
    """Per class, most urgent first: the wait for a turn, the turn, and the rest of the flood; most packets waiting."""
    flows = [[Periodic(s.interval_ns, jitter_ns)] * s.sources for s in shares]
    if not any(flows):
        return [Bounded(0) for _ in shares], None
    urgent = [Periodic(server.period_ns, 0)] * control
    everything = Total((*urgent, *chain.from_iterable(flows)))
    server.check()
    alone = not urgent and sum(1 for row in flows if row) == 1
    delays: list[Outcome] = []
    for index, row in enumerate(flows):
        if not row:
            delays.append(Bounded(0))
            continue
        before = Total((*urgent, *chain.from_iterable(flows[:index]), *row[1:]))
        queue = delay_fifo(everything, server) if alone else delay_any_order(row[0], before, server)
        delays.append(queue if isinstance(queue, Refused) else Bounded(queue.delay_ns + rest_ns))
    waiting = backlog(everything, server)
    return delays, None if isinstance(waiting, Refused) else waiting
