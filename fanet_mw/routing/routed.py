"""What hop-by-hop protocols share: data as acknowledged unicast along next hops, broadcasts flooded, control by hop.

    originate -> broadcast? transmit : routes
    receive   -> control? its protocol : for us? done : broadcast? relay once : hop limit? drop : routes
    status    -> acknowledged? done : the protocol is told that the link failed, and names the drop

Duplicates never come here: the node suppresses them, so no packet passes the same node twice. With
`routing.address_resolution` every unicast, control too, first waits for its next hop's address (`resolution`).
"""

import struct
from abc import abstractmethod
from typing import ClassVar, Final

from fanet_mw.bus.messages import Reception, TxOutcome, TxStatus
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.queue import Packet
from fanet_mw.routing import control
from fanet_mw.routing.control import Family, Reader, check_node, type_of
from fanet_mw.routing.resolution import Knowledge, Outgoing, Resolver
from fanet_mw.units import BROADCAST, NodeId
from fanet_mw.wire import Kind

REASON_OF: Final = {
    TxOutcome.RETRY_LIMIT: DropReason.RETRY_LIMIT,
    TxOutcome.QUEUE_FULL: DropReason.MAC_QUEUE_FULL,
    TxOutcome.LIFETIME: DropReason.MAC_LIFETIME,
    TxOutcome.LATE: DropReason.LATE,
}
"""Why a unicast that the MAC did not get through is gone."""

ADDRESS_REQUEST: Final = 1
ADDRESS_REPLY: Final = 2
_TARGET: Final = struct.Struct("<H")
"""RFC 826's target protocol address; the header's origin is the sender's, the MAC's addresses are the hardware's."""


