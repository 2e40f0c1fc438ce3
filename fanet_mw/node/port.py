"""The port of a node, through which its protocol sends frames, makes control packets, and drops packets.

It also aggregates (`routing.aggregate`): packets that are sent together share a frame (`wire/aggregation.py`).

The port calls neither the node nor the protocol. Transmissions wait in `requests` until the actor takes them.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import islice
from random import Random
from typing import Final

from fanet_mw import wire
from fanet_mw.actor import is_whole
from fanet_mw.bus.messages import TxRequest
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.duplicates import PHASES, DuplicateSet, hash_of
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.node.packet_numbering import PacketNumbering
from fanet_mw.node.packet_watch import PacketWatch
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.trace import RECORDS, Dropped, LetOut, Record, require_record
from fanet_mw.units import BROADCAST, STILL, Enu, NodeId
from fanet_mw.wire import Kind
from fanet_mw.wire.aggregation import aggregated

_new: Final = tuple.__new__  # for what is made once per frame


class NodePort:
    """The port of one node (`contract.Port`)."""

    def __init__(
        self, node: NodeId, scenario: Scenario, duplicate_set: DuplicateSet, own: PacketNumbering, *, position: Enu
    ) -> None:
        self.node = node
        self.scenario = scenario
        self.position = position
        self.velocity = STILL
        self.clock_error_ns = 0
        self.deaf = False
        self.requests: list[TxRequest] = []
        self.records: list[Record] = []
        self.frames_sent = 0
        self.dropped: Counter[str] = Counter()
        self.watch = PacketWatch()
        self._duplicates = duplicate_set
        self._own = own
        self._held = own.held

    # --- frames ---------------------------------------------------------------------------------------------------

    def transmit(self, frame: bytes, dst: NodeId, start_ns: int, wants_status: bool = False, until_ns: int = 0) -> int:
        if frame.__class__ is not bytes or start_ns.__class__ is not int or until_ns.__class__ is not int:
            self._require_request(frame, start_ns, until_ns)
        seq = self.frames_sent
        if self._held and self._let_out(frame, seq, start_ns):
            wants_status = True
        self.frames_sent = seq + 1
        self.requests.append(_new(TxRequest, (seq, start_ns, frame, dst, wants_status, until_ns)))
        return seq

    def mark(self, packet: Packet, *, flags: int) -> None:
        self._duplicates.mark(hash_of(packet.frame), PHASES[flags])

    def transmit_together(
        self, packets: Sequence[Packet], *, flags: int, at_ns: Sequence[int], until_ns: int = 0
    ) -> None:
        phase = flags & wire.PHASE_MASK
        for packet in packets:
            if packet.header.flags & wire.PHASE_MASK != phase:  # else it was marked when it came, or when it was made
                self.mark(packet, flags=phase)
        frames = [self._begun(packet, flags) for packet in packets]
        for start_ns in at_ns:
            self._share([(start_ns, frame) for frame in frames], until_ns=until_ns)

    def transmit_to(self, packet: Packet, dst: NodeId, *, flags: int, start_ns: int) -> int:
        self.mark(packet, flags=flags)
        return self.transmit(self._begun(packet, flags), dst, start_ns=start_ns, wants_status=True)

    def relay(self, relay: Relay) -> None:
        try:
            packet, start_ns = relay
        except (TypeError, ValueError):
            said = self.scenario.routing.said
            raise LocalProtocolError(f"{said}: receive() must give relays, not {relay!r:.80}") from None
        self.transmit(self._relayed(packet), BROADCAST, start_ns)

    def relay_together(self, relays: Sequence[Relay]) -> None:
        self._share([(start_ns, self._relayed(packet)) for packet, start_ns in relays])

    def forwarded(self, packet: Packet, *, flags: int) -> bytes:
        return wire.rewrite(packet.frame, self.node, flags)

    def _relayed(self, packet: Packet) -> bytes:
        kept = packet.header.flags & (wire.FLAG_TURN | wire.FLAG_DEAF)
        return self.forwarded(packet, flags=wire.FLAG_FLOOD | kept)

    def _begun(self, packet: Packet, flags: int) -> bytes:
        """The bytes of a packet whose phase begins here: an own packet as it is, another node's with one more hop."""
        if packet.header.origin == self.node:
            return wire.rewrite(packet.frame, self.node, flags | self._deaf_flag, hop=0)
        return wire.rewrite(packet.frame, self.node, flags | packet.header.flags & wire.FLAG_DEAF)

    @property
    def _deaf_flag(self) -> int:
        return wire.FLAG_DEAF if self.deaf else 0

    def _share(self, packets: Sequence[tuple[int, bytes]], *, until_ns: int = 0) -> None:
        """Broadcast packets in as few frames as possible."""
        rest = iter(packets)
        for start_ns, frame, count in aggregated(packets, most_bytes=self.scenario.radio.max_frame_bytes):
            if start_ns.__class__ is not int or until_ns.__class__ is not int:
                self._require_request(frame, start_ns, until_ns)
            seq = self.frames_sent
            wants_status = False
            if self._held:
                for packet_ns, packet in islice(rest, count):
                    wants_status |= self._let_out(packet, seq, packet_ns)
            self.frames_sent = seq + 1
            self.requests.append(_new(TxRequest, (seq, start_ns, frame, BROADCAST, wants_status, until_ns)))

    def _let_out(self, frame: bytes, request: int, start_ns: int) -> bool:
        """Record when the first frame of an own application's packet is announced; True if its status is wanted."""
        name = frame[wire.NAME]
        if name not in self._held:
            return False
        self._held.remove(name)
        own = int.from_bytes(frame[wire.SEQ], "little")
        self.records.append(_new(LetOut, (start_ns, self.node, own)))
        return self.watch.announced(own, request, start_ns)

    def _require_request(self, frame: object, start_ns: object, until_ns: object) -> None:
        """Raise for what no radio can be asked, which would surface in another actor."""
        said = f"{self.scenario.routing.said} transmits"
        if not isinstance(frame, bytes):
            raise LocalProtocolError(f"{said} {frame!r:.80}, which must be bytes")
        for name, instant in (("start_ns", start_ns), ("until_ns", until_ns)):
            if not is_whole(instant):
                raise LocalProtocolError(f"{said} with {name} = {instant!r}, which must be a whole number of ns")

    # --- packets --------------------------------------------------------------------------------------------------

    def announce(
        self, kind: Kind, inner: bytes, *, now_ns: int, flags: int, hop_limit: int, destination: NodeId = BROADCAST
    ) -> Packet:
        return self._own.make(
            kind,
            inner,
            destination=destination,
            priority=wire.PRIORITY_CONTROL,
            flags=flags | self._deaf_flag,
            hop_limit=hop_limit,
            born_ns=now_ns,
        )

    def drop(self, reason: DropReason, packet: Packet, *, now_ns: int) -> None:
        self.dropped[reason] += 1
        self._held.discard(packet.frame[wire.NAME])
        if packet.header.origin == self.node:
            self.watch.dropped(packet.header.seq, reason, now_ns)
        self.records.append(Dropped(now_ns, self.node, reason, packet.header.origin, packet.header.seq))

    def forget(self, packet: Packet) -> None:
        self._duplicates.forget(hash_of(packet.frame))

    def record(self, record: Record) -> None:
        if type(record) not in RECORDS:
            require_record(record, who=self.scenario.routing.said)
        self.records.append(record)

    def stream(self, use: str) -> Random:
        return stream(self.scenario.seed, use, self.node)
