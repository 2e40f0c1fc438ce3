"""The clustered protocol at one node: it hands each event to the parts of the protocol, and decides nothing itself.

To a head a packet goes as acknowledged unicast (TO_HEAD), then to all nodes as a flood (FLOOD), as its flags say; to
one receiver by `one_way`, if that takes it, and as a flood from here if no way is known.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.bus.messages import Reception, TxOutcome, TxStatus
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.node.packet import Packet, Relay, is_used_up
from fanet_mw.node.reader import decoded
from fanet_mw.routing.clustered.contract import Access, HearsCopies, Relaying
from fanet_mw.routing.clustered.forwarding.contending_relays import ContendingRelaying
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.forwarding.one_way import OneWay
from fanet_mw.routing.clustered.forwarding.uplink import MOST_TRIES, Uplink
from fanet_mw.routing.clustered.links.heard_load import HeardLoads
from fanet_mw.routing.clustered.roles.assigned_roles import AssignedRoles
from fanet_mw.routing.clustered.roles.failure_detectors import Deafness
from fanet_mw.routing.clustered.timetable.stated_delays import StatedDelays
from fanet_mw.routing.missing_packets import MissingPackets
from fanet_mw.routing.packet_repair import Repair
from fanet_mw.units import BROADCAST, US, NodeId
from fanet_mw.wire import FLAG_DEAF, FLAG_FLOOD, FLAG_TO_HEAD, Kind
from fanet_mw.wire.hello.beacon import Beacon
from fanet_mw.wire.hello.digest import MESSAGE_BYTES as DIGEST_BYTES
from fanet_mw.wire.hello.digest import Digest, capacity

_DATA: Final = int(Kind.DATA)


class Parts(NamedTuple):
    """The parts of the protocol at one node."""

    neighbors: Neighbors
    gradient: Gradient
    uplink: Uplink
    repair: Repair | None
    floods: Floods
    roles: AssignedRoles
    access: Access
    relaying: Relaying
    contending: ContendingRelaying
    """Relaying in contention, outside of slots and turns; `relaying` itself, or for what that does not decide."""
    one_way: OneWay
    loads: HeardLoads | None = None
    """The loads of the nodes, as this node hears them; None if timetables are made for what the scenario says."""
    delays: StatedDelays | None = None
    """The delay bounds and likely delays of the node's packets; None if this access states no bound."""
    deafness: Deafness | None = None
    """Whether this node hears anybody; None where nobody has to know."""
    missing: MissingPackets | None = None
    """What the node lacks; only then do its hellos state what it has. None if they always do, or never."""


