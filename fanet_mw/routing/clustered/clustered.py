"""The paper's protocol (3.3): edge nodes unicast to their head; heads queue and flood in their own slots only.

A packet has two phases, told apart by the header's flags: TO_HEAD, carried as acknowledged unicast along the gradient
to a head (`uplink.py`), and FLOOD, released by the head in its slot and relayed once by every node (`floods.py`).
Membership comes over the air: nodes join by a flooded JOIN, the leader answers with a flooded SCHEDULE. What becomes of
a node when heads and leaders die, and parts of the swarm meet, is decided in `upkeep.py`; this file carries it out.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bounds.guard import slot_guard_ns
from fanet_mw.bus.messages import Reception, TxStatus
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.arrival import decoded
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.node.queue import Packet, TxQueue, sooner_us
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.gradient import UNREACHABLE, Gradient
from fanet_mw.routing.clustered.forwarding.repair import Repair
from fanet_mw.routing.clustered.forwarding.uplink import Uplink
from fanet_mw.routing.clustered.relaying.relay import Relay
from fanet_mw.routing.clustered.roles.failover import Upkeep
from fanet_mw.routing.clustered.roles.failure_detector import Silence
from fanet_mw.routing.clustered.roles.leader import SETTLE_NS, Leader
from fanet_mw.routing.clustered.roles.lease import Authority, Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.position_updates import Motion, Whereabouts
from fanet_mw.routing.clustered.roles.schedule_refresh import Refresh
from fanet_mw.routing.clustered.roles.signs_of_life import Signs
from fanet_mw.routing.clustered.roles.states import Action
from fanet_mw.routing.clustered.tdma.slot_release import Release, Tenure
from fanet_mw.routing.clustered.timetable.link_quality import LinkQuality
from fanet_mw.units import BROADCAST, MS, US, NodeId, S, earliest, seconds_to_ns
from fanet_mw.wire import FLAG_FLOOD, FLAG_TO_HEAD, Kind
from fanet_mw.wire.digest import Digest, capacity
from fanet_mw.wire.inner import Beacon, Join, Schedule
from fanet_mw.wire.links import Links

_HELLO_LIFETIMES: Final = 3.5
"""A neighbor is gone after this many silent hello intervals (OLSR's NEIGHB_HOLD_TIME is 3, RFC 3626 18.3)."""
_JOIN_WINDOW_NS: Final = 3 * S
"""Joins are floods: spread, so that a swarm that starts together does not drown in them."""
_REJOIN_NS: Final = 2 * S
_UPDATE_NS: Final = 100 * MS
"""Joins that only tell a new position are spread over this much per node: ten floods a second when all turn at once."""
_CONTROL_JITTER_NS: Final = 100 * MS
_START_NS: Final = 60 * S
_START_PERIODS: Final = 100
"""A schedule that starts later than this minute and so many periods after it comes was made by nobody: one of turns is
announced as long ahead as the bounds under the one before need, and those are some superframes."""
_EPOCHS: Final = 16
"""Epochs that may have been missed besides those for which there was time since the last."""
_HALF_EPOCHS: Final = 0x8000
_STORE_PACKETS: Final = 4096
"""Packets kept for repair; 4 MB at 1024 B."""


class Clustered(RoutingProtocol):
    """Clustered, time-divided flooding at one node."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        scenario = port.scenario
        self._random = port.stream("clustered").random
        self._lead_ns = scenario.radio.lead_ns
        self._jitter_ns = scenario.routing.jitter_ns
        self._lifetime_us = round(scenario.routing.lifetime_s * 1_000_000)
        self._relay = Relay(scenario.clusters, self._random)
        hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        self._neighbors = Neighbors(lifetime_ns=int(_HELLO_LIFETIMES * hello_ns))
        self._gradient = Gradient(node=port.node, neighbors=self._neighbors, hello_ns=hello_ns)
        self._membership = Membership(port.node)
        self._release = Release(
            TxQueue(capacity=scenario.routing.queue_frames, sooner_us=sooner_us(scenario.routing)),
            scenario.clusters,
            lead_ns=self._lead_ns,
        )
        self._leader: Leader | None = None
        self._signs = Signs()
        self._lease = Lease(port.node, period_ns=scenario.clusters.period_ns, signs=self._signs)
        self._upkeep = Upkeep(
            membership=self._membership, gradient=self._gradient, signs=self._signs, lease=self._lease,
            node=port.node, hello_ns=hello_ns, takes_slot=scenario.clusters.relay != "scheduled",
        )  # fmt: skip
        self._uplink = Uplink(port, self._gradient, self._upkeep)
        by_places = scenario.clusters.relay == "scheduled"
        self._silence = Silence(self._signs, hello_ns=hello_ns) if by_places else None
        self._links = LinkQuality(port.node, hello_ns=hello_ns) if scenario.measures_links else None
        self._refresh = Refresh(port.stream("refresh").random)
        self._whereabouts = Whereabouts(range_m=scenario.clusters.link_m or scenario.radio.range_m)
        self._repair = Repair(
            window_ns=scenario.repair_ns,
            capacity=_STORE_PACKETS,
            random=port.stream("repair").random,
        ) if scenario.repair_ns else None  # fmt: skip
        self._floods = Floods(port, self._repair)
        self._join_ns: int | None = None
        self._period_us = scenario.clusters.period_ns // US
        self._renewed_ns = 0
        """When the schedule that we follow last changed."""
        self._role = self._membership.standing
        self._tenure: Tenure | None = None
        """The slot that is ours, or was when we last were head."""

    # --- the application's packets --------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        leads = self._port.node == self._port.scenario.leader
        self._upkeep.start(now_ns, leads=leads)
        if self._links is not None:
            self._links.start(now_ns)
        if leads:
            self._lead(elected=False, now_ns=now_ns)
        else:
            self._join_ns = now_ns + 500 * MS + int(self._random() * _JOIN_WINDOW_NS)

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._floods.keep(packet, flooded=False, now_ns=due_ns)
        if packet.header.destination == BROADCAST:
            self._whereabouts.flooded(due_ns)
        self._forward(packet, start_ns=due_ns, now_ns=now_ns, tries=0)

    def _forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int) -> None:
        """Bring a packet one step nearer to a head, or queue it if we are one."""
        if self._membership.is_head:
            self._enqueue(packet, now_ns=now_ns)
        else:
            self._uplink.send(packet, start_ns=start_ns, now_ns=now_ns, tries=tries)

    def _enqueue(self, packet: Packet, *, now_ns: int) -> None:
        assert self._tenure is not None, "who queues is head, or was"
        evicted = self._release.push(packet, self._tenure, now_ns=now_ns)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)

    # --- what the air brings --------------------------------------------------------------------------------------

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        flags = packet.header.flags
        self._notice(packet.header.origin, packet.header.origin_us * US, now_ns)
        self._floods.keep(packet, flooded=bool(flags & FLAG_FLOOD), now_ns=now_ns)
        if flags & FLAG_FLOOD:
            self._consume_control(packet, reception.src, now_ns=now_ns)
            self._flood_on(packet, reception, now_ns=now_ns)
        elif flags & FLAG_TO_HEAD:
            if packet.header.hop_limit <= 1:
                self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            else:
                self._forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)

    def _flood_on(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        """Relay a flooded packet, now or after assessment; control packets at once and by everyone."""
        if packet.header.destination == self._port.node:
            return
        if packet.header.hop_limit <= 1:
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
        elif packet.header.kind in (Kind.JOIN, Kind.SCHEDULE) and not self._routine(packet):
            self._transmit_relay(packet, _CONTROL_JITTER_NS, now_ns=now_ns)
        elif self._relay.first_copy(packet, self._neighbors, now_ns=now_ns):
            self._transmit_relay(packet, self._jitter_ns, now_ns=now_ns)

    def _routine(self, packet: Packet) -> bool:
        """A join of one who has a place: it tells where it is, and need not be relayed by everyone."""
        if packet.header.kind != Kind.JOIN or not self._membership.lists(packet.header.origin):
            return False
        return not decoded(packet, Join.decode_frame).instead_of

    def _transmit_relay(self, packet: Packet, jitter_ns: int, *, now_ns: int) -> None:
        self._floods.relay(packet, start_ns=self._start_ns(now_ns=now_ns, jitter_ns=jitter_ns))

    def _start_ns(self, *, now_ns: int, jitter_ns: int) -> int:
        """When a frame may go that is ready now."""
        return now_ns + self._lead_ns + int(self._random() * jitter_ns)

    def overheard(self, key: int, *, now_ns: int) -> None:
        self._relay.assessment.another_copy(key)
        self._refresh.overheard(key, now_ns=now_ns)
        if self._repair:
            self._repair.overheard(key, now_ns=now_ns)

    def _consume_control(self, packet: Packet, src: NodeId, *, now_ns: int) -> None:
        """Joins and announcements of leaders. Malformed ones raise and are counted by the node."""
        if packet.header.kind == Kind.JOIN:
            join, born_ns = decoded(packet, Join.decode_frame), min(packet.header.origin_us * US, now_ns)
            if join.node != packet.header.origin or join.instead_of > self._port.scenario.nodes.count:
                raise MalformedFrameError(f"join of {join.node} instead of {join.instead_of} by {packet.header.origin}")
            if self._leader is not None:
                told = decoded(packet, Links.decode_frames) if self._links is not None else None
                self._leader.joined(join, born_ns=born_ns, now_ns=now_ns)
                if told is not None:
                    self._leader.measured(NodeId(join.node), told.links)
            if join.instead_of:
                if self._silence is not None:
                    self._silence.said(NodeId(join.instead_of), now_ns=now_ns)
                self._do(self._upkeep.stands_in(join, born_ns=born_ns, now_ns=now_ns), now_ns)
            if join.node == self._membership.head:
                self._gradient.flooded(NodeId(join.node), parent=src, hops=packet.header.hops + 1, now_ns=now_ns)
        elif packet.header.kind == Kind.SCHEDULE and packet.header.origin != self._port.node:
            self._check(decoded(packet, Schedule.decode_frame), now_ns)
            self._learn(packet, now_ns=now_ns)

    def _learn(self, packet: Packet, *, now_ns: int) -> None:
        """An announcement of a leader, perhaps our own."""
        schedule = decoded(packet, Schedule.decode_frame)
        if schedule.leader != packet.header.origin:
            raise MalformedFrameError(f"schedule of {schedule.leader} by {packet.header.origin}")
        before = self._membership.version
        actions = self._upkeep.announced(
            schedule,
            guard_ns=self._guard_ns(),
            born_ns=min(packet.header.origin_us * US, now_ns),
            now_ns=now_ns,
        )
        if self._membership.version != before:
            self._renewed_ns = now_ns
        authority = Authority(schedule.term, schedule.leader)
        if authority == self._lease.authority and schedule.epoch == self._epoch_followed:
            self._refresh.keep(packet, schedule.part, authority, schedule.epoch, now_ns=now_ns)
        self._do(actions, now_ns)
        if self._membership.is_head:
            self._own_slot()  # of another length, perhaps, or with another guard

    def _announce(self, part: Schedule, *, now_ns: int) -> None:
        """Flood a part of our assignment, which holds for us as well."""
        packet = self._flood_control(Kind.SCHEDULE, self._announcement(part), now_ns=now_ns)
        self._learn(packet, now_ns=now_ns)

    def _announcements(self, now_ns: int) -> Sequence[Schedule]:
        """The parts of a schedule to announce now."""
        return self._leader.wake(self._motion(now_ns), now_ns=now_ns) if self._leader else ()

    def _check(self, schedule: Schedule, now_ns: int) -> None:
        """Raise MalformedFrameError for what no leader of this swarm announces."""
        scenario, period_us, epoch = self._port.scenario, self._period_us, schedule.epoch
        slot_us = scenario.clusters.period_ns // schedule.clusters // US
        if schedule.period_us != period_us or schedule.slot_us != slot_us:
            raise MalformedFrameError(f"slots of {schedule.slot_us} in {schedule.period_us} us, not {period_us} us")
        if schedule.start_us * US > now_ns + _START_PERIODS * scenario.clusters.period_ns + _START_NS:
            raise MalformedFrameError(f"a schedule from {schedule.start_us} us on")
        if any(member.node > scenario.nodes.count for member in schedule.members):
            raise MalformedFrameError(f"a schedule of nodes beyond {scenario.nodes.count}")
        known = self._membership.version
        if known is None or known.authority != Authority(schedule.term, schedule.leader):
            return
        ahead = (epoch - known.epoch) & 0xFFFF
        most = _EPOCHS + (now_ns - self._renewed_ns) // min(scenario.clusters.period_ns, SETTLE_NS)
        if epoch and most < ahead < _HALF_EPOCHS:
            raise MalformedFrameError(f"epoch {epoch} after {known.epoch}: at most {most} can have been missed")

    def impersonated(self, packet: Packet, *, now_ns: int) -> None:
        """A schedule in our name, if we lead: we announce a later one (as of link states in OSPF, RFC 2328, 13.4)."""
        if packet.header.kind == Kind.SCHEDULE and self._leader is not None:
            schedule = decoded(packet, Schedule.decode_frame)
            self._check(schedule, now_ns)
            if Authority(schedule.term, schedule.leader) == self._lease.authority:
                self._leader.outbid(schedule.epoch, now_ns=now_ns)

    def _announcement(self, part: Schedule) -> bytes:
        """The inner frames of a schedule packet."""
        return part.encode_frame(self._port.node)

    @property
    def _epoch_followed(self) -> int:
        """The newest epoch of the leader that we obey; 0: it has only called so far."""
        version = self._membership.version
        return version.epoch if version and version.authority == self._lease.authority else 0

    # --- our part in the swarm ------------------------------------------------------------------------------------

    def _notice(self, node: int, born_ns: int, now_ns: int) -> None:
        """A node showed that it lives."""
        actions = self._upkeep.lives(node, born_ns=min(born_ns, now_ns), now_ns=now_ns)
        if actions:
            self._do(actions, now_ns)

    def _do(self, actions: Sequence[Action], now_ns: int) -> None:
        """Carry out what the table asks for."""
        for action in actions:
            if action is Action.CALL:
                self._lead(elected=True, now_ns=now_ns)
            elif action in (Action.JOIN, Action.LEAVE, Action.STEP_DOWN):
                self._leader = None
                if self._join_ns is None:
                    self._join_ns = now_ns + int(self._random() * _JOIN_WINDOW_NS)
            elif action in (Action.TAKE_OVER, Action.OBJECT):
                silent = self._upkeep.silent_head if action is Action.TAKE_OVER else self._port.node
                self._join(now_ns, instead_of=silent)
            elif self._upkeep.placed:
                self._join_ns = None
        if self._role != self._membership.standing:
            self._role = self._membership.standing
            self._change_role(now_ns)

    def _change_role(self, now_ns: int) -> None:
        """What is queued goes where the new role wants it."""
        role = self._role
        self._gradient.join(role.head, now_ns=now_ns)
        self._port.record(role.at(now_ns, self._port.node))
        if self._membership.is_head:
            self._release.arm(self._own_slot(), now_ns=now_ns)
            for packet in self._uplink.drain():
                self._enqueue(packet, now_ns=now_ns)

    def _own_slot(self) -> Tenure:
        superframe = self._membership.superframe
        assert superframe is not None, "a head has been named by a schedule"
        self._tenure = Tenure(superframe, self._membership.slot)
        return self._tenure

    def _lead(self, *, elected: bool, now_ns: int) -> None:
        authority = self._lease.authority
        assert authority is not None, "who leads has taken office"
        self._join_ns = None
        self._leader = Leader(
            authority, self._port.scenario, self._signs,
            epoch=self._membership.epoch, elected=elected, now_ns=now_ns,
        )  # fmt: skip

    def _motion(self, now_ns: int) -> Motion:
        return Motion(self._port.position, self._port.velocity, now_ns)

    def _guard_ns(self) -> int:
        return slot_guard_ns(self._port.scenario, clock_error_ns=self._port.clock_error_ns)

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        self._gradient.advance(now_ns)
        route = self._gradient.route(now_ns=now_ns)
        if (
            self._join_ns is None
            and self._leader is None
            and (
                self._whereabouts.outdated(self._port.position, now_ns=now_ns)
                or (
                    self._links is not None
                    and self._whereabouts.may_tell(now_ns)
                    and self._links.outdated(now_ns=now_ns)
                )
            )
        ):
            self._join_ns = now_ns + int(self._random() * _UPDATE_NS * (1 + self._membership.nodes_listed))
        if self._leader is not None and self._links is not None and self._links.outdated(now_ns=now_ns):
            self._leader.measured(self._port.node, self._links.tell(now_ns=now_ns))
        if self._silence is not None and self._whereabouts.may_tell(now_ns):
            self._tell_silence(self._silence, now_ns)
        term, leader = self._lease.authority if self._lease.fresh(now_ns) and self._lease.authority else (0, 0)
        beacon = Beacon(
            node=self._port.node,
            head=route.head if route else 0,
            head_seq=route.head_seq if route else 0,
            cluster=self._membership.cluster,
            epoch=self._epoch_followed,
            role=self._membership.role,
            hops_to_head=route.hops if route else UNREACHABLE,
            slot=self._membership.slot,
            term=term,
            leader=leader,
        ).encode_frame(self._port.node)
        if self._repair is None:
            return beacon
        digest = self._repair.digest(most=capacity(room - len(beacon)), now_ns=now_ns)
        return beacon + digest.encode_frames(self._port.node)

    def hello_share(self, *, now_ns: int) -> float:
        return 1.0 if self._links is None else self._links.hello_share(now_ns=now_ns)

    def _tell_silence(self, silence: Silence, now_ns: int) -> None:
        """Let the leader know of a neighbor that has fallen silent; who lives will hear it too, and object."""
        silent = silence.next_silent(self._membership.lists, now_ns=now_ns)
        if silent is None:
            return
        silence.said(silent, now_ns=now_ns)
        if self._leader is not None:
            self._leader.suspect(silent, self._port.node, self._motion(now_ns), now_ns=now_ns)
        self._join(now_ns, instead_of=silent)

    def hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        beacon, count = decoded(packet, Beacon.decode_frame), self._port.scenario.nodes.count
        if beacon.node != reception.src or beacon.head > count or beacon.leader > count:
            raise MalformedFrameError(f"beacon of {beacon.node}, head {beacon.head}, leader {beacon.leader}")
        digest = decoded(packet, Digest.decode_frames) if self._repair else None
        neighbor = Neighbor(reception.src, now_ns, reception.rssi_dbm, beacon)
        self._neighbors.heard(neighbor)
        if self._silence is not None:
            self._silence.heard(reception.src, now_ns=now_ns)
        if self._links is not None:
            self._links.hello(reception.src, rssi_dbm=reception.rssi_dbm, now_ns=now_ns)
        self._notice(reception.src, packet.header.origin_us * US, now_ns)
        if self._lease.fresh(now_ns):
            self._refresh.compare(neighbor.beacon, now_ns=now_ns)
        self._gradient.hear(neighbor, now_ns=now_ns)
        if self._repair and digest:
            self._repair.compare(digest, now_ns=now_ns)
        for held in self._uplink.released(now_ns=now_ns):
            self._forward(held, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=0)

    def status(self, status: TxStatus, *, now_ns: int) -> None:
        refused = self._uplink.ended(status, now_ns=now_ns)
        if refused is not None:
            start_ns = now_ns + self._lead_ns
            self._forward(refused.packet, start_ns=start_ns, now_ns=now_ns, tries=refused.tries)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        upkeep_ns = self._leader.next_wake_ns() if self._leader else self._upkeep.next_wake_ns()
        repair_ns = self._repair.next_wake_ns() if self._repair else None
        return earliest(
            self._join_ns, upkeep_ns, self._refresh.next_wake_ns(), self._release.next_wake_ns(),
            self._relay.assessment.next_wake_ns(), repair_ns,
        )  # fmt: skip

    def wake(self, now_ns: int) -> None:
        self._do(self._upkeep.wake(now_ns), now_ns)
        if self._join_ns is not None and now_ns >= self._join_ns:
            self._join(now_ns)
        for part in self._announcements(now_ns):
            self._announce(part, now_ns=now_ns)
        for packet in self._refresh.due(now_ns=now_ns):
            self._flood_again(packet, now_ns=now_ns)
        for packet in self._relay.assessment.decided(now_ns=now_ns):
            self._transmit_relay(packet, 0, now_ns=now_ns)
        for packet in self._repair.due(now_ns=now_ns) if self._repair else ():
            self._flood_again(packet, now_ns=now_ns)
        self._uplink.expire(now_ns=now_ns)
        horizon_us = now_ns // US - self._lifetime_us
        for packet in self._release.expire(before_us=horizon_us):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
        for packet, start_ns in self._release.due(self._tenure, now_ns=now_ns) if self._tenure else ():
            self._floods.begin([packet, *self._release.more(self._room(packet))], start_ns=start_ns)

    def _room(self, packet: Packet) -> int:
        """What a frame with this packet has left for others [bytes]."""
        scenario = self._port.scenario
        return scenario.radio.max_frame_bytes - len(packet.frame) if scenario.routing.aggregate else 0

    def _flood_again(self, packet: Packet, *, now_ns: int) -> None:
        """A neighbor lacks this packet."""
        frame = self._floods.again(packet)
        if frame is not None:
            self._port.transmit(frame, BROADCAST, start_ns=self._start_ns(now_ns=now_ns, jitter_ns=0))

    def _join(self, now_ns: int, *, instead_of: int = 0) -> None:
        """Tell everyone where we are, and the leader that we want a place if we have none."""
        waits = not self._upkeep.placed and self._leader is None
        self._join_ns = now_ns + _REJOIN_NS + int(self._random() * _JOIN_WINDOW_NS) if waits else None
        motion = self._motion(now_ns)
        self._whereabouts.told(motion)
        join = Join(self._port.node, motion.position, motion.velocity, instead_of)
        objects = instead_of == self._port.node
        inner = join.encode_frame(self._port.node)
        links = self._links.tell(now_ns=now_ns) if self._links is not None else ()
        if links:
            inner += Links(self._port.node, links).encode_frames()
        self._flood_control(Kind.JOIN, inner, now_ns=now_ns, urgent=objects)

    def _flood_control(self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False) -> Packet:
        """Tell everyone; `urgent`: before data, where there are turns for it."""
        packet = self._floods.control(kind, inner, now_ns=now_ns)
        self._port.transmit(packet.frame, BROADCAST, start_ns=self._start_ns(now_ns=now_ns, jitter_ns=0))
        return packet

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return len(self._uplink) + len(self._release) + len(self._relay.assessment)

    def report(self) -> Mapping[str, object]:
        return {
            "role": self._membership.role.name.lower(),
            "state": self._upkeep.state.value,
            "leader": self._lease.authority.leader if self._lease.authority else 0,
            "term": self._lease.authority.term if self._lease.authority else 0,
            "cluster": self._membership.cluster,
            "head": self._membership.head,
            "epoch": self._membership.epoch,
            "waiting": self.waiting(),
            "repaired": self._repair.repaired if self._repair else 0,
        }