class Routed(RoutingProtocol):
    """The base of the rivals that keep routes."""

    family: ClassVar[Family]

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._lead_ns = port.scenario.radio.lead_ns
        self._jitter_ns = port.scenario.routing.jitter_ns
        self._random = port.stream("routing").random
        self._unicasts: dict[int, tuple[Packet, NodeId]] = {}
        """Data packets handed to the MAC and not yet acknowledged, by request number."""
        self._controls: dict[int, NodeId] = {}
        """Unicast control messages, likewise: to whom."""
        rules = port.scenario.routing.address_resolution
        self._addresses = (
            Resolver(as_ns3=rules == "ns3", draw=port.stream("address").random, ask=self._ask_address)
            if rules != "none"
            else None
        )
        self.control_sent = 0

    # --- what a protocol says -------------------------------------------------------------------------------------

    @abstractmethod
    def _outgoing(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        """A unicast data packet of our own wants a next hop."""

    @abstractmethod
    def _transit(self, packet: Packet, reception: Reception, *, start_ns: int, now_ns: int) -> None:
        """A unicast data packet of somebody else wants a next hop."""

    @abstractmethod
    def _heard(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        """A control message of this protocol; MalformedFrameError is counted by the node."""

    def _arrived(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        """A data packet reached us as its destination."""

    def _relays(self, packet: Packet, reception: Reception, *, now_ns: int) -> bool:
        """Whether we relay a broadcast of which this is the first copy: plain flooding says yes."""
        return True

    def _failed(self, packet: Packet, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        """The MAC gave a data packet up; the protocol drops it or finds another way."""
        self._port.drop(REASON_OF[outcome], packet, now_ns=now_ns)

    def _control_failed(self, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        """The MAC gave a unicast control message up."""

    # --- the contract ---------------------------------------------------------------------------------------------

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        destination = NodeId(packet.header.destination)
        if destination == BROADCAST:
            self._port.transmit(packet.frame, BROADCAST, start_ns=due_ns)
        elif destination != self._port.node:
            self._outgoing(packet, start_ns=due_ns, now_ns=now_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        header = packet.header
        if header.kind == Kind.ROUTING:
            kind, body = control.decode(packet.frame)
            if kind >> 4 == Family.ADDRESS and self._addresses is not None:
                self._address(self._addresses, kind & 0xF, body, packet, reception, now_ns=now_ns)
                return
            if kind >> 4 != self.family:
                raise MalformedFrameError(f"control of type {kind:#x} is not for {self.family.name}")
            self._heard(kind & 0xF, body, packet, reception, now_ns=now_ns)
        elif header.kind != Kind.DATA:
            self._port.drop(DropReason.NOT_FOR_US, packet, now_ns=now_ns)
        elif header.destination == self._port.node:
            self._arrived(packet, reception, now_ns=now_ns)
        elif header.destination == BROADCAST:
            self._flood(packet, reception, now_ns=now_ns)
        elif header.hop_limit <= 1:
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
        else:
            self._transit(packet, reception, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def status(self, status: TxStatus, *, now_ns: int) -> None:
        data = self._unicasts.pop(status.seq, None)
        hop = self._controls.pop(status.seq, None)
        if status.outcome not in REASON_OF:
            if data is not None:
                self._acknowledged(*data)
        elif data is not None:
            self._failed(*data, status.outcome, now_ns=now_ns)
        elif hop is not None:
            self._control_failed(hop, status.outcome, now_ns=now_ns)

    def next_wake_ns(self) -> int | None:
        return None if self._addresses is None else self._addresses.next_ns()

    def wake(self, now_ns: int) -> None:
        if self._addresses is not None:
            for out in self._addresses.expire(now_ns=now_ns):
                self._unresolved(out, now_ns=now_ns)

    def waiting(self) -> int:
        return len(self._unicasts) + (0 if self._addresses is None else self._addresses.waiting())

    # --- what a protocol does -------------------------------------------------------------------------------------

    def _acknowledged(self, packet: Packet, next_hop: NodeId) -> None:
        """The next hop has the data packet."""

    def _send(self, packet: Packet, next_hop: NodeId, *, start_ns: int, now_ns: int) -> None:
        """Hand a data packet to the MAC for its next hop."""
        header = packet.header
        fresh = header.hops == 0 and header.origin == self._port.node
        frame = packet.frame if fresh else self._port.forwarded(packet, flags=0)
        self._hand_over(Outgoing(packet, frame, next_hop, is_data=True), start_ns=start_ns, now_ns=now_ns)

    def _hand_over(self, out: Outgoing, *, start_ns: int, now_ns: int) -> None:
        """A unicast frame goes to the MAC, as soon as the address of its next hop is known."""
        knowledge = Knowledge.KNOWN
        if self._addresses is not None:
            knowledge = self._addresses.knowledge(out.next_hop, now_ns=now_ns) or Knowledge.WAITING
        if knowledge is Knowledge.KNOWN:
            seq = self._port.transmit(out.frame, out.next_hop, start_ns=start_ns, wants_status=True)
            if out.is_data:
                self._unicasts[seq] = out.packet, out.next_hop
            else:
                self._controls[seq] = out.next_hop
            return
        assert self._addresses is not None, "only a node that resolves addresses lacks one"
        if knowledge is Knowledge.DEAD:
            self._unresolved(out, now_ns=now_ns)
        elif (refused := self._addresses.hold(out, start_ns=start_ns, now_ns=now_ns)) is not None:
            self._unresolved(refused, now_ns=now_ns)

    def _unresolved(self, out: Outgoing, *, now_ns: int) -> None:
        """A frame whose next hop has no known address is gone; the protocol is not told (in ns-3 neither)."""
        self._port.drop(DropReason.UNRESOLVED, out.packet, now_ns=now_ns)

    def _ask_address(self, neighbor: NodeId, start_ns: int, now_ns: int) -> None:
        packet = self._control(type_of(Family.ADDRESS, ADDRESS_REQUEST), _TARGET.pack(neighbor), now_ns=now_ns)
        self._port.transmit(packet.frame, BROADCAST, start_ns=start_ns)

    def _address(
        self, addresses: Resolver, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int
    ) -> None:
        """RFC 826, packet reception: learn, release what waited, then answer; straight back, without asking."""
        reader = Reader(body)
        target, sender = check_node(reader.take(_TARGET)[0]), reception.src
        reader.finish()
        if number not in (ADDRESS_REQUEST, ADDRESS_REPLY) or packet.origin != sender:
            raise MalformedFrameError(f"address message {number} of {packet.origin} from {sender}")
        ours = target == self._port.node
        asks_us, answers_us = ours and number == ADDRESS_REQUEST, ours and number == ADDRESS_REPLY
        for out in addresses.heard(sender, asks_us=asks_us, answers_us=answers_us, now_ns=now_ns):
            self._hand_over(out, start_ns=now_ns + self._lead_ns, now_ns=now_ns)
        if asks_us:
            kind = type_of(Family.ADDRESS, ADDRESS_REPLY)
            reply = self._control(kind, _TARGET.pack(sender), now_ns=now_ns, to=sender)
            self._port.transmit(reply.frame, sender, start_ns=now_ns + self._lead_ns)

    def _flood(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if not self._relays(packet, reception, now_ns=now_ns):
            return
        if packet.header.hop_limit <= 1:
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return
        frame = self._port.forwarded(packet, flags=0)
        self._port.transmit(frame, BROADCAST, start_ns=self._jittered(now_ns, self._jitter_ns))

    def _say(
        self, number: int, body: bytes, *, start_ns: int, now_ns: int, to: NodeId = BROADCAST, ttl: int = 1
    ) -> None:
        """Announce a control message of our own, to one neighbor (acknowledged) or to all."""
        packet = self._control(type_of(self.family, number), body, now_ns=now_ns, to=to, ttl=ttl)
        if to == BROADCAST:
            self._port.transmit(packet.frame, to, start_ns=start_ns)
        else:
            out = Outgoing(packet, packet.frame, to, is_data=False)
            self._hand_over(out, start_ns=start_ns, now_ns=now_ns)

    def _control(self, kind: int, body: bytes, *, now_ns: int, to: NodeId = BROADCAST, ttl: int = 1) -> Packet:
        """Make a control packet of our own."""
        self.control_sent += 1
        return self._port.announce(
            Kind.ROUTING,
            control.encode(kind, body, node=self._port.node),
            now_ns=now_ns,
            flags=0,
            hop_limit=ttl,
            destination=to,
        )

    def _jittered(self, now_ns: int, most_ns: int) -> int:
        """The earliest instant to transmit, and a random time more."""
        return now_ns + self._lead_ns + int(self._random() * most_ns)
