"""The sans-IO core of one node: feed receptions, statuses and instants; drain requests, deliveries and records.

    reception -> header at fixed offsets -> handled before in this phase? -> full header -> deliver -> protocol

What comes off the air never raises here: it is counted by reason. The node owns its identity, sequence numbers,
duplicate suppression and headers; the routing protocol behind it decides what happens next.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from random import Random
from typing import Final

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxRequest, TxStatus
from fanet_mw.errors import DropReason, LocalProtocolError, MalformedFrameError
from fanet_mw.node import arrival, duplicates
from fanet_mw.node.arrival import PHASES
from fanet_mw.node.contract import RoutingProtocol
from fanet_mw.node.plausible import CONTROL, RESTART_STEP_NS, Plausible
from fanet_mw.node.queue import Packet
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered, Dropped, Generated, LetOut, Record
from fanet_mw.units import BROADCAST, US, Enu, NodeId
from fanet_mw.wire import Header, Kind

_DATA: Final = int(Kind.DATA)
_HELLO: Final = int(Kind.HELLO)
_new: Final = tuple.__new__  # for what is made once per frame
_MOST_HOPS: Final = 255
"""What the hop count of the header can say."""


class Node:
    """One protocol instance."""

    def __init__(
        self, node: NodeId, scenario: Scenario, make_protocol: Callable[["Node"], RoutingProtocol], *, position: Enu
    ) -> None:
        self.node = node
        self.scenario = scenario
        self.position = position
        self.clock_error_ns = 0
        self.velocity = Enu(0.0, 0.0, 0.0)
        self.requests: list[TxRequest] = []
        self.deliveries: list[Packet] = []
        """Packets for the application of this node."""
        self.watched: set[int] = set()
        """Sequence numbers of own packets whose fate is of interest."""
        self.fates: list[tuple[int, int, DropReason | None]] = []
        """What became of these: (number, instant, why it was dropped; None: it was let out)."""
        self.records: list[Record] = []
        self.frames_sent = 0
        self.receptions = 0
        self.dropped: Counter[str] = Counter()
        self._duplicates = 0
        self._lead_ns = scenario.radio.lead_ns
        self._first_seq, self._next_seq = 0, {False: 0, True: CONTROL}
        self._lifetimes_ns = [scenario.routing.lifetime_ns(priority) for priority in range(256)]
        """By priority, whatever the air says."""
        self._reader = arrival.shared
        self._seen = duplicates.Seen()
        self._plausible = Plausible(node, scenario)
        self._held: set[bytes] = set()
        """Names of own packets (`wire.NAME`) that were accepted, and of which no frame has been announced yet."""
        self._gathered: list[tuple[int, bytes]] | None = None
        """While set: broadcasts that may share a frame, each with its instant."""
        self._protocol = make_protocol(self)
        self.next_wake_ns = self._protocol.next_wake_ns
        """The protocol's own method: every wake-up is followed by this question."""
        protocol = self._protocol
        self.timeless = type(protocol).next_wake_ns is RoutingProtocol.next_wake_ns
        """This protocol never asks to be woken: no reception changes when the node is due."""
        self._overheard = None if type(protocol).overheard is RoutingProtocol.overheard else protocol.overheard
        """None: this protocol does not care for copies, and most receptions are copies."""

    # --- from the host's side -------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """The node is up; one that starts again later must not reuse the names of its earlier packets."""
        first = now_ns // RESTART_STEP_NS % CONTROL
        self._first_seq, self._next_seq = first, {False: first, True: CONTROL + first}
        self._protocol.start(now_ns)

    def send(
        self,
        inner: bytes,
        *,
        destination: NodeId,
        priority: int,
        app: str,
        born_ns: int,
        now_ns: int,
        watch: bool = False,
    ) -> int:
        """Send an application payload (whole MAVLink frames); returns the packet's sequence number.

        `born_ns` is when the application meant to hand it over, at most `now_ns`: a process that was woken late loses
        that much of the lead, and not of the delay that is measured. The first frame may go one lead after it. What
        becomes of a packet that is to be watched is in `fates`. Raises LocalProtocolError when the frame would exceed
        `radio.max_frame_bytes`.
        """
        born_ns = born_ns // US * US  # what the header can say
        packet = self._packet(
            Kind.DATA,
            inner,
            destination=destination,
            priority=priority,
            flags=self._protocol.origin_flags,
            hop_limit=self.scenario.routing.hop_limit,
            born_ns=born_ns,
        )
        seq = packet.header.seq
        self.records.append(_new(Generated, (born_ns, self.node, seq, app, len(packet.frame))))
        self._held.add(packet.frame[wire.NAME])
        if watch:
            self.watched.add(seq)
        self._protocol.originate(packet, due_ns=max(born_ns + self._lead_ns, now_ns), now_ns=now_ns)
        return seq

    def say_hello(self, inner: bytes, *, start_ns: int, now_ns: int) -> None:
        """Broadcast our hello one hop: position frames of the application, then what the protocol adds."""
        start_ns = self._protocol.hello_start_ns(start_ns)
        room = self.scenario.radio.max_frame_bytes - wire.HEADER_BYTES - len(inner)
        packet = self._packet(
            Kind.HELLO,
            inner + self._protocol.hello_inner(room, now_ns=now_ns),
            destination=BROADCAST,
            priority=wire.PRIORITY_CONTROL,
            flags=0,
            hop_limit=1,
            born_ns=start_ns,
        )
        self.transmit(packet.frame, BROADCAST, start_ns=start_ns)

    def hello_share(self, now_ns: int) -> float:
        """After which part of the hello interval the next hello should go."""
        return self._protocol.hello_share(now_ns=now_ns)

    def hear(self, reception: Reception, now_ns: int) -> bool:
        """One reception, from anyone. True: a copy of what was handled before; nothing came of it."""
        self.receptions += 1
        reader, frame, handled = self._reader, reception.frame, self._seen
        if frame is not reader.frame:
            reader.look(frame)
        name, phase = reader.name, reader.phase
        known = handled.young.get(name)  # as handled.bits(name), without a call for each copy
        if known is None:
            known = handled.old.get(name, 0)
        if known & phase:
            self._duplicates += 1
            if self._overheard is not None:
                self._overheard(reader.key, now_ns=now_ns)
            return True
        if phase == arrival.BUNDLE:
            self._hear_bundle(reception, now_ns)
            return False
        try:
            self._first_copy(reader.packet or reader.read(), reception, known, now_ns)
        except MalformedFrameError:
            self.dropped[DropReason.MALFORMED] += 1
        return False

    def _hear_bundle(self, reception: Reception, now_ns: int) -> None:
        """Several packets in one frame: each as if it had come alone; what they make us send goes together again."""
        try:
            packets = wire.unbundle(reception.frame)
        except MalformedFrameError:
            self.dropped[DropReason.MALFORMED] += 1
            return
        self.gather()
        receptions = self.receptions
        for frame in packets:
            self._reader.look(frame, alone=True)
            self.hear(reception._replace(frame=frame), now_ns)
        self.receptions = receptions  # it was one, whatever was in it
        self.send_gathered()

    def _first_copy(self, packet: Packet, reception: Reception, before: int, now_ns: int) -> None:
        """The packet that the reader has before it; `before`: what was known of it without this copy."""
        reader = self._reader
        name, bits = reader.name, before | reader.phase
        _, _, origin_us, seq, origin, destination, _, kind, _, hops, priority, _, _, _ = reader.fields
        known = bool(before) or self._handed_on(origin, seq, kind)
        why = self._plausible.why_not(reader.fields, known=known, src=reception.src, end_ns=reception.end_ns)
        if why is not None:
            self._disbelieve(why, packet, now_ns)
            return
        if kind == _HELLO:
            self._seen.put(name, bits)
            self._protocol.hello(packet, reception, now_ns=now_ns)
            return
        end_ns = reception.end_ns
        age_ns = end_ns - origin_us * US
        if age_ns > self._lifetimes_ns[priority]:
            self._seen.put(name, bits)
            self.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
            return
        to_us = destination == BROADCAST or destination == self.node
        if kind == _DATA and to_us and not before & duplicates.DELIVERED:
            bits |= duplicates.DELIVERED
            self.deliveries.append(packet)
            late_ns = now_ns - end_ns
            self.records.append(_new(Delivered, (now_ns, self.node, origin, seq, age_ns + late_ns, hops + 1, late_ns)))
        self._seen.put(name, bits)
        self._protocol.receive(packet, reception, now_ns=now_ns)

    def _handed_on(self, origin: int, seq: int, kind: int) -> bool:
        """Whether we gave data this name since our start: custody of it has passed on, and may come back."""
        return kind == _DATA and origin == self.node and self._first_seq <= seq < self._next_seq[False]

    def _disbelieve(self, why: DropReason, packet: Packet, now_ns: int) -> None:
        """Counted, and neither delivered nor passed on."""
        self.dropped[why] += 1
        if why is DropReason.OWN:
            self._protocol.impersonated(packet, now_ns=now_ns)

    def status(self, status: TxStatus, *, now_ns: int) -> None:
        self._protocol.status(status, now_ns=now_ns)

    def wake(self, now_ns: int) -> None:
        self._protocol.wake(now_ns)

    def bound_ns(self) -> int | None:
        """Within which delay everyone has the next packet of this node; None: the protocol states none."""
        return self._protocol.bound_ns()

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """By head, the nodes of each cluster, as far as this node knows."""
        return self._protocol.clusters()

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        """The least interval between packets of this node that meets a deadline; None: unknown, or there is none."""
        return self._protocol.least_interval_ns(deadline_ns)

    def report(self) -> Mapping[str, object]:
        """JSON-able counters and the protocol's state."""
        return {
            "frames_sent": self.frames_sent,
            "receptions": self.receptions,
            "dropped": self._drops(),
            **self._protocol.report(),
        }

    def _drops(self) -> dict[str, int]:
        dropped = self.dropped + Counter({DropReason.DUPLICATE: self._duplicates})
        return {reason: dropped[reason] for reason in sorted(dropped)}

    # --- the port of the protocol (fanet_mw.node.contract.Port) -----------------------------------------------

    def gather(self) -> None:
        self._gathered = []

    def send_gathered(self) -> None:
        """The first instant of each frame's packets is that of the frame."""
        gathered, self._gathered = self._gathered or [], None
        chunk: list[bytes] = []
        first_ns, size, most = 0, 0, self.scenario.radio.max_frame_bytes
        for start_ns, frame in gathered:
            if chunk and size + len(frame) > most:
                self.transmit(wire.bundle(chunk), BROADCAST, start_ns=first_ns)
                chunk, size = [], 0
            first_ns = min(first_ns, start_ns) if chunk else start_ns
            chunk.append(frame)
            size += len(frame)
        if chunk:
            self.transmit(wire.bundle(chunk), BROADCAST, start_ns=first_ns)

    def transmit(self, frame: bytes, dst: NodeId, *, start_ns: int, wants_status: bool = False) -> int:
        if self._held and frame[wire.NAME] in self._held:
            self._held.remove(frame[wire.NAME])
            own = int.from_bytes(frame[wire.SEQ], "little")
            self.records.append(LetOut(start_ns, self.node, own))
            if own in self.watched:
                self.fates.append((own, start_ns, None))
        if self._gathered is not None and dst == BROADCAST and not wants_status:
            self._gathered.append((start_ns, frame))
            return self.frames_sent
        seq = self.frames_sent
        self.frames_sent = seq + 1
        self.requests.append(_new(TxRequest, (seq, start_ns, frame, dst, wants_status)))
        return seq

    def announce(
        self, kind: Kind, inner: bytes, *, now_ns: int, flags: int, hop_limit: int, destination: NodeId = BROADCAST
    ) -> Packet:
        return self._packet(
            kind,
            inner,
            destination=destination,
            priority=wire.PRIORITY_CONTROL,
            flags=flags,
            hop_limit=hop_limit,
            born_ns=now_ns,
        )

    def stamped(self, packet: Packet, *, flags: int) -> bytes:
        header = packet.header
        return wire.rewrite(packet.frame, self.node, header.hop_limit, header.hops, flags)

    def forwarded(self, packet: Packet, *, flags: int) -> bytes:
        header = packet.header
        hops = header.hops
        if hops < _MOST_HOPS:  # a hostile frame may come with all of them
            hops += 1
        return wire.rewrite(packet.frame, self.node, header.hop_limit - 1, hops, flags)

    def drop(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None:
        self.dropped[reason] += 1
        self._held.discard(packet.frame[wire.NAME])
        if packet.header.origin == self.node and packet.header.seq in self.watched:
            self.fates.append((packet.header.seq, now_ns, reason))
        self.records.append(Dropped(now_ns, self.node, reason, packet.header.origin, packet.header.seq))

    def mark(self, packet: Packet, bits: int) -> None:
        self._seen.mark(arrival.name_of(packet.frame), bits)

    def forget(self, packet: Packet) -> None:
        self._seen.forget(arrival.name_of(packet.frame))

    def record(self, record: Record) -> None:
        self.records.append(record)

    def stream(self, use: str) -> Random:
        return stream(self.scenario.seed, use, self.node)

    # --- inside ---------------------------------------------------------------------------------------------------

    def _packet(
        self, kind: Kind, inner: bytes, *, destination: NodeId, priority: int, flags: int, hop_limit: int, born_ns: int
    ) -> Packet:
        size = wire.HEADER_BYTES + len(inner)
        bound = self.scenario.radio.max_frame_bytes
        if size > bound:
            raise LocalProtocolError(f"frame of {size} bytes must be <= radio.max_frame_bytes = {bound}")
        control = kind is not Kind.DATA
        seq = self._next_seq[control]
        self._next_seq[control] = seq + 1
        node, hops = self.node, 0
        header = _new(
            Header, (born_ns // US, seq, node, destination, node, kind, hop_limit, hops, priority, flags)
        )  # fmt: skip
        frame = header.encode() + inner
        self._seen.put(arrival.name_of(frame), duplicates.DELIVERED | PHASES[flags & wire.PHASE_MASK])
        return _new(Packet, (header, frame))
