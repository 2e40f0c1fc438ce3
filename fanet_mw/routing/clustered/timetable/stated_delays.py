"""The delays that a node states for its own packets: bounds, likely delays over lossy links, and admission by a
deadline.

A bound is stated when a packet is accepted, and only if nothing later can break it (docs/explanation/timetable.md, No
bound is stated). When two parts of a swarm meet, a node keeps the turns in which it has promised to send; a packet that
would break its stated bound nevertheless is dropped.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.roles.leader import HEARD_NS
from fanet_mw.routing.clustered.roles.leader_election import Lease
from fanet_mw.routing.clustered.tdma.hello_room import hellos_ns, room_ns
from fanet_mw.routing.clustered.tdma.turn_timing import receipt_ns, turn_slack_ns
from fanet_mw.routing.clustered.timetable.admission import Admission, least_interval_ns
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable, TimetablesInForce
from fanet_mw.routing.clustered.timetable.own_bound import RootTurns, likely_delay_ns
from fanet_mw.routing.clustered.timetable.turn_release import RootRelease
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.trace import LIKELY_SHARE, BoundExcludes, BoundStated, LikelyStated
from fanet_mw.units import MS, US, NodeId, seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_REPORT, PRIORITY_SAFETY
from fanet_mw.wire.loads import AS_EXPECTED, interval_ns_of

_SAME: Final = 0.95
"""A node whose packets come at less than this share of the scenario's interval sends others as well."""
_SILENT: Final = 5
"""After so many superframes, or hello intervals if these are longer, a node that no flood was heard from is silent."""
_LOST: Final = 10
"""After so many the leader plans without it."""
_CLASSES: Final = {PRIORITY_SAFETY: "warning", PRIORITY_REPORT: "report", PRIORITY_BULK: "bulk"}


