"""Roles that a leader assigns: a node floods a JOIN, and the leader floods a SCHEDULE with the clusters and heads.

`failover.py` decides by the table in `states.py` which state a node takes. This file carries that out: it joins,
announces schedules, and tells the access what the schedule makes of this node.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from fanet_mw.bounds.slot_service import slot_guard_ns
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbor
from fanet_mw.node.packet import Packet
from fanet_mw.node.reader import decoded
from fanet_mw.routing.clustered.contract import ScheduledAccess
from fanet_mw.routing.clustered.forwarding.gradient import UNREACHABLE, Gradient, RouteToHead
from fanet_mw.routing.clustered.links.link_quality import LinkQuality
from fanet_mw.routing.clustered.roles.contract import Timetabling
from fanet_mw.routing.clustered.roles.failover import Failover
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness, NeighborFailureDetector
from fanet_mw.routing.clustered.roles.joining import Joining
from fanet_mw.routing.clustered.roles.leader import Leader
from fanet_mw.routing.clustered.roles.leader_election import Authority, Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.schedule_check import ScheduleCheck, ScheduleRefresh
from fanet_mw.routing.clustered.roles.states import Action
from fanet_mw.units import US, NodeId
from fanet_mw.wire import Kind
from fanet_mw.wire.hello.beacon import Beacon
from fanet_mw.wire.links import Links
from fanet_mw.wire.schedule import Join, Schedule


class MakeLeader(Protocol):
    """Makes the object that does the leader's work, for a node that becomes leader."""

    def __call__(self, authority: Authority, *, epoch: int, elected: bool, now_ns: int) -> Leader: ...


class RoleParts(NamedTuple):
    """The parts that make up the roles of a node."""

    membership: Membership
    lease: Lease
    failover: Failover
    joining: Joining
    refresh: ScheduleRefresh
    check: ScheduleCheck
    detector: NeighborFailureDetector | None
    """The failure detector for all neighbors; None if only heads are watched."""
    links: LinkQuality | None
    """The measured quality of the node's links; None if links are not measured."""
    liveness: Liveness


