"""Heads judged under a timetable: each has as many turns per superframe as packets come, floods never meet.

The turns begin after the contention window, in which members reach their heads. A turn is one airtime of the longest
packet and the guard time. The flood of a turn lasts its span; floods of other turns run through the swarm meanwhile.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import chain
from math import ceil
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
from fanet_mw.protocol.timetable import Geometry, Timetable, timetable
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId

_SPARE: Final = (Fraction(1, 2), Fraction(1, 4), Fraction(0))
"""Turns beyond one per packet: bursts that wait for the contention window drain by them."""


class Superframe(NamedTuple):
    """Contention window, then turns."""

    period_ns: int
    contention_ns: int
    turn_ns: int

    @property
    def turns(self) -> int:
        return (self.period_ns - self.contention_ns) // self.turn_ns


class Candidate(NamedTuple):
    """A cluster before it has turns: its head, its size, its greatest way to the head, and its classes' shares."""

    head: NodeId
    members: int
    hops: int
    shares: Sequence[Share]


def turns_needed(shares: Sequence[Share], *, period_ns: int, spare: Fraction) -> int:
    """Turns per superframe: one per packet, and `spare` of that more, at least one more where priorities need slack."""
    packets = sum(Fraction(s.sources * period_ns, s.interval_ns) for s in shares)
    several = sum(1 for s in shares if s.sources) > 1
    return max(ceil(packets * (1 + spare)), ceil(packets) + (1 if several and packets.denominator == 1 else 0))


def table_for(
    scenario: Scenario,
    positions: Sequence[tuple[NodeId, Enu]],
    candidates: Sequence[Candidate],
    superframe: Superframe,
) -> Timetable | Refused:
    """The timetable with the turns that all heads need, and up to half as many spare; refused if nothing fits."""
    radio = scenario.radio
    if superframe.turns < 1:
        return Refused(f"a turn of {superframe.turn_ns / 1e6:.1f} ms does not fit behind the contention window")
    geometry = Geometry(
        link_m=radio.range_m,
        interference_m=radio.range_m,
        turns=superframe.turns,
        hop_turns=ceil((superframe.turn_ns + radio.handover_ns + radio.lead_ns) / superframe.turn_ns),
    )
    roots: tuple[NodeId, ...] = ()
    for spare in _SPARE:
        roots = tuple(
            candidate.head
            for candidate in candidates
            for _ in range(turns_needed(candidate.shares, period_ns=superframe.period_ns, spare=spare))
        )
        found = timetable(tuple(positions), roots, geometry)
        if found is not None:
            return found
    return Refused(
        f"the floods of {len(roots)} packets per superframe do not fit {superframe.turns} turns of "
        f"{superframe.turn_ns / 1e6:.2f} ms"
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
    duration_ns = table.spans.get(candidate.head, 1) * superframe.turn_ns
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
