"""The clustered protocol with collision-free floods: every packet goes to its head and on to everyone in turns.

    join -> schedule with places -> everyone computes the same timetable -> from its first superframe on, turns

A node that hears a packet in a turn knows from the turn and the sender whose flood it is, and so its own turn. What is
heard outside of any turn is not relayed. Until a timetable is in force, and for whatever is no data, the rules of
`clustered` hold; then all but floods of data contend in the window at the beginning of each superframe.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.arrival import decoded
from fanet_mw.node.contract import Port
from fanet_mw.node.duplicates import key_of
from fanet_mw.node.queue import Packet, TxQueue, sooner_us
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.roles.leader import HEARD_NS
from fanet_mw.routing.clustered.roles.lease import Authority
from fanet_mw.routing.clustered.roles.membership import Version
from fanet_mw.routing.clustered.tdma.admission import Admission
from fanet_mw.routing.clustered.tdma.call_release import CallRelease
from fanet_mw.routing.clustered.tdma.own_bound import Own
from fanet_mw.routing.clustered.tdma.root_release import Following, RootRelease
from fanet_mw.routing.clustered.tdma.turns import clocks_fit, receipt_ns
from fanet_mw.routing.clustered.tdma.urgent import reserved
from fanet_mw.routing.clustered.timetable.turn_plan import LIKELY_SHARE, Fitted, Plan, fit, fit_measured, leader_load
from fanet_mw.trace import BoundStated, LikelyStated
from fanet_mw.units import MS, US, Enu, NodeId, earliest, seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_REPORT, PRIORITY_SAFETY, Kind
from fanet_mw.wire.inner import Schedule
from fanet_mw.wire.links import Link, Links, frames_of
from fanet_mw.wire.places import Places, rounded

_LINKS_PART: Final = 1 << 16
"""Parts of the links are kept for neighbors behind those of the schedule."""
_MOST_ANSWERS: Final = 2
"""Answers that wait for turns; more than these contend."""
_JITTER: Final = 0.25
"""Of the contention window: the most that a relay waits there."""
_CLASSES: Final = {PRIORITY_SAFETY: "warning", PRIORITY_REPORT: "report", PRIORITY_BULK: "bulk"}
_JOINED_NS: Final = 7500 * MS
"""After its start a node should be in a timetable by then, and three superframes: joins take 3 s, a join may be lost,
the leader waits a moment for more, and a timetable is announced ahead."""


class Scheduled(Clustered):
    """Clustered, time-divided flooding without contention, at one node."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        scenario = port.scenario
        self._lifetime_ns = seconds_to_ns(scenario.routing.lifetime_s)
        self._window_random = port.stream("window").random
        self._reserved = reserved(scenario)
        self._roots = RootRelease(
            port.node,
            TxQueue(capacity=scenario.routing.queue_frames, sooner_us=sooner_us(scenario.routing)),
            reserved=self._reserved,
            lead_ns=self._lead_ns,
        )
        self._calls = CallRelease(TxQueue(capacity=scenario.routing.queue_frames), lead_ns=self._lead_ns)
        """What neighbors lack, in our turns for neighbors alone; hellos go there too."""
        self._plans: list[Plan] = []
        self._schedules: dict[int, tuple[Schedule, Places]] = {}
        self._measured: dict[int, Links] = {}
        """The links of the schedule's version, by part."""
        self._version: Version | None = None
        self._planned: Version | None = None
        self._missed = 0
        self._bounds_ns: list[Mapping[int, int]] = []
        """Of each plan, the bound of each class (by priority) of our own packets; a class that is missing has none."""
        self._told_ns: dict[Version, int] = {}
        """When the leader made the latest announcement that we know of the newest schedule, and of what we follow."""
        self._ahead: tuple[Plan, int] | None = None
        """The plan looked at last, and how long before its end that must be announced."""
        self._interval_ns = seconds_to_ns(scenario.traffic.interval_s)
        self._admission = (
            None
            if scenario.traffic.deadline_s is None or (port.node == scenario.leader and not leader_load(scenario))
            else Admission(
                port.node,
                deadline_ns=seconds_to_ns(scenario.traffic.deadline_s),
                interval_ns=self._interval_ns,
                expected_ns=_JOINED_NS + 3 * scenario.clusters.period_ns,
            )
        )

    def start(self, now_ns: int) -> None:
        super().start(now_ns)
        if self._admission is not None:
            self._admission.start(now_ns)

    # --- the timetable --------------------------------------------------------------------------------------------

    def _announcement(self, part: Schedule) -> bytes:
        assert self._leader is not None, "only the leader announces"
        if not part.members:
            return super()._announcement(part)
        places = Places(
            tuple(rounded(self._leader.place(member.node)) for member in part.members),
            rounded(self._leader.place(part.leader)),
        )
        return super()._announcement(part) + places.encode_frames(self._port.node)

    def _learn(self, packet: Packet, *, now_ns: int) -> None:
        """Besides the schedule take in the places, and plan when all of an epoch have come."""
        schedule = decoded(packet, Schedule.decode_frame)
        places = decoded(packet, Places.decode_frames) if schedule.members else None
        super()._learn(packet, now_ns=now_ns)
        version = Version(Authority(schedule.term, schedule.leader), schedule.epoch)
        if version != self._membership.version or places is None or len(places.members) != len(schedule.members):
            return
        if version != self._version:
            self._version, self._schedules = version, {}
            if self._measured and _version_of(next(iter(self._measured.values()))) != version:
                self._measured = {}
        self._schedules[schedule.part] = schedule, places
        told = {version: packet.header.origin_us * US}
        if self._planned is not None and self._planned != version:
            told[self._planned] = self._told_ns.get(self._planned, 0)
        self._told_ns = told
        self._plan_if_complete(now_ns)

    def _announce(self, part: Schedule, *, now_ns: int) -> None:
        super()._announce(part, now_ns=now_ns)
        leader = self._leader
        if leader is None or not leader.links or not part.members or part.part + 1 < part.parts:
            return
        frames = frames_of(leader.links)
        for index, links in enumerate(frames):
            told = Links(self._port.node, links, part.term, leader.epoch, index, len(frames))
            packet = self._flood_control(Kind.LINKS, told.encode_frames(), now_ns=now_ns)
            self._learn_links(packet, now_ns=now_ns)

    def _consume_control(self, packet: Packet, src: NodeId, *, now_ns: int) -> None:
        super()._consume_control(packet, src, now_ns=now_ns)
        if packet.header.kind == Kind.LINKS and packet.header.origin != self._port.node and self._links is not None:
            self._learn_links(packet, now_ns=now_ns)

    def _learn_links(self, packet: Packet, *, now_ns: int) -> None:
        """A part of the links of an assignment, which may come before the schedule does."""
        told = decoded(packet, Links.decode_frames)
        if told is None or told.node != packet.header.origin:
            raise MalformedFrameError(f"links of an assignment by {packet.header.origin}")
        if any(max(link.a, link.b) > self._port.scenario.nodes.count for link in told.links):
            raise MalformedFrameError("links of nodes that are not there")
        version = _version_of(told)
        if version.authority != self._lease.authority:
            return
        if self._measured and _version_of(next(iter(self._measured.values()))) != version:
            self._measured = {}
        self._measured[told.part] = told
        if version == self._membership.version:
            self._refresh.keep(packet, _LINKS_PART + told.part, version.authority, version.epoch, now_ns=now_ns)
        self._plan_if_complete(now_ns)

    def _plan_if_complete(self, now_ns: int) -> None:
        """Plan once when all parts of the schedule's version have come, and all parts of its links."""
        version = self._version
        if version is None or self._planned == version or version != self._membership.version:
            return
        if len(self._schedules) < next(iter(self._schedules.values()))[0].parts:
            return
        if self._links is not None:
            first = next(iter(self._measured.values()), None)
            if first is None or _version_of(first) != version or len(self._measured) < first.parts:
                return
        self._planned = version
        self._plan(now_ns)

    def _plan(self, now_ns: int) -> None:
        parts = [self._schedules[part] for part in sorted(self._schedules)]
        schedule, places = parts[0]
        at: dict[NodeId, Enu] = {NodeId(schedule.leader): places.leader}
        cluster_of: dict[NodeId, int] = {}
        heads: dict[int, NodeId] = {}
        for part, where in parts:
            for member, place in zip(part.members, where.members, strict=True):
                at[NodeId(member.node)] = place
                cluster_of[NodeId(member.node)] = member.cluster
                if member.is_head:
                    heads[member.cluster] = NodeId(member.node)
        if not heads.keys() >= set(cluster_of.values()):
            return  # a cluster without a head: no leader of ours makes one
        measured = tuple(link for part in sorted(self._measured) for link in self._measured[part].links)
        found = self._fit(
            schedule, at, {node: heads[cluster] for node, cluster in sorted(cluster_of.items())}, measured
        )
        if found is None:
            self._plans, self._bounds_ns = [], []  # not one packet of each head fits; `fanet plan` says so
            self._admit(None, now_ns=now_ns)
        else:
            valid_ns = schedule.start_us * US
            over = self._superseded(now_ns)
            self._plans = [*self._plans[over:], Plan.of(self._port.node, valid_ns, found)]
            own = self._own()
            self._admit(None if self._leader else own, now_ns=now_ns)
            self._bounds_ns = [*self._bounds_ns[over:], self._class_bounds_ns(own)]
        self._roots.follow([self._following(plan) for plan in self._plans], now_ns=now_ns)
        calls = [Following(plan.valid_ns, plan.turns, plan.calls, plan.frame_bytes, 1) for plan in self._plans]
        self._calls.follow(calls, now_ns=now_ns)
        if not self._plans:
            self._calls.drain()  # what neighbors lack they will say again
        stranded = [] if self._roots.has_turn(now_ns=now_ns) else self._roots.drain()
        for packet in [*stranded, *self._release.drain(), *self._uplink.drain()]:
            self._forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)

    def _superseded(self, now_ns: int) -> int:
        """How many of the plans, the oldest first, are no longer in force."""
        return sum(plan.valid_ns <= now_ns for plan in self._plans[1:])

    def _fit(
        self, schedule: Schedule, at: Mapping[NodeId, Enu], head_of: Mapping[NodeId, NodeId], measured: tuple[Link, ...]
    ) -> Fitted | None:
        """The timetable; by places if links are not measured, or leave no room for the load."""
        places, leader = tuple(sorted(at.items())), NodeId(schedule.leader)
        origin_ns, period_ns = schedule.start_us * US, schedule.period_us * US
        found = None
        if measured:
            found = fit_measured(
                self._port.scenario,
                places,
                measured,
                leader=leader,
                origin_ns=origin_ns,
                link_parts=len(self._measured),
            )
        return found or fit(
            self._port.scenario, places, head_of, leader=leader, origin_ns=origin_ns, period_ns=period_ns
        )

    def _plan_at(self, t_ns: int) -> Plan | None:
        for plan in reversed(self._plans):
            if plan.valid_ns <= t_ns:
                return plan
        return None

    # --- letting in -----------------------------------------------------------------------------------------------

    def _own(self) -> Own | None:
        """Our part of the newest plan, if it gives our packets a bound: not if frames may be lost."""
        plan = self._plans[-1] if self._plans and self._links is None else None
        if plan is None or not plan.roots or not plan.whole or plan.table.uncovered[self._port.node]:
            return None
        return self._own_of(self._port.node, plan)

    def _own_of(self, node: NodeId, plan: Plan) -> Own:
        offsets = plan.roots if node == self._port.node else tuple(plan.table.offsets_of(node))
        around_ns = self._lead_ns + receipt_ns(self._port.scenario)
        return Own(plan.turns, offsets, plan.table.spans[node], plan.together, around_ns)

    def _following(self, plan: Plan) -> Following:
        span = plan.table.spans.get(self._port.node, 1)
        return Following(plan.valid_ns, plan.turns, plan.roots, plan.frame_bytes, span)

    def _class_bounds_ns(self, own: Own | None) -> Mapping[int, int]:
        """By priority; none for what is repaired after it was lost."""
        scenario = self._port.scenario
        if own is None or scenario.clusters.repair_s:
            return {}
        found = dict.fromkeys(self._reserved, own.burst_ns(per_turn=1))
        bulk_ns: int | None = own.burst_ns(per_turn=own.together)
        if scenario.traffic.arrivals == "cbr":
            interval_ns = self._admission.interval_ns if self._admission else self._interval_ns
            bulk_ns = own.worst_ns(interval_ns=interval_ns)
        return found if bulk_ns is None else {**found, PRIORITY_BULK: bulk_ns}

    def _announcements(self, now_ns: int) -> Sequence[Schedule]:
        if self._leader is None:
            return ()
        notice_ns = max((self._ahead_ns(plan) for plan in self._plans[self._superseded(now_ns) :]), default=0)
        return self._leader.wake(self._motion(now_ns), notice_ns=notice_ns, now_ns=now_ns)

    def _ahead_ns(self, plan: Plan) -> int:
        """How long before this timetable ends its end is announced, for every promise under it to be kept.

        All have heard of it after a superframe and a flood; what anyone has promised until then must be through.
        """
        if self._ahead is None or self._ahead[0] is not plan:
            roots = {turn.root for turn in plan.table.roots()} if plan.whole else set()
            owns = [self._own_of(root, plan) for root in sorted(roots)]
            bounds = [bound_ns for own in owns for bound_ns in self._class_bounds_ns(own).values()]
            floods = [own.turns.flood_ns(offset, span=own.span) for own in owns for offset in own.roots]
            learnt_ns = plan.turns.period_ns + max(floods, default=0) + self._lead_ns + receipt_ns(self._port.scenario)
            self._ahead = plan, max(HEARD_NS, learnt_ns + max(bounds)) if bounds else HEARD_NS
        return self._ahead[1]

    def _admit(self, own: Own | None, *, now_ns: int) -> None:
        """The timetable has changed, or there is none for the swarm as it is now."""
        record = None if self._admission is None else self._admission.follow(own, now_ns=now_ns)
        if record is not None:
            self._port.record(record)

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        admission = self._admission if packet.header.priority == PRIORITY_BULK else None
        if admission is not None and not admission.admits(due_ns):
            self._port.drop(DropReason.ADMISSION, packet, now_ns=now_ns)
            return
        super().originate(packet, due_ns=due_ns, now_ns=now_ns)
        self._promise(packet, now_ns)
        likely_ns = self.likely_ns() if packet.header.priority == PRIORITY_BULK else None
        if likely_ns is not None and self._plans[-1].valid_ns <= now_ns:
            record = LikelyStated(now_ns, self._port.node, packet.header.seq, likely_ns, LIKELY_SHARE)
            self._port.record(record)

    def _promise(self, packet: Packet, now_ns: int) -> None:
        """State the bound of a packet that was just accepted, if it will be kept whatever comes later."""
        priority = packet.header.priority
        bounds = [bounds_ns.get(priority) for bounds_ns in self._bounds_ns[self._superseded(now_ns) :]]
        known = [bound_ns for bound_ns in bounds if bound_ns is not None]
        if not known or len(known) < len(bounds) or not self._in_step():
            return
        if self._leader is not None and priority == PRIORITY_BULK:
            return  # schedules go before it
        bound_ns = max(known)
        through_ns = self._roots.through_ns(packet, now_ns=now_ns)
        if through_ns is None:
            return
        had_ns = through_ns + receipt_ns(self._port.scenario)
        told_ns = self._told_ns.get(self._planned, 0) if self._planned is not None else 0
        newest = self._plans[-1]
        known_ns = told_ns + newest.turns.period_ns + self._ahead_ns(newest)  # no other comes into force sooner
        if had_ns <= min(packet.header.origin_us * US + bound_ns, known_ns):
            self._port.record(BoundStated(now_ns, self._port.node, packet.header.seq, bound_ns))

    # --- letting out ----------------------------------------------------------------------------------------------

    def _forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        if self._roots.has_turn(now_ns=now_ns):
            self._let_out(packet, now_ns=now_ns)
        else:
            super()._forward(packet, start_ns=self._contending_ns(start_ns), now_ns=now_ns, tries=tries)

    def _let_out(self, packet: Packet, *, now_ns: int) -> None:
        room = self._plans[-1].frame_bytes - sum(self._reserved.values())
        if len(packet.frame) > (room if packet.header.kind == Kind.DATA else self._plans[-1].frame_bytes):
            self._port.drop(DropReason.TOO_LARGE, packet, now_ns=now_ns)
            return
        evicted = self._roots.push(packet, now_ns=now_ns)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    def _enqueue(self, packet: Packet, *, now_ns: int) -> None:
        if self._roots.has_turn(now_ns=now_ns):
            self._let_out(packet, now_ns=now_ns)
        else:  # the schedule has made us head, its timetable is still to come
            super()._enqueue(packet, now_ns=now_ns)

    def _flood_control(self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False) -> Packet:
        plan = self._plan_at(now_ns + self._lead_ns)
        if plan is None or not plan.roots or (kind is Kind.JOIN and not urgent and plan.odds is None):
            # Our turns are for what the bound is about; a join may contend, and need not where there is no bound. An
            # announcement does not wait for turns that are still to come into force.
            return super()._flood_control(kind, inner, now_ns=now_ns)
        packet = self._floods.control(kind, inner, now_ns=now_ns)
        for stale in self._roots.outdated(before_us=packet.header.origin_us):
            self._port.drop(DropReason.EXPIRED, stale, now_ns=now_ns)
        self._let_out(packet, now_ns=now_ns)
        return packet

    # --- passing on -----------------------------------------------------------------------------------------------

    def _flood_on(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        plan = self._plan_at(reception.end_ns)
        if plan is None:
            super()._flood_on(packet, reception, now_ns=now_ns)
            return
        turn = plan.turns.turn_at(reception.end_ns)
        heard = None if turn is None else plan.heard.get((turn, reception.src))
        if heard is not None and plan.whole and packet.header.origin != heard[1] and plan.has_turns(packet.origin):
            return  # its sender follows another timetable
        if heard is None:
            if packet.header.kind != Kind.DATA:
                super()._flood_on(packet, reception, now_ns=now_ns)
            return
        self._in_turn(packet, plan, heard, reception, now_ns)

    def _in_turn(
        self, packet: Packet, plan: Plan, heard: tuple[int, NodeId, int], reception: Reception, now_ns: int
    ) -> None:
        """Relay in our turn of this flood, if we have one and it is still to come."""
        offset, root, instance = heard
        own = plan.mine.get((root, instance), ())
        if not own or packet.header.hop_limit <= 1:
            return
        frame_ns = plan.turns.frame_start_ns(reception.end_ns) - offset // plan.turns.per_frame * plan.turns.period_ns
        starts_ns = [plan.turns.start_ns(turn, frame_start_ns=frame_ns) for turn in own]
        ahead_ns = [start_ns for start_ns in starts_ns if start_ns >= now_ns]
        if not ahead_ns and (plan.odds is None or own[-1] > offset):
            # A reception that came late has used up some of the lead, or all of it. Over lossy links the first copy
            # that arrives may be one that was sent after our own turns.
            self._missed += 1
            self._port.drop(DropReason.MISSED_TURN, packet, now_ns=now_ns)
        for start_ns in ahead_ns:
            self._floods.relay(packet, start_ns=start_ns)

    def _flood_again(self, packet: Packet, *, now_ns: int) -> None:
        """A neighbor lacks this packet: in a turn for neighbors alone, if we have one and it fits."""
        plan = self._plan_at(now_ns)
        crowded = len(self._calls) >= _MOST_ANSWERS
        if plan is None or not plan.calls or crowded or len(packet.frame) > plan.frame_bytes:
            super()._flood_again(packet, now_ns=now_ns)
        elif not self._calls.holds(_key(packet)):
            self._calls.push(packet, now_ns=now_ns)

    def overheard(self, key: int, *, now_ns: int) -> None:
        super().overheard(key, now_ns=now_ns)
        self._calls.cancel(key)

    # --- contending -----------------------------------------------------------------------------------------------

    def _contending_ns(self, start_ns: int) -> int:
        plan = self._plan_at(start_ns)
        return start_ns if plan is None else plan.turns.contending_ns(start_ns, self._window_random)

    def _start_ns(self, *, now_ns: int, jitter_ns: int) -> int:
        # A flood whose relays wait for longer than the window lasts goes one hop a superframe.
        most_ns = round(self._port.scenario.clusters.contention_ms * MS * _JITTER)
        return self._contending_ns(super()._start_ns(now_ns=now_ns, jitter_ns=min(jitter_ns, most_ns)))

    def hello_start_ns(self, start_ns: int) -> int:
        plan = self._plan_at(start_ns)
        if plan is not None and plan.calls:
            claimed_ns = self._calls.claim(not_before_ns=start_ns, now_ns=start_ns - self._lead_ns)
            if claimed_ns is not None:
                return claimed_ns
        return self._contending_ns(start_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        admission_ns = self._admission.next_wake_ns() if self._admission else None
        return earliest(super().next_wake_ns(), self._roots.next_wake_ns(), self._calls.next_wake_ns(), admission_ns)

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        lost = self._admission.wake(now_ns) if self._admission else None
        if lost is not None:
            self._port.record(lost)
        for packet in self._roots.expire(before_us=(now_ns - self._lifetime_ns) // US):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
        for packets, start_ns in self._roots.due(now_ns=now_ns):
            self._floods.begin(packets, start_ns=start_ns, again_ns=self._repetitions(start_ns))
        if len(self._roots) and not self._roots.has_turn(now_ns=now_ns):
            for packet in self._roots.drain():  # that was our last turn: the next timetable has none for us
                self._forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)
        for packets, start_ns in self._calls.due(now_ns=now_ns):
            self._floods.answer(packets, start_ns=start_ns)

    def _repetitions(self, start_ns: int) -> list[int]:
        """When a frame that we let out at an instant is repeated."""
        plan = self._plan_at(start_ns)
        turn = None if plan is None else plan.turns.turn_at(start_ns)
        if plan is None or turn is None:
            return []
        frame_ns = plan.turns.frame_start_ns(start_ns)
        return [plan.turns.start_ns(later, frame_start_ns=frame_ns) for later in plan.again.get(turn, ())]

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return super().waiting() + len(self._roots)

    def bound_ns(self) -> int | None:
        """The bound of our own bulk, from application to application, under the newest timetable; None: no bound."""
        if not self._bounds_ns or self._leader is not None or not self._in_step():
            return None
        return self._bounds_ns[-1].get(PRIORITY_BULK)

    def likely_ns(self) -> int | None:
        """Within which time `LIKELY_SHARE` of the nodes have a packet of ours, where links lose frames; None: no such
        time is known, or more packets are waiting than a superframe lets out.
        """
        plan = self._plans[-1] if self._plans else None
        if plan is None or plan.odds is None or len(self._roots) > len(plan.roots) or not plan.roots:
            return None
        if self._leader is not None or plan.table.uncovered[self._port.node] or not self._in_step():
            return None  # schedules go before our own packets
        found_ns = plan.likely_ns(
            self._port.node,
            interval_ns=self._interval_ns,
            hello_ns=seconds_to_ns(self._port.scenario.routing.hello_interval_s),
        )
        return None if found_ns is None else found_ns + self._lead_ns + receipt_ns(self._port.scenario)

    def _in_step(self) -> bool:
        """Whether the turns' slack holds what is known of the swarm's clocks."""
        return clocks_fit(self._port.scenario, clock_error_ns=self._port.clock_error_ns)

    def report(self) -> Mapping[str, object]:
        bound_ns, likely_ns = self.bound_ns(), self.likely_ns()
        return {
            **super().report(),
            "likely_ms": None if likely_ns is None else likely_ns / MS,
            "likely_share": None if likely_ns is None else LIKELY_SHARE,
            "missed_turns": self._missed,
            "bound_ms": None if bound_ns is None else bound_ns / MS,
            "bounds_ms": {_CLASSES[p]: ns / MS for p, ns in self._bounds_ns[-1].items()} if self._bounds_ns else {},
            "planned": bool(self._plans),
        }


def _version_of(links: Links) -> Version:
    return Version(Authority(links.term, NodeId(links.node)), links.epoch)


def _key(packet: Packet) -> int:
    return key_of(origin=packet.header.origin, seq=packet.header.seq)
