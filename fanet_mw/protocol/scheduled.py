"""The clustered protocol with collision-free floods: every packet goes to its head and on to everyone in turns.

    join -> schedule with places -> everyone computes the same timetable -> from its first superframe on, turns

A node that hears a packet in a turn knows from the turn and the sender whose flood it is, and so its own turn. What is
heard outside of any turn is not relayed. Until a timetable is in force, and for whatever is no data, the rules of
`clustered` hold; then all but floods of data contend in the window at the beginning of each superframe.
"""

from collections.abc import Mapping
from typing import Final

from fanet_mw.errors import DropReason
from fanet_mw.messages import Reception
from fanet_mw.places import Places, rounded
from fanet_mw.protocol.admission import Admission, Own
from fanet_mw.protocol.arrival import decoded
from fanet_mw.protocol.clustered import Clustered
from fanet_mw.protocol.contract import Port
from fanet_mw.protocol.lease import Authority
from fanet_mw.protocol.membership import Version
from fanet_mw.protocol.root_release import RootRelease
from fanet_mw.protocol.turn_plan import Plan, fit, leader_load
from fanet_mw.protocol.turns import clocks_fit, receipt_ns
from fanet_mw.protocol.txqueue import Packet, TxQueue, sooner_us
from fanet_mw.trace import BoundStated
from fanet_mw.units import MS, US, Enu, NodeId, earliest, seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK, Kind
from fanet_mw.wire_messages import Schedule

_JITTER: Final = 0.25
"""Of the contention window: the most that a relay waits there."""


