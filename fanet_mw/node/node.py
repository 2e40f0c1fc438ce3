"""The sans-IO core of one node: feed receptions, statuses and instants; drain requests, deliveries and records.

    reception -> header at fixed offsets -> handled before in this phase? -> full header -> deliver -> protocol -> relay

What comes off the air never raises here: it is counted by reason. The node owns its identity and duplicate suppression;
the routing protocol behind it decides what happens next, and sends through the node's port (`port.py`).
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import zip_longest
from random import Random
from typing import Final, NamedTuple

from fanet_mw import wire
from fanet_mw.bus.messages import Reception, TxStatus
from fanet_mw.errors import DropReason, LocalProtocolError, MalformedFrameError
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.duplicates import DELIVERED, DuplicateSet, key_of
from fanet_mw.node.header_check import HeaderCheck
from fanet_mw.node.neighbors import Silences
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.node.packet_numbering import PacketNumbering
from fanet_mw.node.port import NodePort
from fanet_mw.node.reader import BUNDLE, Looked, Reader
from fanet_mw.part_failure import protocol_report_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered, Generated, Record
from fanet_mw.units import BROADCAST, US, Enu, NodeId
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_SAFETY, Kind

_DATA: Final = int(Kind.DATA)
_HELLO: Final = int(Kind.HELLO)
_SEQ: Final = 3
"""The index of the packet's sequence number in `wire.Fields`."""
_ORIGIN: Final = 4
"""The index of its origin there."""
_PREV_HOP: Final = 6
"""The index of the transmitter there: another station's copy says nothing about who has the packet."""
_NONE: Final[Sequence[Relay]] = ()
_LEADERLESS: Final = {"state": "leaderless", "leader": 0, "term": 0, "epoch": 0}
"""What a node reports of a leader unless its protocol has one, so that one program reads the reports of all."""
_new: Final = tuple.__new__  # for what is made once per frame


class AnnouncedHello(NamedTuple):
    """A hello of this node that was announced to the radio."""

    request: int
    number: int


