"""The common base of hop-by-hop protocols: data as acknowledged unicast, broadcasts flooded, control hop by hop.

    originate -> broadcast? transmit : routes
    receive   -> control? its protocol : for this node? done : broadcast? relay once : hop limit? drop : routes
    status    -> acknowledged? done : the protocol learns that the link has failed, and names the reason of the drop

With `routing.address_resolution` every unicast first waits for the address of its next hop (`address_resolution.py`).
"""

import struct
from abc import abstractmethod
from typing import ClassVar, Final, NamedTuple

from fanet_mw.bus.messages import Reception, TxOutcome, TxStatus
from fanet_mw.errors import DropReason, MalformedFrameError
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.packet import Packet, is_used_up
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.address_resolution import Knowledge, Outgoing, Resolver
from fanet_mw.routing.rival_control_messages import Family, check_node, type_of, unpack
from fanet_mw.units import BROADCAST, NodeId, earliest, seconds_to_ns
from fanet_mw.wire import Kind

REASON_OF: Final = {
    TxOutcome.RETRY_LIMIT: DropReason.RETRY_LIMIT,
    TxOutcome.QUEUE_FULL: DropReason.MAC_QUEUE_FULL,
    TxOutcome.LIFETIME: DropReason.MAC_LIFETIME,
    TxOutcome.LATE: DropReason.LATE,
    TxOutcome.REFUSED: DropReason.REFUSED,
}
"""The reason for which a packet is dropped, by the outcome of its unicast."""

ADDRESS_REQUEST: Final = 1
ADDRESS_REPLY: Final = 2
_TARGET: Final = struct.Struct("<H")
"""RFC 826's target protocol address. The sender's is the origin in the header; hardware addresses are the MAC's."""


class _Held(NamedTuple):
    """A packet, and the instant at which it expires."""

    packet: Packet
    ends_ns: int