class Scheduled(Clustered):
    """Clustered, time-divided flooding without contention, at one node."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        scenario = port.scenario
        self._lifetime_ns = seconds_to_ns(scenario.routing.lifetime_s)
        self._window_random = port.stream("window").random
        self._roots = RootRelease(
            TxQueue(capacity=scenario.routing.queue_frames, sooner_us=sooner_us(scenario.routing)),
            lead_ns=self._lead_ns,
        )
        self._plans: list[Plan] = []
        self._schedules: dict[int, tuple[Schedule, Places]] = {}
        self._version: Version | None = None
        self._planned: Version | None = None
        self._missed = 0
        self._steady_ns: int | None = None
        """Since when the bound of the newest plan holds: no packet from before it is waiting."""
        self._interval_ns = seconds_to_ns(scenario.traffic.interval_s)
        self._admission = (
            None
            if scenario.traffic.deadline_s is None or (port.node == scenario.leader and not leader_load(scenario))
            else Admission(
                port.node, deadline_ns=seconds_to_ns(scenario.traffic.deadline_s), interval_ns=self._interval_ns
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
        self._schedules[schedule.part] = schedule, places
        if len(self._schedules) == schedule.parts and self._planned != version:
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
        found = fit(
            self._port.scenario,
            tuple(sorted(at.items())),
            {node: heads[cluster] for node, cluster in sorted(cluster_of.items())},
            leader=NodeId(schedule.leader),
            origin_ns=schedule.start_us * US,
            period_ns=schedule.period_us * US,
        )
        self._steady_ns = None
        if found is None:
            self._plans = []  # not even one packet of each head fits a superframe; `fanet plan` says so before take-off
            self._admit(None, now_ns=now_ns)
        else:
            valid_ns = max(now_ns, schedule.start_us * US)
            self._plans = [*self._plans[-1:], Plan.of(self._port.node, valid_ns, found)]
            self._admit(self._own(), now_ns=now_ns)
        self._roots.follow(
            [(plan.valid_ns, plan.turns, plan.roots, plan.frame_bytes) for plan in self._plans], now_ns=now_ns
        )
        stranded = [] if self._plans and self._plans[-1].roots else self._roots.drain()
        for packet in [*stranded, *self._release.drain(), *self._uplink.drain()]:
            self._forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)

    def _plan_at(self, t_ns: int) -> Plan | None:
        for plan in reversed(self._plans):
            if plan.valid_ns <= t_ns:
                return plan
        return None

    # --- letting in -----------------------------------------------------------------------------------------------

    def _own(self) -> Own | None:
        """Our part of the newest plan, if it gives our packets a bound."""
        plan = self._plans[-1] if self._plans else None
        if plan is None or not plan.roots or not plan.whole or plan.table.uncovered[self._port.node]:
            return None
        if self._leader is not None:
            return None  # schedules go before our own packets
        return Own(plan.turns, plan.roots, plan.table.spans[self._port.node], plan.together)

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
        bound_ns = self.bound_ns() if packet.header.priority == PRIORITY_BULK else None
        if bound_ns is not None:
            self._port.record(BoundStated(now_ns, self._port.node, packet.header.seq, bound_ns))

    # --- letting out ----------------------------------------------------------------------------------------------

    def _forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        if self._plans and self._plans[-1].roots:
            self._let_out(packet, now_ns=now_ns)
        else:
            super()._forward(packet, start_ns=self._contending_ns(start_ns), now_ns=now_ns, tries=tries)

    def _let_out(self, packet: Packet, *, now_ns: int) -> None:
        if len(packet.frame) > self._plans[-1].frame_bytes:
            self._port.drop(DropReason.TOO_LARGE, packet, now_ns=now_ns)
            return
        if packet.header.origin != self._port.node or packet.header.kind != Kind.DATA:
            self._steady_ns = None  # a neighbor's that has no turns yet, or control: the bound is for our data alone
        elif (
            self._steady_ns is None and not len(self._roots) and now_ns >= self._plans[-1].valid_ns and self._in_step()
        ):
            self._steady_ns = packet.header.origin_us * US
        evicted = self._roots.push(packet, now_ns=now_ns)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    def _enqueue(self, packet: Packet, *, now_ns: int) -> None:
        if self._plans and self._plans[-1].roots:
            self._let_out(packet, now_ns=now_ns)
        else:  # the schedule has made us head, its timetable is still to come
            super()._enqueue(packet, now_ns=now_ns)

    def _flood_control(self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False) -> Packet:
        if (kind is Kind.JOIN and not urgent) or not self._plans or not self._plans[-1].roots:
            # Our turns are for what the bound is about; a join may contend.
            return super()._flood_control(kind, inner, now_ns=now_ns)
        packet = self._floods.control(kind, inner, now_ns=now_ns)
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
        own = plan.mine.get((root, instance))
        if own is None or packet.header.hop_limit <= 1:
            return
        frame_ns = plan.turns.frame_start_ns(reception.end_ns) - offset // plan.turns.per_frame * plan.turns.period_ns
        start_ns = plan.turns.start_ns(own, frame_start_ns=frame_ns)
        if start_ns < now_ns:  # a reception that came late has used up some of the lead, or all of it
            self._missed += 1
            return
        self._floods.relay(packet, start_ns=start_ns)

    # --- contending -----------------------------------------------------------------------------------------------

    def _contending_ns(self, start_ns: int) -> int:
        plan = self._plan_at(start_ns)
        return start_ns if plan is None else plan.turns.contending_ns(start_ns, self._window_random)

    def _start_ns(self, *, now_ns: int, jitter_ns: int) -> int:
        # A flood whose relays wait for longer than the window lasts goes one hop a superframe.
        most_ns = round(self._port.scenario.clusters.contention_ms * MS * _JITTER)
        return self._contending_ns(super()._start_ns(now_ns=now_ns, jitter_ns=min(jitter_ns, most_ns)))

    def hello_start_ns(self, start_ns: int) -> int:
        return self._contending_ns(start_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        admission_ns = self._admission.next_wake_ns() if self._admission else None
        return earliest(super().next_wake_ns(), self._roots.next_wake_ns(), admission_ns)

    def wake(self, now_ns: int) -> None:
        super().wake(now_ns)
        lost = self._admission.wake(now_ns) if self._admission else None
        if lost is not None:
            self._port.record(lost)
        for packet in self._roots.expire(before_us=(now_ns - self._lifetime_ns) // US):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
        for packets, start_ns in self._roots.due(now_ns=now_ns):
            self._floods.begin(packets, start_ns=start_ns)

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return super().waiting() + len(self._roots)

    def bound_ns(self) -> int | None:
        """The longest that a packet of our own may take to everyone, from generation; None: no bound."""
        own = self._own()
        if own is None or self._steady_ns is None or not self._in_step():
            return None
        interval_ns = self._admission.interval_ns if self._admission else self._interval_ns
        worst_ns = own.worst_ns(interval_ns=interval_ns)
        return None if worst_ns is None else self._lead_ns + worst_ns + receipt_ns(self._port.scenario)

    def _in_step(self) -> bool:
        """Whether the turns' slack holds what is known of the swarm's clocks."""
        return clocks_fit(self._port.scenario, clock_error_ns=self._port.clock_error_ns)

    def report(self) -> Mapping[str, object]:
        bound_ns = self.bound_ns()
        return {
            **super().report(),
            "missed_turns": self._missed,
            "bound_ms": None if bound_ns is None else bound_ns / MS,
            "bound_from_ms": None if self._steady_ns is None else self._steady_ns / MS,
            "planned": bool(self._plans),
        }
