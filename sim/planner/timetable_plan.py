"""Plans heads with a timetable: the turns that the protocol will give them in flight, and the bounds that follow.

The timetable is the one that `clusters.relay = "scheduled"` computes. The known turns give the longest wait for a turn.
To that is added the duration of the flood, which does not depend on other floods in the swarm.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.bounds import (
    Bounded,
    DelayBound,
    Periodic,
    Refused,
    Total,
    TurnServer,
    backlog,
    delay_any_order,
    delay_fifo,
)
from fanet_mw.routing.clustered.tdma.turn_timing import Turns, turn_slack_ns
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable
from fanet_mw.routing.clustered.timetable.own_bound import RootTurns
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn, timetable
from fanet_mw.routing.clustered.timetable.turn_allocation import Places, fit
from fanet_mw.routing.clustered.timetable.turn_size import links, superframe
from fanet_mw.scenario import Scenario
from fanet_mw.units import US, NodeId
from sim.planner.flood_cost import FloodCost
from sim.planner.head_slot import ClassLoad, ClusterPlan
from sim.planner.variant import vary

_MOST_TURNS: Final = 20_000
_LEAST_SLACK_US: Final = 20
"""With less slack than this nothing would remain for propagation and detection."""
_SPARE_TURNS: Final = (1.0, 1.05)
"""Numbers of turns to try, as multiples of those needed in an endless superframe, because its end costs some turns."""


class Candidate(NamedTuple):
    """A cluster without turns yet: its head and size, the most hops to the head, and the load of each class."""

    head: NodeId
    members: int
    hops: int
    shares: Sequence[ClassLoad]


class TimetablePlan(NamedTuple):
    """The timetable of a plan: the geometry of its superframe, and how full it is."""

    turns: Turns
    used: int
    """The number of turns in which some node transmits; 0 without a timetable."""
    packets: int
    """The number of root turns per superframe, in each of which a flood begins."""
    table: Timetable | None
    together: int = 1
    """The number of packets in one turn."""
    least_interval_ns: int | None = None
    """The least traffic interval at which everything arrives; None if it was not asked for."""


def table_for(
    scenario: Scenario, places: Places, head_of: Mapping[NodeId, NodeId], *, quick: bool = False
) -> FittedTimetable | Refused:
    """The timetable of nodes; refused if one packet of each root, or with `quick` the load, does not fit."""
    found = fit(scenario, places, head_of, quick=quick)
    if found is not None:
        return found
    turns = superframe(scenario)
    unlimited = Turns(0, turns.period_ns, 0, turns.turn_ns, _MOST_TURNS)
    roots = tuple(sorted({scenario.leader, *head_of.values()}))
    table = timetable(places, roots, links(scenario, unlimited), (), Effort(pace=0.0))
    needed = f"{table.used}" if table else f"more than {_MOST_TURNS}"
    most_us = None if quick or table is None else _most_slack_us(scenario, places, head_of, needed=table.used)
    slack = "" if most_us is None else f"; with clusters.turn_slack_us of at most {most_us} it has enough"
    return Refused(
        f"one packet of each of {len(roots)} roots needs {needed} turns of {turns.turn_ns / 1e6:.3f} ms, "
        f"a superframe has {turns.per_superframe}{slack}"
    )


def _most_slack_us(scenario: Scenario, places: Places, head_of: Mapping[NodeId, NodeId], *, needed: int) -> int | None:
    """The slack with which the needed turns, or a few more, fit into a superframe; None if less slack does not help."""
    turns = superframe(scenario)
    for spare in _SPARE_TURNS:
        longest_ns = (turns.period_ns - turns.contention_ns) // math.ceil(needed * spare)
        slack_us = (turn_slack_ns(scenario) - turns.turn_ns + longest_ns) // US
        if slack_us < _LEAST_SLACK_US:
            return None
        variant = vary(scenario, {"clusters.turn_slack_us": float(slack_us)})
        if variant is not None and fit(variant.scenario, places, head_of) is not None:
            return slack_us
    return None


def judge(
    found: FittedTimetable,
    floods: Sequence[Turn],
    candidate: Candidate,
    *,
    lead_ns: int,
    receipt_ns: int,
    jitter_ns: int,
    control: int = 0,
    bulk_bytes: int,
) -> ClusterPlan:
    """Judge one root, whose `floods` take these turns. `receipt_ns`: until applications have a packet; `control`:
    announcements per period, before all bulk; `bulk_bytes`: the room for bulk in a turn.
    """
    turns = found.turns
    offsets = tuple(sorted(turn.offset for turn in floods if turn.node == turn.root))
    span = found.table.spans.get(candidate.head, 1)
    own = RootTurns(turns, offsets, span, found.together, lead_ns + receipt_ns)
    part_bytes = bulk_bytes // found.together
    rooms = [
        _Room(own, lead_ns, jitter_ns, control, _of(priority, candidate.shares), part_bytes)
        for priority in sorted({share.priority for share in candidate.shares})
    ]
    fullest = max(rooms, key=lambda room: room.turns_needed, default=None)
    waiting = [room.backlog() for room in rooms if room.packets]
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=len(offsets) * turns.turn_ns,
        usable_ns=len(offsets) * turns.turn_ns,
        work_ns=round(fullest.turns_needed * turns.turn_ns) if fullest else 0,
        packets=fullest.packets if fullest else 0,
        flood=FloodCost(_flood_ns(own), turns.turn_ns, proven=True),
        delays=tuple(next(room.delay(share) for room in rooms if share in room.shares) for share in candidate.shares),
        backlog=sum(n for n in waiting if n is not None) if waiting and None not in waiting else None,
    )


def _of(priority: int, shares: Sequence[ClassLoad]) -> tuple[ClassLoad, ...]:
    return tuple(share for share in shares if share.priority == priority)


def _flood_ns(own: RootTurns) -> int:
    return max((own.turns.flood_ns(offset, span=own.span) for offset in own.roots), default=own.turns.turn_ns)


class _Room(NamedTuple):
    """The room in the turns of one root that all classes of one priority share, and the arrivals there."""

    own: RootTurns
    lead_ns: int
    jitter_ns: int
    """The time by which a packet may reach the root late."""
    control: int
    """The number of announcements per superframe, which go in the room for bulk."""
    shares: tuple[ClassLoad, ...]
    part_bytes: int
    """The room for one bulk packet of those for which the timetable is made."""

    @property
    def urgent(self) -> bool:
        return self.shares[0].urgent

    @property
    def per_turn(self) -> int:
        """The number of packets that each turn carries: one urgent packet, or bulk as the timetable is made for."""
        return 1 if self.urgent else self.own.together

    def parts(self, share: ClassLoad) -> int:
        """A longer bulk packet may find too little room behind others, and take the next turn alone."""
        longer = not self.urgent and share.payload_bytes > self.part_bytes
        return 2 * self.per_turn - 1 if longer else 1

    @property
    def announced(self) -> int:
        """The number of announcements per superframe that take the room of a whole turn."""
        return 0 if self.urgent else self.control

    @property
    def packets(self) -> float:
        """The packets and announcements per superframe; none if there are only announcements."""
        sent = math.fsum(share.sources * self.own.turns.period_ns / share.interval_ns for share in self.shares)
        return sent + self.announced if sent else 0.0

    @property
    def turns_needed(self) -> float:
        """The turns per superframe that the packets and announcements fill."""
        period_ns = self.own.turns.period_ns
        parts = math.fsum(s.sources * self.parts(s) * period_ns / s.interval_ns for s in self.shares)
        return parts / self.per_turn + self.announced if parts else 0.0

    def delay(self, share: ClassLoad) -> DelayBound:
        """A packet waits for packets of its priority only, bulk also for announcements. Of a single source the bound is
        that which it states in flight (`RootTurns`), which is tighter.
        """
        if not share.sources:
            return Bounded(0)
        sources = sum(other.sources for other in self.shares)
        if sources > 1 or self.jitter_ns or self.announced:
            return self._queued(share)
        if len(self.own.roots) * self.per_turn * share.interval_ns < self.own.turns.period_ns:
            return Refused(f"{len(self.own.roots) * self.per_turn} packets are let out per superframe, more come")
        if share.urgent:
            return Bounded(self.own.burst_ns(per_turn=self.per_turn))
        worst_ns = self.own.worst_ns(interval_ns=share.interval_ns)
        assert worst_ns is not None, "as many are let out as come"
        return Bounded(worst_ns)

    def _queued(self, share: ClassLoad) -> DelayBound:
        server = self._server()
        server.check()
        flow, *others = sorted(self._flows(), key=lambda flow: flow.interval_ns != share.interval_ns)
        before = self._announcements()
        alone = delay_fifo(Total((flow, *others)), server)
        queue = delay_any_order(flow, Total((*before, *others)), server) if before else alone
        if isinstance(queue, Refused):
            return queue
        return Bounded(queue.delay_ns + _flood_ns(self.own) - server.airtime_ns + self.own.around_ns - self.lead_ns)

    def backlog(self) -> int | None:
        """The greatest number of packets that wait at the same time; None if it has no limit."""
        waiting = backlog(Total((*self._announcements(), *self._flows())), self._server())
        return None if isinstance(waiting, Refused) else waiting

    def _flows(self) -> list[Periodic]:
        return [
            Periodic(share.interval_ns, self.jitter_ns)
            for share in self.shares
            for _ in range(share.sources * self.parts(share))
        ]

    def _announcements(self) -> list[Periodic]:
        """The announcements as arrivals: each takes a whole turn, which counts as `per_turn` packets."""
        return [Periodic(self.own.turns.period_ns, 0)] * (self.announced * self.per_turn)

    def _server(self) -> TurnServer:
        """Turns of k packets as k parts with one each, all of which are completed at the end of the turn. A packet must
        be announced before the whole turn, so its lead counts as longer.
        """
        turns, parts = self.own.turns, self.per_turn
        part_ns = turns.turn_ns // parts
        starts = (turns.start_ns(offset, superframe_start_ns=0) for offset in self.own.roots)
        parts_ns = tuple(start_ns + part * part_ns for start_ns in starts for part in range(parts))
        return TurnServer(part_ns, turns.period_ns, parts_ns, self.lead_ns + turns.turn_ns - part_ns)
