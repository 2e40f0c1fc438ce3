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
from fanet_mw.protocol.planner.flood import FloodCost
from fanet_mw.protocol.planner.head import ClusterPlan, Share
from fanet_mw.protocol.scheduled import fit, largest_frame, links, schedule_parts
from fanet_mw.protocol.timetable import Timetable, timetable
from fanet_mw.protocol.turns import Turns, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, seconds_to_ns

_MOST_TURNS: Final = 20_000
Places = tuple[tuple[NodeId, Enu], ...]
"""Where the nodes are, ascending."""


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
    """Packets that the roots let out per superframe."""
    table: Timetable | None
    least_interval_ns: int | None = None
    """The traffic interval down to which everything arrives, when it was asked for."""


def superframe_of(scenario: Scenario) -> Turns:
    """The geometry of a scenario."""
    turn = turn_ns(scenario, payload_bytes=largest_frame(scenario))
    period_ns, contention_ns = scenario.clusters.period_ns, round(scenario.clusters.contention_ms * 1_000_000)
    return Turns(0, period_ns, contention_ns, turn, max(0, period_ns - contention_ns) // turn)


def table_for(scenario: Scenario, places: Places, members: Mapping[NodeId, int]) -> Timetable | Refused:
    """The running protocol's timetable for heads with so many members; refused when one packet each does not fit."""
    turns = superframe_of(scenario)
    found = fit(scenario, places, members, turns)
    if found is not None:
        return found
    unlimited = Turns(0, turns.period_ns, 0, turns.turn_ns, _MOST_TURNS)
    table = timetable(places, tuple(sorted(members)), links(scenario, unlimited))
    needed = f"{table.used}" if table else f"more than {_MOST_TURNS}"
    return Refused(
        f"one packet of each of {len(members)} roots needs {needed} turns of {turns.turn_ns / 1e6:.3f} ms, "
        f"a superframe has {turns.per_frame}"
    )


def least_interval_ns(scenario: Scenario, places: Places, members: Mapping[NodeId, int]) -> int | None:
    """The traffic interval down to which as many packets as come fit the turns; looked for up to twice the load."""
    turns = superframe_of(scenario)
    geometry = links(scenario, turns)
    largest = max(members.values())
    enough = 2 * largest * turns.period_ns / seconds_to_ns(scenario.traffic.interval_s)
    best = 0
    for packets in range(1, turns.per_frame // len(members) * largest + 2):
        control = {scenario.leader: schedule_parts(scenario)}
        roots = tuple(
            root for root, n in sorted(members.items()) for _ in range(control.get(root, 0) + (packets if n else 0))
        )
        if not turns.per_frame or timetable(places, roots, geometry) is None:
            break
        best = packets
        if packets > enough:
            break
    return -(-turns.period_ns * largest // best) if best else None


def judge(
    table: Timetable, candidate: Candidate, turns: Turns, *, lead_ns: int, jitter_ns: int, control: int = 0
) -> ClusterPlan:
    """One head: its queue before its turns, then the span of the flood. `control`: more urgent packets per period."""
    starts_ns = sorted(
        turns.start_ns(turn.offset, frame_start_ns=0) for turn in table.roots() if turn.node == candidate.head
    )
    relays = sum(1 for turn in table.turns if turn.root == candidate.head and turn.instance == 0)
    span = table.spans.get(candidate.head, 1)
    offsets = [turn.offset for turn in table.roots() if turn.node == candidate.head]
    duration_ns = max((turns.flood_ns(offset, span=span) for offset in offsets), default=turns.turn_ns)
    server = TurnServer(turns.turn_ns, turns.period_ns, tuple(starts_ns), lead_ns)
    delays, waiting = _queue(candidate.shares, server, duration_ns - turns.turn_ns, jitter_ns, control)
    packets = sum(s.sources * turns.period_ns / s.interval_ns for s in candidate.shares)
    packets += control if packets else 0
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=len(starts_ns) * turns.turn_ns,
        usable_ns=len(starts_ns) * turns.turn_ns,
        work_ns=round(packets * turns.turn_ns),
        packets=packets,
        flood=FloodCost(duration_ns, turns.turn_ns, relays, proven=True),
        delays=tuple(delays),
        backlog=waiting,
    )


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