class Clustered(RoutingProtocol):
    """Clustered, time-divided flooding at one node."""

    def __init__(self, port: Port, parts: Parts, hear_copies: Sequence[HearsCopies]) -> None:
        super().__init__(port)
        self.parts = parts
        self._hear_copies = tuple((part.pending, part.on_copy) for part in hear_copies)
        """The keys for which each part waits, and its handler of copies; most copies are of other packets."""
        timed = (parts.roles, parts.access, parts.contending, parts.repair)
        self._asks = tuple(part.next_wake_ns for part in timed if part is not None)
        """The methods by which the parts tell when they want to be woken; they are called after every reception."""
        self._lead_ns = port.scenario.radio.lead_ns

    def start(self, now_ns: int) -> None:
        self._on_frame(now_ns)  # it has yet to hear anybody
        for part in (self.parts.roles, self.parts.access, self.parts.relaying):
            part.start(now_ns)

    # --- packets --------------------------------------------------------------------------------------------------

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        parts = self.parts
        if not parts.access.admit(packet, due_ns=due_ns):
            self._port.drop(DropReason.ADMISSION, packet, now_ns=now_ns)
            return
        parts.floods.keep(packet, flooded=False, now_ns=due_ns)
        if packet.header.destination == BROADCAST:
            parts.roles.on_flooding(due_ns)
        if parts.one_way.takes(packet):
            self._send_one_way(packet, start_ns=due_ns, now_ns=now_ns)
        else:
            parts.access.originate(packet, due_ns=due_ns, now_ns=now_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> Sequence[Relay]:
        parts, header = self.parts, packet.header
        origin_us, seq, origin, destination, _, kind, _, _, _, flags = header
        one_way = destination != BROADCAST and parts.one_way.takes(packet)
        self._on_frame(now_ns)
        if flags & FLAG_DEAF and kind != _DATA:
            return ()  # only its applications' packets are of use
        if not flags & FLAG_DEAF:
            parts.roles.on_sign_of_life(origin, born_ns=origin_us * US, now_ns=now_ns)
            parts.one_way.learn(header, reception.src)
        if kind == _DATA:
            if parts.loads is not None:
                parts.loads.on_packet(origin, seq, born_ns=origin_us * US, now_ns=now_ns)
            if parts.missing is not None:
                parts.missing.receive(origin, seq, now_ns=now_ns)
        parts.floods.keep(packet, flooded=bool(flags & FLAG_FLOOD), now_ns=now_ns)
        if flags & FLAG_FLOOD:
            if one_way and parts.one_way.must_show(header, now_ns=now_ns):
                parts.roles.show(now_ns)
            at_once = kind != _DATA and parts.roles.on_control(packet, reception.src, now_ns=now_ns)
            relaying = parts.contending if one_way else parts.relaying
            return relaying.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        if flags & FLAG_TO_HEAD or one_way:
            self._pass_on(packet, now_ns)
        return ()

    def _pass_on(self, packet: Packet, now_ns: int) -> None:
        parts, start_ns = self.parts, now_ns + self._lead_ns
        if packet.header.destination == self._port.node:
            return
        if is_used_up(packet.header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return
        if parts.one_way.takes(packet):
            self._send_one_way(packet, start_ns=start_ns, now_ns=now_ns)
        else:
            parts.access.forward(packet, start_ns=start_ns, now_ns=now_ns)

    def _send_one_way(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        """Send a packet to its receiver, or flood it from here if no way is known."""
        parts = self.parts
        if not parts.one_way.send(packet, start_ns=start_ns, now_ns=now_ns):
            parts.floods.contend(packet, due_ns=start_ns - self._lead_ns, now_ns=now_ns)

    def most_packet_bytes(self, priority: int) -> int:
        return self.parts.access.most_packet_bytes(priority)

    def bound_ns(self) -> int | None:
        return None if self.parts.delays is None else self.parts.delays.bound_ns()

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        return self.parts.roles.clusters()

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        return None if self.parts.delays is None else self.parts.delays.least_interval_ns(deadline_ns)

    def _on_frame(self, now_ns: int) -> None:
        if self.parts.deafness is not None:
            self.parts.deafness.on_frame(now_ns)

    def on_copy(self, key: int, src: NodeId, *, now_ns: int) -> None:
        self._on_frame(now_ns)
        for pending, on_copy in self._hear_copies:
            if key in pending:
                on_copy(key, now_ns=now_ns)

    def on_impersonation(self, packet: Packet, *, now_ns: int) -> None:
        self.parts.roles.on_impersonation(packet, now_ns=now_ns)

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:
        parts = self.parts
        missed = parts.one_way.failed(status)
        if missed is not None and status.outcome is TxOutcome.RETRY_LIMIT:
            self._send_one_way(missed, start_ns=now_ns + self._lead_ns, now_ns=now_ns)
        elif missed is not None:  # its way is still the best known, and would meet the same full queue
            parts.floods.contend(missed, due_ns=now_ns, now_ns=now_ns)
        failed = parts.uplink.on_status(status)
        if failed is None:
            return
        if status.outcome is TxOutcome.RETRY_LIMIT:
            parts.roles.on_parent_lost(failed.parent, now_ns=now_ns)
        if status.outcome is TxOutcome.REFUSED:
            self._port.drop(DropReason.REFUSED, failed.packet, now_ns=now_ns)
        elif failed.tries >= MOST_TRIES:
            self._port.drop(DropReason.RETRY_LIMIT, failed.packet, now_ns=now_ns)
        else:
            parts.access.forward(failed.packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns, tries=failed.tries)

    # --- hellos ---------------------------------------------------------------------------------------------------

    def hello_due_ns(self, start_ns: int) -> int:
        return self.parts.access.hello_due_ns(start_ns)

    def hello_start_ns(self, start_ns: int) -> int:
        return self.parts.access.hello_start_ns(start_ns)

    def send_hello(self, packet: Packet, *, start_ns: int, wants_status: bool, now_ns: int) -> int:
        until_ns = self.parts.access.hello_until_ns(start_ns, len(packet.frame))
        return self._port.transmit(packet.frame, BROADCAST, start_ns, wants_status, until_ns)

    def hello_share(self, *, now_ns: int) -> float:
        return self.parts.roles.hello_share(now_ns)

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        """What the protocol adds to a hello: its beacon, and the digest of recent packets as far as there is room."""
        parts = self.parts
        parts.gradient.advance(now_ns)
        route = parts.gradient.route(now_ns=now_ns)
        if parts.deafness is not None:
            parts.deafness.review(now_ns)
        parts.roles.before_hello(now_ns)
        inner = parts.roles.beacon(route, now_ns=now_ns).encode_frame(self._port.node)
        digest = None if parts.repair is None else self._digest(parts.repair, room - len(inner), now_ns)
        return inner if digest is None else inner + digest.encode_frames(self._port.node)

    def _digest(self, repair: Repair, room: int, now_ns: int) -> Digest | None:
        """What the node's hello states of packets; None if it states nothing."""
        missing = self.parts.missing
        if missing is not None:
            fits = room >= DIGEST_BYTES and repair.holds_any
            if not fits or not missing.states(now_ns=now_ns):
                return None
        return repair.digest(most=capacity(room), now_ns=now_ns)

    def on_hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        parts, count = self.parts, self._port.scenario.node_count
        beacon = decoded(packet.frame, Beacon.decode_frame)
        if beacon.node != reception.src or beacon.head > count or beacon.leader > count:
            raise MalformedFrameError(f"beacon of {beacon.node}, head {beacon.head}, leader {beacon.leader}")
        self._on_frame(now_ns)
        if packet.header.flags & FLAG_DEAF:
            parts.roles.on_deaf(reception.src, now_ns=now_ns)
            return
        digest = decoded(packet.frame, Digest.decode_frames) if parts.repair else None
        neighbor = Neighbor(reception.src, now_ns, reception.rssi_dbm, beacon)
        parts.neighbors.on_hello(neighbor)
        parts.roles.on_hello(neighbor, born_ns=packet.header.origin_us * US, now_ns=now_ns)
        parts.gradient.on_hello(neighbor, now_ns=now_ns)
        if parts.repair and digest:
            parts.repair.on_digest(digest, now_ns=now_ns)
            if parts.missing is not None:
                parts.missing.notice(parts.repair.lacks(digest), now_ns=now_ns)
        for held in parts.uplink.released(now_ns=now_ns):
            parts.access.forward(held, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        first_ns = None
        for ask in self._asks:
            wake_ns = ask()
            if wake_ns is not None and (first_ns is None or wake_ns < first_ns):
                first_ns = wake_ns
        return first_ns

    def wake(self, now_ns: int) -> None:
        parts = self.parts
        parts.roles.wake(now_ns)
        for relay in parts.contending.decided(now_ns):
            self._port.relay(relay)
        for due_ns, packet in parts.repair.due(now_ns=now_ns) if parts.repair else ():
            parts.access.answer(packet, due_ns=due_ns, now_ns=now_ns)
        parts.uplink.expire(now_ns=now_ns)
        parts.access.wake(now_ns)

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return (
            len(self.parts.one_way)
            + len(self.parts.uplink)
            + self.parts.access.waiting()
            + self.parts.contending.waiting()
        )

    def report(self) -> Mapping[str, object]:
        parts = self.parts
        return {
            **parts.roles.report(),
            "waiting": self.waiting(),
            "repaired": parts.repair.repaired if parts.repair else 0,
            **parts.access.report(),
            **parts.relaying.report(),
            **({} if parts.loads is None else {"loads_refused": parts.loads.refused}),
        }