class StatedDelays:
    """The bounds and likely delays of one node's packets, by its timetables."""

    def __init__(
        self,
        port: Port,
        *,
        timetables: TimetablesInForce,
        roots: RootRelease,
        lease: Lease,
        admission: Admission | None,
        followers: Followers,
    ) -> None:
        self._port = port
        self._timetables = timetables
        self._roots = roots
        self._lease = lease
        self._admission = admission
        self._followers = followers
        self._lead_ns = port.scenario.radio.lead_ns
        self._interval_ns = seconds_to_ns(port.scenario.traffic.interval_s)
        self._hello_ns = seconds_to_ns(port.scenario.routing.hello_interval_s)
        self._now_ns = 0
        self._bounds_ns: list[tuple[NodeTimetable, Mapping[int, int]]] = []
        """The bound of each priority class by each timetable; classes without a bound are missing."""
        self._promised: dict[int, tuple[int, int]] = {}
        """The waiting packets for which a bound was stated, by sequence number: the instant at which the flood of each
        is over if the node keeps its turns, and the latest instant that the bound allows."""
        self._ahead: tuple[NodeTimetable, int] | None = None
        """The timetable that was examined last, and how long before its end that end must be announced."""
        self.announced_ns = 0
        """The instant of the latest known announcement of the timetable that the node follows."""

    def start(self, now_ns: int) -> None:
        if self._admission is not None:
            self._admission.start(now_ns)

    # --- timetables -----------------------------------------------------------------------------------------------

    def follow(self, *, now_ns: int) -> None:
        """The newest timetable has changed, or there is none any more."""
        if self._timetables.newest is None:
            self._bounds_ns = []
            self._admit(None, now_ns=now_ns)
            return
        own = self.own()
        self._admit(None if self._lease.leads else own, now_ns=now_ns)
        *before, newest = self._timetables.in_order
        kept = [(older, bounds_ns) for older, bounds_ns in self._bounds_ns if any(older is other for other in before)]
        self._bounds_ns = [*kept, (newest, self.class_bounds_ns(own))]

    def _admit(self, own: RootTurns | None, *, now_ns: int) -> None:
        record = None if self._admission is None else self._admission.follow(own, now_ns=now_ns)
        if record is not None:
            self._port.record(record)

    def own(self) -> RootTurns | None:
        """The node's share of the newest timetable; None if it states no bounds, as when frames may be lost."""
        scenario = self._port.scenario
        # the links of a timetable end when UAVs move among each other, and who learns of that learns it too late
        timetable = None if scenario.measures_links or not scenario.rigid else self._timetables.newest
        if timetable is None or not timetable.roots or not timetable.whole:
            return None
        if timetable.table.uncovered[self._port.node]:
            return None
        if self._ends_early(timetable):
            return None
        if not timetable.table.sure and scenario.mobility.model != "static":
            return None
        if hellos_ns(scenario, timetable.table.crowd) > room_ns(timetable.turns.contention_ns):
            return None  # neighbors will be taken for dead
        return self._own_of(self._port.node, timetable)

    def _ends_early(self, timetable: NodeTimetable) -> bool:
        """True if the hop limit ends floods too early, perhaps for nodes whose joins never reached the leader."""
        scenario, hops = self._port.scenario, timetable.table.hops
        limit = scenario.routing.hop_limit
        incomplete = len(timetable.table.spans) < scenario.node_count
        return hops.get(self._port.node, 0) > limit or (incomplete and max(hops.values(), default=0) >= limit)

    def _own_of(self, node: NodeId, timetable: NodeTimetable) -> RootTurns:
        offsets = timetable.roots if node == self._port.node else tuple(timetable.table.offsets_of(node))
        around_ns = self._lead_ns + receipt_ns(self._port.scenario)
        load = timetable.loads.get(node, AS_EXPECTED)
        return RootTurns(timetable.turns, offsets, timetable.table.spans[node], timetable.together, around_ns, load)

    def class_bounds_ns(self, own: RootTurns | None) -> Mapping[int, int]:
        """The bounds by priority; none for any class where lost packets are repaired."""
        scenario = self._port.scenario
        if own is None or scenario.repair_ns:
            return {}
        found = dict.fromkeys(self._roots.reserved, own.burst_ns(per_turn=1))
        bulk_ns: int | None = own.burst_ns(per_turn=own.together)
        if scenario.traffic.arrivals == "cbr" and not scenario.further_traffic:
            heard_ns = interval_ns_of(own.load, expected_ns=self._interval_ns)
            interval_ns = self._admission.interval_ns if self._admission else heard_ns
            if interval_ns >= _SAME * self._interval_ns or self._admission:
                bulk_ns = own.worst_ns(interval_ns=interval_ns)
        return found if bulk_ns is None else {**found, PRIORITY_BULK: bulk_ns}

    def notice_ns(self, now_ns: int) -> int:
        """How long ahead another timetable must be announced, so that all promises by those in force can be kept."""
        in_force = self._timetables.in_order[self._timetables.superseded(now_ns) :]
        return max((self._ahead_ns(timetable) for timetable in in_force), default=0)

    def _ahead_ns(self, timetable: NodeTimetable) -> int:
        """How long before a timetable's end that must be announced: all know of it after a superframe and a flood;
        until then they may promise what must be over by that end.
        """
        if self._ahead is None or self._ahead[0] is not timetable:
            roots = {turn.root for turn in timetable.table.roots()} if timetable.whole else set()
            owns = [self._own_of(root, timetable) for root in sorted(roots)]
            bounds = [bound_ns for own in owns for bound_ns in self.class_bounds_ns(own).values()]
            floods = [own.turns.flood_ns(offset, span=own.span) for own in owns for offset in own.roots]
            learnt_ns = (
                timetable.turns.period_ns + max(floods, default=0) + self._lead_ns + receipt_ns(self._port.scenario)
            )
            self._ahead = timetable, max(HEARD_NS, learnt_ns + max(bounds)) if bounds else HEARD_NS
        return self._ahead[1]

    # --- packets --------------------------------------------------------------------------------------------------

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        """Admission control of an own application's packet: False if it would harm the deadline of others."""
        policed = self._admission if packet.header.priority == PRIORITY_BULK else None
        return policed is None or policed.admit(due_ns)

    def all_keep(self, timetable: NodeTimetable, *, now_ns: int) -> bool:
        """True if all nodes of a timetable have shown that they keep it, not long ago."""
        silent_ns = _SILENT * self._shown_ns(timetable)
        return self._followers.have(timetable.version, timetable.table.spans, silent_ns=silent_ns, now_ns=now_ns)

    def hears_nobody(self, now_ns: int) -> bool:
        """True if no other node was heard in its turns for so long that each counts as silent."""
        silent, timetable = self._silences(_SILENT, now_ns), self._timetables.at(now_ns)
        return (
            timetable is not None and bool(silent) and silent.keys() == timetable.table.spans.keys() - {self._port.node}
        )

    def lost_ns(self, now_ns: int) -> Mapping[NodeId, int]:
        """After which silence in its turns each node is lost; empty until all have to keep the timetable."""
        return self._silences(_LOST, now_ns)

    def _silences(self, times: int, now_ns: int) -> Mapping[NodeId, int]:
        """Nodes not heard in their turns for so long, and that time; none in a new timetable, or over lossy links."""
        timetable = self._timetables.at(now_ns)
        if timetable is None or not timetable.whole or timetable.odds is not None:
            return {}
        silent_ns = times * self._shown_ns(timetable)
        if now_ns < timetable.valid_ns + silent_ns:
            return {}
        unheard = self._followers.unheard(timetable.version, timetable.table.spans, since_ns=now_ns - silent_ns)
        return dict.fromkeys(unheard, silent_ns)

    def _shown_ns(self, timetable: NodeTimetable) -> int:
        return max(self._hello_ns, timetable.turns.period_ns)

    def greatest_bound_ns(self, packet: Packet, *, now_ns: int) -> int | None:
        """The greatest bound of this packet's class by the timetables in force; None if one gives none."""
        priority = packet.header.priority
        bounds = [bounds_ns.get(priority) for _, bounds_ns in self._bounds_ns[self._timetables.superseded(now_ns) :]]
        known = [bound_ns for bound_ns in bounds if bound_ns is not None]
        if not known or len(known) < len(bounds) or not self._in_step():
            return None
        if self._lease.leads and priority == PRIORITY_BULK:
            return None  # schedules go before it
        return max(known)

    def has_promised(self, packet: Packet) -> bool:
        """True if a bound was stated for a packet that waits."""
        return packet.header.origin == self._port.node and packet.header.seq in self._promised

    def state(self, packet: Packet, bound_ns: int | None, *, through_ns: int | None, now_ns: int) -> bool:
        """Record the bound or likely delay of a packet that was just accepted, whose flood is over at `through_ns`.
        Returns True if a bound is stated.
        """
        newest, stated = self._timetables.newest, False
        if bound_ns is not None and through_ns is not None and newest is not None:
            had_ns = through_ns + receipt_ns(self._port.scenario)
            # every timetable that comes into force before this instant has been announced already
            known_ns = self.announced_ns + newest.turns.period_ns + self._ahead_ns(newest)
            born_ns = packet.header.origin_us * US
            due_ns = born_ns + bound_ns
            expires_ns = born_ns + self._port.scenario.routing.lifetime_ns(packet.header.priority)
            in_force = [
                one for one in self._timetables.in_order[self._timetables.superseded(now_ns) :] if one.valid_ns < had_ns
            ]
            # who has followed another leader may have lost sight of some nodes before this one prevailed
            kept = all(
                one.version.authority == newest.version.authority and self.all_keep(one, now_ns=now_ns)
                for one in in_force
            )
            if kept and had_ns <= min(due_ns, known_ns, expires_ns):
                stated = True
                self._port.record(BoundStated(now_ns, self._port.node, packet.header.seq, bound_ns))
                self._exclude(in_force, packet, now_ns)
                self._promised[packet.header.seq] = through_ns, due_ns - receipt_ns(self._port.scenario)
                self._forget_overdue(now_ns)
        likely_ns = self.likely_ns() if packet.header.priority == PRIORITY_BULK else None
        if likely_ns is not None and newest is not None and newest.valid_ns <= now_ns:
            record = LikelyStated(now_ns, self._port.node, packet.header.seq, likely_ns, LIKELY_SHARE)
            self._port.record(record)
            self._exclude([newest], packet, now_ns)
        return stated

    def _exclude(self, timetables: Sequence[NodeTimetable], packet: Packet, now_ns: int) -> None:
        """What was stated is not meant for nodes that one of these timetables lacks: no turn surely reaches them."""
        for other in self._port.scenario.node_ids:
            if any(other not in one.table.spans for one in timetables):
                self._port.record(BoundExcludes(now_ns, self._port.node, packet.header.seq, other))

    def kept_until_ns(self, now_ns: int) -> int:
        """The instant until which the node keeps its turns, because promised packets wait for them; 0 if none do."""
        self._forget_overdue(now_ns)
        return max((through_ns for through_ns, _ in self._promised.values()), default=0)

    def _forget_overdue(self, now_ns: int) -> None:
        while self._promised and self._promised[oldest := next(iter(self._promised))][1] < now_ns:
            del self._promised[oldest]

    def keeps(self, packet: Packet, *, through_ns: int | None) -> bool:
        """True if letting a packet out breaks no bound: its flood ends (`through_ns`) in time, or none was stated."""
        if packet.header.origin != self._port.node:
            return True
        _, due_ns = self._promised.pop(packet.header.seq, (0, None))
        return due_ns is None or (through_ns is not None and through_ns <= due_ns)

    # --- time and people ------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        return self._admission.next_wake_ns() if self._admission else None

    def wake(self, now_ns: int) -> None:
        self._now_ns = now_ns
        lost = self._admission.wake(now_ns) if self._admission else None
        if lost is not None:
            self._port.record(lost)

    def bound_ns(self) -> int | None:
        """The bound of bulk packets, application to application, by the newest timetable that all keep; or None."""
        if self._lease.leads or not self._in_step():
            return None
        for timetable, bounds_ns in reversed(self._bounds_ns):
            if self.all_keep(timetable, now_ns=self._now_ns):
                return bounds_ns.get(PRIORITY_BULK)
        return None

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        """The least interval between packets that meets a deadline; None if none does, or without a bound."""
        own = self.own()
        return None if own is None or self.bound_ns() is None else least_interval_ns(own, deadline_ns=deadline_ns)

    def likely_ns(self) -> int | None:
        """When `LIKELY_SHARE` of the nodes have this node's newest packet over lossy links; None if unknown."""
        timetable = self._timetables.newest
        if timetable is None or timetable.odds is None or not timetable.roots:
            return None
        if self._lease.leads or timetable.table.uncovered[self._port.node] or not self._in_step():
            return None  # schedules go before the leader's own packets
        if self._ends_early(timetable):
            return None
        load = timetable.loads.get(self._port.node, AS_EXPECTED)
        found_ns = likely_delay_ns(
            timetable,
            self._port.node,
            waiting=len(self._roots),
            interval_ns=interval_ns_of(load, expected_ns=self._interval_ns),
            hello_ns=self._hello_ns,
        )
        if found_ns is None:
            return None
        whole_ns = found_ns + self._lead_ns + receipt_ns(self._port.scenario)
        return whole_ns if whole_ns <= self._port.scenario.routing.lifetime_ns(PRIORITY_BULK) else None

    def _in_step(self) -> bool:
        """True if the slack of turns is enough for the known errors of the swarm's clocks."""
        scenario = self._port.scenario
        return clocks_fit(scenario.clock, slack_ns=turn_slack_ns(scenario), clock_error_ns=self._port.clock_error_ns)

    def report(self) -> Mapping[str, object]:
        bound_ns, likely_ns = self.bound_ns(), self.likely_ns()
        bounds_ns = self._bounds_ns[-1][1] if self._bounds_ns else {}
        return {
            "likely_ms": None if likely_ns is None else likely_ns / MS,
            "likely_share": None if likely_ns is None else LIKELY_SHARE,
            "bound_ms": None if bound_ns is None else bound_ns / MS,
            "bounds_ms": {_CLASSES[p]: ns / MS for p, ns in bounds_ns.items()},
        }