class Node:
    """One protocol instance: it suppresses duplicates, checks headers, delivers, and asks its routing protocol. Most
    receptions are copies, for which `hear` is quick by keeping methods and lists of its parts as attributes.
    """

    def __init__(
        self,
        node: NodeId,
        scenario: Scenario,
        make_protocol: Callable[[Port], RoutingProtocol],
        *,
        position: Enu,
        reader: Reader | None = None,
    ) -> None:
        """`reader`: the reader that all nodes of a run share; None if this node has one to itself."""
        self.node = node
        self.scenario = scenario
        self.deliveries: list[Packet] = []
        """The packets for the applications of this node, of those to which one of them listens."""
        self.listened: Collection[bytes] | None = None
        """The ids of first inner messages to which the applications listen, as in a frame; None: every id."""
        self.hellos: list[Packet] = []
        """The hellos of neighbors, in which the applications and the clock read more than routing does."""
        self.silences = Silences(count=scenario.node_count)
        """How long neighbors have sent nothing."""
        self._copies = 0
        self._others = 0
        self._lifetimes_ns = scenario.routing.lifetimes_ns()
        self._most_bytes: dict[int, int] = {}
        """The length of the longest packet of each priority for which somebody has asked; it never changes."""
        self._reader = reader or Reader()
        self._duplicates = DuplicateSet()
        self._own = PacketNumbering(node, self._duplicates, most_bytes=scenario.radio.max_frame_bytes)
        self._header_check = HeaderCheck(node, scenario, handed_on=self._own.handed_on)
        self.port = NodePort(node, scenario, self._duplicates, self._own, position=position)
        self.requests = self.port.requests
        """The transmissions that the actor is to take to the radio."""
        self.watch = self.port.watch
        """What becomes of the own packets that an application wants to know of."""
        self._event_jitter = _EventJitter(self.port.stream("event_jitter"), most_ns=scenario.routing.jitter_ns)
        protocol = self._protocol = make_protocol(self.port)
        self.next_wake_ns = protocol.next_wake_ns
        """The protocol's own method, because every wake-up is followed by this question."""
        self.timeless = type(protocol).next_wake_ns is RoutingProtocol.next_wake_ns
        """True for a protocol that never asks to be woken, so that no reception changes when the node is due."""
        self.first_hello_ns, self.hello_due_ns = protocol.first_hello_ns, protocol.hello_due_ns
        self.hello_share, self.clusters = protocol.hello_share, protocol.clusters
        self.bound_ns, self.bounds = protocol.bound_ns, protocol.bounds
        self.least_interval_ns = protocol.least_interval_ns
        self.parted, self.hold, self.lose_sight = protocol.parted, protocol.hold, protocol.lose_sight
        self._on_copy = None if type(protocol).on_copy is RoutingProtocol.on_copy else protocol.on_copy
        """The protocol's handler of copies; None for a protocol that ignores copies, as most receptions are copies."""

    # --- what goes out, and what is known of the node (its actor reads and writes them) ---------------------------

    @property
    def records(self) -> list[Record]:
        """The trace records that the actor has not taken yet, in order."""
        return self.port.records

    @records.setter
    def records(self, records: list[Record]) -> None:
        self.port.records = records

    @property
    def frames_sent(self) -> int:
        return self.port.frames_sent

    @property
    def dropped(self) -> Counter[str]:
        return self.port.dropped

    @property
    def receptions(self) -> int:
        return self._copies + self._others

    @property
    def holds_own(self) -> bool:
        """True while a packet of an application of this node has not been let out."""
        return bool(self._own.held)

    def holds(self, seq: int) -> bool:
        """True while the packet of this number, of an application of this node, has not been let out."""
        return self._own.holds(seq)

    def moved(self, position: Enu, velocity: Enu) -> None:
        self.port.position, self.port.velocity = position, velocity

    def know_clock_error(self, error_ns: int) -> None:
        """Set the greatest error of any clock in the swarm, as far as this node knows; 0 if all clocks are exact."""
        self.port.clock_error_ns = error_ns

    # --- from the host's side -------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """Begin. A node that starts again continues above the sequence numbers of its earlier packets."""
        self._own.start(now_ns)
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
        watch_radio: bool = False,
        jitter: bool = False,
    ) -> int:
        """Send an application payload (whole MAVLink frames); returns the packet's sequence number. Delay counts from
        `born_ns`, at most `now_ns`; the first frame may go `radio.lead_ms` later. With `watch`, `Node.watch` will tell
        the packet's fate, with `watch_radio` also when the radio is done; with `jitter`, and every warning, a flood
        that would contend at once waits a moment. Raises LocalProtocolError beyond `most_packet_bytes`.
        """
        size, most = wire.HEADER_BYTES + len(inner), self.most_packet_bytes(priority)
        if size > most:
            raise LocalProtocolError(f"packet of {size} bytes must be <= {most}, the most that this routing carries")
        born_ns = born_ns // US * US  # what the header can say
        packet = self._own.make(
            Kind.DATA,
            inner,
            destination=destination,
            priority=priority,
            flags=self._protocol.origin_flags,
            hop_limit=self.scenario.routing.hop_limit,
            born_ns=born_ns,
        )
        header, frame = packet
        seq = header.seq
        self.port.records.append(_new(Generated, (born_ns, self.node, seq, app, size)))
        self._own.held.add(frame[wire.NAME])
        if watch:
            self.watch.begin(seq, radio=watch_radio)
        due_ns = max(born_ns + self.scenario.radio.lead_ns, now_ns)
        protocol = self._protocol
        floods = destination == BROADCAST or protocol.origin_flags & FLAG_FLOOD
        if protocol.contends_at_once and floods and (jitter or priority == PRIORITY_SAFETY):
            due_ns += self._event_jitter.ns(now_ns)
        protocol.originate(packet, due_ns=due_ns, now_ns=now_ns)
        return seq

    def say_hello(self, inner: bytes, *, start_ns: int, now_ns: int, time: bytes | None = None) -> AnnouncedHello:
        """Broadcast a hello: the applications' frames (`inner`), the protocol's, and the time beacon if there is room.
        If `time` is given, even empty, the radio reports when the hello ended.
        """
        start_ns = self._protocol.hello_start_ns(start_ns)
        most = self.scenario.radio.max_frame_bytes - wire.HEADER_BYTES
        added = self._protocol.hello_inner(most - len(inner), now_ns=now_ns)
        if not isinstance(added, bytes) or len(added) > most - len(inner):
            told = f"{len(added)} bytes" if isinstance(added, bytes) else f"{added!r:.80}"
            raise LocalProtocolError(
                f"{self.scenario.routing.said}: hello_inner({most - len(inner)}) must give at most so many bytes, not "
                f"{told}"
            )
        inner += added
        if time is not None and len(inner) + len(time) <= most:
            inner += time
        packet = self.port.announce(Kind.HELLO, inner, now_ns=start_ns, flags=0, hop_limit=1)
        request = self._protocol.send_hello(packet, start_ns=start_ns, wants_status=time is not None, now_ns=now_ns)
        return AnnouncedHello(request, packet.header.seq)

    def hear(self, reception: Reception, now_ns: int) -> bool:
        """Handle a reception; returns True if it was only a copy of a packet that was handled before."""
        self.silences.on_frame(reception.src, now_ns)
        reader, frame, handled = self._reader, reception.frame, self._duplicates
        seen = reader.last
        if frame is not seen.frame:
            seen = reader.look(frame)
        phase = seen.phase
        if phase == BUNDLE:
            self._others += 1
            self._hear_bundle(seen, reception, now_ns)
            return False
        packet_hash = seen.hash
        known = handled.young.get(packet_hash)  # as handled.bits(packet_hash), without a call for each copy
        if known is None:
            known = handled.old.get(packet_hash, 0)
        if known & phase:
            self._copies += 1
            fields = seen.fields
            if self._on_copy is not None and fields[_PREV_HOP] == reception.src:
                self._on_copy(key_of(fields[_ORIGIN], fields[_SEQ]), reception.src, now_ns=now_ns)
            return True
        self._others += 1
        for relay in self._first_copy(seen, reception, known, now_ns):
            self.port.relay(relay)
        return False

    def _hear_bundle(self, seen: Looked, reception: Reception, now_ns: int) -> None:
        """Handle each packet of a frame as if it came alone; their relays go together again."""
        try:
            parts = self._reader.parts(seen)
        except MalformedFrameError:
            self.port.dropped[DropReason.MALFORMED] += 1
            return
        relays: list[Sequence[Relay]] = []
        handled, on_copy = self._duplicates, self._on_copy
        for part in parts:
            known = handled.young.get(part.hash)  # as handled.bits(part.hash), without a call for each packet
            if known is None:
                known = handled.old.get(part.hash, 0)
            if not known & part.phase:
                relays.append(self._first_copy(part, reception, known, now_ns))
                continue
            self.port.dropped[DropReason.DUPLICATE] += 1
            fields = part.fields
            if on_copy is not None and fields[_PREV_HOP] == reception.src:
                on_copy(key_of(fields[_ORIGIN], fields[_SEQ]), reception.src, now_ns=now_ns)
        if any(relays):
            for together in zip_longest(*relays):
                self.port.relay_together([relay for relay in together if relay is not None])

    def _first_copy(self, seen: Looked, reception: Reception, before: int, now_ns: int) -> Sequence[Relay]:
        """Handle a packet that is new in its phase; returns its relays. `before`: phases in which it was handled."""
        packet_hash, bits = seen.hash, before | seen.phase
        _, _, origin_us, seq, origin, destination, _, kind, _, hops, priority, _, _, _ = seen.fields
        end_ns = reception.end_ns
        age_ns = end_ns - origin_us * US
        try:
            packet = seen.packet or seen.read()
            why = self._header_check.why_not(seen.fields, before, reception.src, age_ns)
            if why is not None:
                self._disbelieve(why, packet, now_ns)
                return _NONE
            if kind == _HELLO:
                self._duplicates.put(packet_hash, bits)
                if age_ns > self._header_check.oldest_hello_ns:
                    self.port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
                    return _NONE
                self._protocol.on_hello(packet, reception, now_ns=now_ns)
                self.hellos.append(packet)
                return _NONE
            if age_ns > self._lifetimes_ns[priority]:
                self._duplicates.put(packet_hash, bits)
                self.port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
                return _NONE
            if kind == _DATA and not before & DELIVERED and (destination == BROADCAST or destination == self.node):
                bits |= DELIVERED
                if self.listened is None or packet.frame[wire.INNER_ID] in self.listened:
                    self.deliveries.append(packet)
                late_ns = now_ns - end_ns
                self.port.records.append(
                    _new(Delivered, (now_ns, self.node, origin, seq, age_ns + late_ns, hops + 1, late_ns))
                )
            self._duplicates.put(packet_hash, bits)
            return self._protocol.receive(packet, reception, now_ns=now_ns) or _NONE
        except MalformedFrameError:
            self.port.dropped[DropReason.MALFORMED] += 1
            return _NONE

    def _disbelieve(self, why: DropReason, packet: Packet, now_ns: int) -> None:
        """Count a packet whose header states the impossible; it is neither delivered nor relayed."""
        self.port.dropped[why] += 1
        if why is DropReason.OWN:
            self._protocol.on_impersonation(packet, now_ns=now_ns)

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:
        self.watch.radio_done(status.seq, tried=status.attempts > 0, now_ns=now_ns)
        self._protocol.on_status(status, now_ns=now_ns)

    def wake(self, now_ns: int) -> None:
        self._protocol.wake(now_ns)

    def most_packet_bytes(self, priority: int) -> int:
        """The length, header included, of the longest packet that `send` takes at a priority."""
        most = self._most_bytes.get(priority)
        if most is None:
            most = min(self._protocol.most_packet_bytes(priority), self.scenario.radio.max_frame_bytes)
            self._most_bytes[priority] = most
        return most

    def report(self) -> Mapping[str, object]:
        return {
            "frames_sent": self.port.frames_sent,
            "receptions": self.receptions,
            "dropped": self._drops(),
            **_LEADERLESS,
            **protocol_report_of(self._protocol),
        }

    def _drops(self) -> dict[str, int]:
        dropped = self.port.dropped + Counter({DropReason.DUPLICATE: self._copies})
        return {reason: dropped[reason] for reason in sorted(dropped)}


class _EventJitter:
    """By how much later own packets start that several nodes may send on the same event (RFC 5148, 5.2): U(0, most),
    the same for all of one instant. Both UAVs of a conflict foresee it at the same fix, all who hear a packet may
    answer it, and on an idle channel frames that begin at one instant collide with certainty.
    """

    def __init__(self, random: Random, *, most_ns: int) -> None:
        self._random = random
        self._most_ns = most_ns
        self._drawn = -1, 0
        """The last instant, and its jitter."""

    def ns(self, now_ns: int) -> int:
        if self._drawn[0] != now_ns:
            self._drawn = now_ns, int(self._random.random() * self._most_ns)
        return self._drawn[1]