class AssignedRoles:
    """The roles of one node."""

    def __init__(
        self,
        port: Port,
        parts: RoleParts,
        *,
        gradient: Gradient,
        access: ScheduledAccess,
        timetabling: Timetabling,
        make_leader: MakeLeader,
    ) -> None:
        self.parts = parts
        self._port = port
        self._gradient = gradient
        self._access = access
        self._timetabling = timetabling
        self._make_leader = make_leader
        self._leader: Leader | None = None
        self._place = parts.membership.place
        """The role of this node, as the access was last told."""

    def start(self, now_ns: int) -> None:
        leads = self._port.node == self._port.scenario.leader
        self.parts.failover.start(now_ns, leads=leads)
        if self.parts.links is not None:
            self.parts.links.start(now_ns)
        if leads:
            self._lead(elected=False, now_ns=now_ns)
        else:
            self.parts.joining.start(now_ns)

    # --- received packets -----------------------------------------------------------------------------------------

    def on_sign_of_life(self, node: int, *, born_ns: int, now_ns: int) -> None:
        if born_ns > now_ns:
            born_ns = now_ns
        actions = self.parts.failover.on_sign_of_life(node, born_ns=born_ns, now_ns=now_ns)
        if actions:
            self._do(actions, now_ns)

    def on_control(self, packet: Packet, src: NodeId, *, now_ns: int) -> bool:
        """A flooded control packet; True if all must pass it on at once. Raises MalformedFrameError for nonsense."""
        kind, ours = packet.header.kind, packet.header.origin == self._port.node
        if kind == Kind.JOIN:
            join = decoded(packet.frame, Join.decode_frame)
            self._on_join(packet, join, src, now_ns)
            # the join of a node that has a place only updates its position, and need not be relayed by all nodes
            return bool(join.instead_of) or not self.parts.membership.lists(packet.header.origin)
        if kind == Kind.SCHEDULE and not ours:
            self.parts.check.check(decoded(packet.frame, Schedule.decode_frame), now_ns)
            self._on_schedule(packet, now_ns=now_ns)
        elif kind == Kind.LINKS and not ours and self.parts.links is not None:
            self._timetabling.on_links(packet, now_ns=now_ns)
            self.parts.joining.on_links_announced()
        return kind == Kind.SCHEDULE

    def _on_join(self, packet: Packet, join: Join, src: NodeId, now_ns: int) -> None:
        parts, header, born_ns = self.parts, packet.header, min(packet.header.origin_us * US, now_ns)
        if join.node != header.origin or join.instead_of > self._port.scenario.node_count:
            raise MalformedFrameError(f"join of {join.node} instead of {join.instead_of} by {header.origin}")
        if self._leader is not None:
            told = decoded(packet.frame, Links.decode_frames) if parts.links is not None else None
            self._leader.on_join(join, parts.joining.motion(now_ns), born_ns=born_ns, now_ns=now_ns)
            if told is not None:
                self._leader.on_links(NodeId(join.node), told.links)
        if join.instead_of:
            if parts.detector is not None:
                parts.detector.on_report(NodeId(join.instead_of), now_ns=now_ns)
            if join.instead_of != join.node:
                self._timetabling.on_called_silent(NodeId(join.instead_of), now_ns)
            self._do(parts.failover.on_stand_in(join, born_ns=born_ns, now_ns=now_ns), now_ns)
        if join.node == parts.membership.head:
            self._gradient.on_flood_of_head(NodeId(join.node), parent=src, hops=header.hops + 1, now_ns=now_ns)

    def _on_schedule(self, packet: Packet, *, now_ns: int) -> None:
        """Handle a leader's announcement, whether received or made by this node."""
        schedule, parts = decoded(packet.frame, Schedule.decode_frame), self.parts
        details = self._timetabling.read(packet, schedule)
        if schedule.leader != packet.header.origin:
            raise MalformedFrameError(f"schedule of {schedule.leader} by {packet.header.origin}")
        before = parts.membership.version
        actions = parts.failover.on_schedule(
            schedule,
            guard_ns=slot_guard_ns(self._port.scenario, clock_error_ns=self._port.clock_error_ns),
            born_ns=min(packet.header.origin_us * US, now_ns),
            now_ns=now_ns,
        )
        if parts.membership.version != before:
            parts.check.on_new_schedule(now_ns)
        authority = Authority(schedule.term, schedule.leader)
        if authority == parts.lease.authority and schedule.epoch == self._epoch_followed:
            parts.refresh.keep(packet, schedule.part, authority, schedule.epoch, now_ns=now_ns)
        self._do(actions, now_ns)
        if parts.membership.is_head:
            self._access.renew_slot()
        self._timetabling.on_schedule(packet, schedule, details, now_ns=now_ns)

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:
        """A schedule in this node's name that it has not made: announce a later one, as OSPF does (RFC 2328, 13.4)."""
        if packet.header.kind == Kind.SCHEDULE and self._leader is not None:
            schedule = decoded(packet.frame, Schedule.decode_frame)
            self.parts.check.check(schedule, now_ns)
            if Authority(schedule.term, schedule.leader) == self.parts.lease.authority:
                self._leader.on_outbid(schedule.epoch, now_ns=now_ns)

    def on_hello(self, neighbor: Neighbor, *, born_ns: int, now_ns: int) -> None:
        parts = self.parts
        if parts.detector is not None:
            parts.detector.on_hello(neighbor.node, now_ns=now_ns)
        if parts.links is not None:
            parts.links.on_hello(neighbor.node, rssi_dbm=neighbor.rssi_dbm, now_ns=now_ns)
        self.on_sign_of_life(neighbor.node, born_ns=born_ns, now_ns=now_ns)
        if parts.lease.fresh(now_ns):
            parts.refresh.on_beacon(neighbor.beacon, now_ns=now_ns)

    def on_deaf(self, neighbor: NodeId, *, now_ns: int) -> None:
        """A neighbor's hello states that it hears nobody."""
        if self.parts.detector is not None:
            self.parts.detector.on_deaf(neighbor, now_ns=now_ns)

    def on_flooding(self, due_ns: int) -> None:
        """An own application's packet will be flooded to all nodes from the instant `due_ns` on."""
        self.parts.joining.on_flooding(due_ns)

    def show(self, now_ns: int) -> None:
        """Flood a word of this node, by which others learn the way to it."""
        if self.parts.failover.placed:
            self._join(now_ns)

    def on_parent_lost(self, parent: NodeId, *, now_ns: int) -> None:
        """The next hop to a head did not acknowledge a unicast frame."""
        self.parts.failover.on_unreachable(parent, now_ns=now_ns)

    # --- the node's role in the swarm -----------------------------------------------------------------------------

    @property
    def _epoch_followed(self) -> int:
        """The newest epoch of the leader that this node follows; 0 if it has announced no schedule yet."""
        version = self.parts.membership.version
        return version.epoch if version and version.authority == self.parts.lease.authority else 0

    def _do(self, actions: Sequence[Action], now_ns: int) -> None:
        """Carry out the actions that the table of states has given."""
        parts = self.parts
        for action in actions:
            if action is Action.CALL:
                self._lead(elected=True, now_ns=now_ns)
            elif action in (Action.JOIN, Action.LEAVE, Action.STEP_DOWN):
                self._leader = None
                parts.joining.ask_for_a_place(now_ns)
            elif action in (Action.TAKE_OVER, Action.OBJECT):
                silent = parts.failover.silent_head if action is Action.TAKE_OVER else self._port.node
                self._join(now_ns, instead_of=silent)
            elif parts.failover.placed:
                parts.joining.rest()
        if self._place != parts.membership.place:
            self._place = parts.membership.place
            self._change_role(now_ns)

    def _change_role(self, now_ns: int) -> None:
        self._gradient.join(self._place.head, now_ns=now_ns)
        self._port.record(self._place.at(now_ns, self._port.node))
        if self.parts.membership.is_head:
            self._access.serve(now_ns)

    def _lead(self, *, elected: bool, now_ns: int) -> None:
        authority = self.parts.lease.authority
        assert authority is not None, "a node that leads has taken office"
        self.parts.joining.rest()
        self._leader = self._make_leader(authority, epoch=self.parts.membership.epoch, elected=elected, now_ns=now_ns)
        self._leader.fly(self.parts.joining.motion(now_ns))

    def _join(self, now_ns: int, *, instead_of: int = 0) -> None:
        """Flood a join: it states the node's position to all, and asks the leader for a place if the node has none."""
        again = not self.parts.failover.placed and self._leader is None
        inner = self.parts.joining.join(instead_of=instead_of, again=again, now_ns=now_ns)
        urgent, patient = instead_of == self._port.node, not again
        self._access.flood_control(Kind.JOIN, inner, now_ns=now_ns, urgent=urgent, patient=patient)

    def _announce(self, part: Schedule, leader: Leader, *, now_ns: int) -> None:
        """Flood one part of the leader's schedule, and follow it as all other nodes do."""
        inner = part.encode_frame(self._port.node) + self._timetabling.addition(part, leader)
        self._on_schedule(self._access.flood_control(Kind.SCHEDULE, inner, now_ns=now_ns), now_ns=now_ns)
        for links in self._timetabling.links_to_send_after(part, leader) if self._leader is not None else ():
            self._timetabling.on_links(self._access.flood_control(Kind.LINKS, links, now_ns=now_ns), now_ns=now_ns)

    # --- hellos ---------------------------------------------------------------------------------------------------

    def before_hello(self, now_ns: int) -> None:
        parts, leader = self.parts, self._leader
        self._timetabling.review(now_ns)
        if leader is not None:
            leader.fly(parts.joining.motion(now_ns))
        if leader is None and self._timetabling.must_show(now_ns):
            self._join(now_ns)
        elif leader is None:
            parts.joining.update_if_outdated(listed=parts.membership.nodes_listed, now_ns=now_ns)
        elif parts.links is not None and parts.links.outdated(now_ns=now_ns):
            leader.on_links(self._port.node, parts.links.tell(now_ns=now_ns))
        if parts.detector is not None:
            self._report_silent_neighbor(parts.detector, now_ns)

    def _report_silent_neighbor(self, detector: NeighborFailureDetector, now_ns: int) -> None:
        """Flood a report of a silent neighbor, for the leader and for that neighbor, if it lives."""
        silent = detector.find_suspect(self.parts.membership.lists, now_ns=now_ns)
        if silent is None:
            return
        detector.on_report(silent, now_ns=now_ns)
        if self._leader is not None:
            self._leader.on_suspicion(silent, self._port.node, self.parts.joining.motion(now_ns), now_ns=now_ns)
        self._timetabling.on_called_silent(silent, now_ns)
        self._join(now_ns, instead_of=silent)

    def beacon(self, route: RouteToHead | None, *, now_ns: int) -> Beacon:
        membership, lease = self.parts.membership, self.parts.lease
        term, leader = lease.authority if lease.fresh(now_ns) and lease.authority else (0, 0)
        return Beacon(
            node=self._port.node,
            head=route.head if route else 0,
            head_seq=route.head_seq if route else 0,
            cluster=membership.cluster,
            epoch=self._epoch_followed,
            role=membership.role,
            hops_to_head=route.hops if route else UNREACHABLE,
            slot=membership.slot,
            term=term,
            leader=leader,
        )

    def hello_share(self, now_ns: int) -> float:
        return 1.0 if self.parts.links is None else self.parts.links.hello_share(now_ns=now_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        parts, leader = self.parts, self._leader
        first_ns = leader.next_wake_ns() if leader else parts.failover.next_wake_ns()
        for due_ns in (parts.joining.due_ns, parts.refresh.due_ns):
            if due_ns is not None and (first_ns is None or due_ns < first_ns):
                first_ns = due_ns
        return first_ns

    def wake(self, now_ns: int) -> None:
        parts = self.parts
        actions = parts.failover.wake(now_ns)
        if actions:
            self._do(actions, now_ns)
        if parts.joining.due_ns is not None and now_ns >= parts.joining.due_ns:
            self._join(now_ns)
        leader = self._leader
        if leader is not None and now_ns >= leader.next_wake_ns():
            notice_ns, lost_ns = self._timetabling.notice_ns(now_ns), self._timetabling.lost_ns(now_ns)
            motion = parts.joining.motion(now_ns)
            for part in leader.wake(motion, notice_ns=notice_ns, lost_ns=lost_ns, now_ns=now_ns):
                self._announce(part, leader, now_ns=now_ns)
        if (due_ns := parts.refresh.due_ns) is not None:
            for packet in parts.refresh.due(now_ns=now_ns):
                self._access.answer(packet, due_ns=due_ns, now_ns=now_ns)

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        return self.parts.membership.clusters()

    def report(self) -> Mapping[str, object]:
        membership, authority = self.parts.membership, self.parts.lease.authority
        return {
            "role": membership.role.name.lower(),
            "state": self.parts.failover.state.value,
            "leader": authority.leader if authority else 0,
            "term": authority.term if authority else 0,
            "cluster": membership.cluster,
            "head": membership.head,
            "epoch": membership.epoch,
            "slots": None if membership.superframe is None else membership.superframe.report(),
        }