class _SendBuffer:
    """The packets of one node that wait for routes, first in, first out."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._capacity = port.scenario.routing.queue_frames
        self._hold_ns = seconds_to_ns(port.scenario.routing.lifetime_s)
        self._held: list[_Held] = []

    def __len__(self) -> int:
        return len(self._held)

    def push(self, packet: Packet, *, now_ns: int) -> None:
        self._held.append(_Held(packet, now_ns + self._hold_ns))
        if len(self._held) > self._capacity:
            self._drop_oldest(DropReason.QUEUE_FULL, now_ns)

    def destinations(self) -> list[NodeId]:
        return sorted({NodeId(held.packet.header.destination) for held in self._held})

    def take(self, destination: NodeId) -> list[Packet]:
        taken = [held.packet for held in self._held if held.packet.header.destination == destination]
        if taken:
            self._held = [held for held in self._held if held.packet.header.destination != destination]
        return taken

    def expire(self, *, now_ns: int) -> None:
        while self._held and self._held[0].ends_ns <= now_ns:
            self._drop_oldest(DropReason.EXPIRED, now_ns)

    def _drop_oldest(self, reason: DropReason, now_ns: int) -> None:
        self._port.drop(reason, self._held.pop(0).packet, now_ns=now_ns)

    def next_end_ns(self) -> int | None:
        return self._held[0].ends_ns if self._held else None


class HopByHop(RoutingProtocol):
    """The base of the rival protocols that keep routes."""

    contends_at_once: ClassVar[bool] = True
    family: ClassVar[Family]

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._lead_ns = port.scenario.radio.lead_ns
        self._jitter_ns = port.scenario.routing.jitter_ns
        self._random = port.stream("routing").random
        self._unicasts: dict[int, tuple[Packet, NodeId]] = {}
        """Data packets handed to the MAC and not yet acknowledged, by request number."""
        self._controls: dict[int, NodeId] = {}
        """The next hop of unicast control messages not yet acknowledged, by request number."""
        rules = port.scenario.routing.address_resolution
        self._addresses = (
            Resolver(as_ns3=rules == "ns3", draw=port.stream("address").random, ask=self._ask_address)
            if rules != "none"
            else None
        )
        self._room = _SendBuffer(port)
        """The packets that wait for a route, in the protocols that let packets wait."""
        self.control_sent = 0

    # --- what a protocol defines ----------------------------------------------------------------------------------

    @abstractmethod
    def _route_own(self, packet: Packet, *, start_ns: int, now_ns: int) -> None:
        """Find a next hop for a unicast data packet of this node."""

    def _route_transit(self, packet: Packet, reception: Reception, *, start_ns: int, now_ns: int) -> None:
        """The same for a packet of another node."""
        self._route_own(packet, start_ns=start_ns, now_ns=now_ns)

    @abstractmethod
    def _on_control(self, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int) -> None: ...

    def _on_arrival(self, packet: Packet, reception: Reception, *, now_ns: int) -> None: ...

    def _relays(self, packet: Packet, reception: Reception, *, now_ns: int) -> bool:
        """True if this node relays a broadcast of which this is the first copy: in plain flooding always."""
        return True

    def _on_failure(self, packet: Packet, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        """Handle a data packet that the MAC has given up: drop it, or find another way."""
        self._drop_failed(packet, outcome, now_ns=now_ns)

    def _on_control_failure(self, next_hop: NodeId, outcome: TxOutcome, *, now_ns: int) -> None:
        """Handle a unicast control message that the MAC has given up."""

    def _on_unresolved(self, out: Outgoing, *, now_ns: int) -> None:
        """Handle a frame whose next hop has no known address: drop it, or find another way."""
        self._drop_unresolved(out, now_ns=now_ns)

    def _due_ns(self) -> int | None:
        """The instant at which this protocol wants to be woken, addresses aside."""
        return None

    def _on_wake(self, now_ns: int) -> None: ...

    # --- the contract ---------------------------------------------------------------------------------------------

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        destination = NodeId(packet.header.destination)
        if destination == BROADCAST:
            self._port.transmit(packet.frame, BROADCAST, start_ns=due_ns)
        elif destination != self._port.node:
            self._route_own(packet, start_ns=due_ns, now_ns=now_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        header = packet.header
        if header.kind == Kind.ROUTING:
            kind, body = control.decode(packet.frame)
            if kind >> 4 == Family.ADDRESS and self._addresses is not None:
                self._address(self._addresses, kind & 0xF, body, packet, reception, now_ns=now_ns)
                return
            if kind >> 4 != self.family:
                raise MalformedFrameError(f"control of type {kind:#x} is not for {self.family.name}")
            self._on_control(kind & 0xF, body, packet, reception, now_ns=now_ns)
        elif header.kind != Kind.DATA:
            self._port.drop(DropReason.NOT_FOR_US, packet, now_ns=now_ns)
        elif header.destination == self._port.node:
            self._on_arrival(packet, reception, now_ns=now_ns)
        elif header.destination == BROADCAST:
            self._flood(packet, reception, now_ns=now_ns)
        elif is_used_up(header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
        else:
            self._route_transit(packet, reception, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:
        data = self._unicasts.pop(status.seq, None)
        hop = self._controls.pop(status.seq, None)
        if status.outcome not in REASON_OF:
            if data is not None:
                self._on_acknowledged(*data)
        elif data is not None:
            self._on_failure(*data, status.outcome, now_ns=now_ns)
        elif hop is not None:
            self._on_control_failure(hop, status.outcome, now_ns=now_ns)

    def next_wake_ns(self) -> int | None:
        due_ns = self._due_ns()
        return due_ns if self._addresses is None else earliest(due_ns, self._addresses.next_ns())

    def wake(self, now_ns: int) -> None:
        if self._addresses is not None:
            for out in self._addresses.expire(now_ns=now_ns):
                self._on_unresolved(out, now_ns=now_ns)
        self._on_wake(now_ns)

    def waiting(self) -> int:
        unresolved = 0 if self._addresses is None else self._addresses.waiting()
        return len(self._unicasts) + unresolved + len(self._room)

    # --- what a protocol uses -------------------------------------------------------------------------------------

    def _on_acknowledged(self, packet: Packet, next_hop: NodeId) -> None:
        """Note that the next hop has received a data packet."""

    def _send(self, packet: Packet, next_hop: NodeId, *, start_ns: int, now_ns: int) -> None:
        """Hand a data packet to the MAC for its next hop."""
        header = packet.header
        fresh = header.hops == 0 and header.origin == self._port.node
        frame = packet.frame if fresh else self._port.forwarded(packet, flags=0)
        self._hand_over(Outgoing(packet, frame, next_hop, is_data=True), start_ns=start_ns, now_ns=now_ns)

    def _hand_over(self, out: Outgoing, *, start_ns: int, now_ns: int) -> None:
        """Hand a unicast frame to the MAC, as soon as the address of its next hop is known."""
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
        assert self._addresses is not None, "an address can be unknown only at a node that resolves addresses"
        if knowledge is Knowledge.DEAD:
            self._on_unresolved(out, now_ns=now_ns)
        elif (refused := self._addresses.hold(out, start_ns=start_ns, now_ns=now_ns)) is not None:
            self._on_unresolved(refused, now_ns=now_ns)

    def _drop_failed(self, packet: Packet, outcome: TxOutcome, *, now_ns: int) -> None:
        self._port.drop(REASON_OF[outcome], packet, now_ns=now_ns)

    def _drop_unresolved(self, out: Outgoing, *, now_ns: int) -> None:
        """Drop a frame whose next hop has no known address, as ns-3 does."""
        self._port.drop(DropReason.UNRESOLVED, out.packet, now_ns=now_ns)

    def _ask_address(self, neighbor: NodeId, start_ns: int, now_ns: int) -> None:
        packet = self._control(type_of(Family.ADDRESS, ADDRESS_REQUEST), _TARGET.pack(neighbor), now_ns=now_ns)
        self._port.transmit(packet.frame, BROADCAST, start_ns=start_ns)

    def _address(
        self, addresses: Resolver, number: int, body: bytes, packet: Packet, reception: Reception, *, now_ns: int
    ) -> None:
        """Handle an address message by RFC 826: learn, send what waited, then answer directly, without a request."""
        target, sender = check_node(*unpack(_TARGET, body)), reception.src
        if number not in (ADDRESS_REQUEST, ADDRESS_REPLY) or packet.origin != sender:
            raise MalformedFrameError(f"address message {number} of {packet.origin} from {sender}")
        ours = target == self._port.node
        asks_us, answers_us = ours and number == ADDRESS_REQUEST, ours and number == ADDRESS_REPLY
        for out in addresses.on_address_message(sender, asks_us=asks_us, answers_us=answers_us, now_ns=now_ns):
            self._hand_over(out, start_ns=now_ns + self._lead_ns, now_ns=now_ns)
        if asks_us:
            kind = type_of(Family.ADDRESS, ADDRESS_REPLY)
            reply = self._control(kind, _TARGET.pack(sender), now_ns=now_ns, to=sender)
            self._port.transmit(reply.frame, sender, start_ns=now_ns + self._lead_ns)

    def _flood(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        if not self._relays(packet, reception, now_ns=now_ns):
            return
        if is_used_up(packet.header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return
        frame = self._port.forwarded(packet, flags=0)
        self._port.transmit(frame, BROADCAST, start_ns=self._jittered(now_ns, self._jitter_ns))

    def _send_control(
        self, number: int, body: bytes, *, start_ns: int, now_ns: int, to: NodeId = BROADCAST, ttl: int = 1
    ) -> None:
        """Send a control message of this node, to one neighbor (acknowledged) or to all."""
        packet = self._control(type_of(self.family, number), body, now_ns=now_ns, to=to, ttl=ttl)
        if to == BROADCAST:
            self._port.transmit(packet.frame, to, start_ns=start_ns)
        else:
            out = Outgoing(packet, packet.frame, to, is_data=False)
            self._hand_over(out, start_ns=start_ns, now_ns=now_ns)

    def _control(self, kind: int, body: bytes, *, now_ns: int, to: NodeId = BROADCAST, ttl: int = 1) -> Packet:
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
        """The earliest instant to transmit, plus a random time."""
        return now_ns + self._lead_ns + int(self._random() * most_ns)
