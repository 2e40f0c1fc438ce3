"""Rounds: a protocol whose delay per hop does not depend on the topology. Each node has one turn in every round, by its
id; the rest of the round is divided into slots.

    urgent packet   goes in the next turn of its origin, and of each node that receives it for the first time; also in a
                    slot of that node that comes sooner, and a warning at once between turns (`spreading.py`: which
                    packet goes first, and who passes it on)
    bulk for all    goes in slots (`bulk_slots.py`: whose they are), while a neighbor is not known to have it
    bulk for one    goes hop by hop between the turns, acknowledged (`one_way.py`)
    topology        each node states its neighbors when they change, and all pass that on in turns (`topology.py`)
    hello           goes in a turn; holds a digest, so that neighbors send what was missed (`Repair`)

One hop takes at most one round, one turn, the lead and the handover, whatever moves, and one round more where hellos
have turns of their own (`delay_law.py`).
"""

from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import ClassVar, Final, NamedTuple

from fanet_mw.bus.messages import Reception, TxStatus
from fanet_mw.errors import DropReason
from fanet_mw.geodesy import Geodetic
from fanet_mw.graph.topology import bits_of
from fanet_mw.motion import Motion
from fanet_mw.node.contract import Port, RoutingProtocol
from fanet_mw.node.duplicates import key_of, key_of_packet, origin_and_seq
from fanet_mw.node.packet import Packet, is_used_up
from fanet_mw.node.reader import decoded, motion_in
from fanet_mw.routing.packet_repair import FLOOD_OVER_NS, Repair
from fanet_mw.routing.rounds.admission import BulkAdmission
from fanet_mw.routing.rounds.bulk_slots import BulkSlots
from fanet_mw.routing.rounds.counted_links import InStep, LastingLinks
from fanet_mw.routing.rounds.delay_law import MOST_HOPS, PATIENT_TURNS, DelayLaw, LikelyDelay
from fanet_mw.routing.rounds.one_way import OneWay
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.spreading import Spreading
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.trace import LIKELY_SHARE, BoundExcludes, BoundStated, LikelyStated
from fanet_mw.units import BROADCAST, MS, US, NodeId, seconds_to_ns
from fanet_mw.wire import FLAG_FLOOD, HEADER_BYTES, PRIORITY_BULK, PRIORITY_REPORT, PRIORITY_SAFETY, Content, Kind
from fanet_mw.wire.hello.digest import MESSAGE_BYTES, Digest, capacity
from fanet_mw.wire.rounds import (
    CAPACITY,
    HEARD_BYTES,
    HELD_BYTES,
    HeardNodes,
    HeldPacket,
    decode_heard,
    decode_held,
    encode_heard,
    encode_held,
    heard_capacity,
)

_DATA: Final = int(Kind.DATA)
_ROUND: Final = int(Kind.ROUND)
_STORE_PACKETS: Final = 4096
"""The most packets that a node keeps for repair."""
_MOST_HELD: Final = 512
"""The most packets of which neighbors wait to be told that this node holds them."""
_MOST_TOLD: Final = 4096
"""The most packets of which a node remembers when neighbors were last told of them."""
_SPARE_HOPS: Final = 2
"""The hops for which a node that is not in the dominating set waits for others to send a new bulk packet."""
_MOST_ROUNDS: Final = 8
"""The rounds that a node lets pass at most before it repeats bulk once more."""
_FLOOD_HOPS: Final = 4
"""A node that comes near is taken to have received from others what is older than the time of so many hops."""
_LASTING_HOPS: Final = 8
"""A link counts if it lasts until its end would be noticed, and for the time of so many hops after that."""
_MUCH_BULK: Final = 4
"""A node takes part in all bulk slots from when so many bulk packets wait that are not left to others until none
does.
"""
_OTHERS_LATER: Final = 1.75
"""The likely delay of own bulk is this multiple of that of others' bulk at this node, because bulk may reach some other
node later.
"""
_SPREAD_SLOTS: Final = 1.0
"""Neighbors that pass on the same warning start within so many slots."""
_FALLS_M_S: Final = 12.0
"""A UAV that sinks this fast is taken to fall: those that dive to evade others reach 11 m/s."""
_BEFORE_TURN_NS: Final = 1 * US
"""A hello is made just before the turn in which it goes is filled."""


class _Told(NamedTuple):
    """What a neighbor tells in one packet."""

    held: Sequence[int]
    """The packets that it holds, by their keys."""
    heard: Sequence[HeardNodes]
    """What nodes have stated about their neighbors."""


def _told_in(content: Content) -> _Told:
    return _Told([key_of(origin, seq) for seq, origin in decode_held(content)], decode_heard(content))


class RoundFlooding(RoutingProtocol):
    """One node of a swarm that floods in rounds."""

    origin_flags: ClassVar[int] = FLAG_FLOOD

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        scenario = port.scenario
        rounds, radio = scenario.rounds, scenario.radio
        self._timing = timing = RoundTiming.of(scenario)
        self._lead_ns, self._handover_ns = radio.lead_ns, radio.handover_ns
        self._lifetimes_ns = scenario.routing.lifetimes_ns()
        self._law = DelayLaw(timing, scenario)
        self._likely = LikelyDelay() if self._law.loses_frames else None
        self._bulk_likely = LikelyDelay()
        deadline_s = scenario.traffic.deadline_s
        self._admission = BulkAdmission(None if deadline_s is None else seconds_to_ns(deadline_s))
        self._topology = Topology(
            port.node,
            count=scenario.node_count,
            epoch_ns=self._law.epoch_ns,
            lifetime_ns=self._law.silent_ns + MOST_HOPS * self._law.hop_ns,
        )
        self._place = Geodetic(*scenario.world.origin_deg, 0.0)
        self._lasting = None
        if radio.channel == "range":
            self._lasting = LastingLinks(
                range_m=radio.range_m * scenario.reaches.get(port.node, 1.0),
                horizon_ns=self._law.silent_ns + _LASTING_HOPS * self._law.hop_ns,
                noticed_ns=self._law.silent_ns,
                reaches=scenario.reaches,
            )
        self._spreading = Spreading(
            port.node, capacity=scenario.routing.queue_frames, repeats=rounds.repeats, patience_ns=self._law.hop_ns,
            links=self._topology.links, lossy=self._law.loses_frames,
        )  # fmt: skip
        self._repair = None
        if rounds.repair_s:
            self._repair = Repair(
                window_ns=seconds_to_ns(rounds.repair_s), capacity=_STORE_PACKETS,
                random=port.stream("repair").random, flood_over_ns=max(4 * FLOOD_OVER_NS, 16 * self._law.hop_ns),
            )  # fmt: skip
        self._slots = BulkSlots(port.node, timing)
        self._random = port.stream("rounds").random
        self._heard_ns: dict[NodeId, int] = {}
        self._in_step = InStep(timing, certain=not scenario.clock.modelled)
        self._one_way = OneWay(port, timing, self._topology, self._heard_ns)
        self._blind_ns = self._lead_ns + self._handover_ns
        """The time that passes from the decision to send until others know of it, airtime and waiting left out."""
        self._flood_ns = _FLOOD_HOPS * (self._law.hop_ns + self._blind_ns)
        self._young_ns = self._flood_ns + 2 * scenario.clock.apart_ns(scenario.duration_ns)
        """A packet that is older proves nothing about who is near: a station far away may have repeated it."""
        self._often = False
        """Whether this node takes part in all bulk slots, as it has stated."""
        self._slot_ns: int | None = None
        """The own bulk slot that is used next; None while nothing waits for one."""
        self._slot_from_ns = 0
        """The instant from which on it was sought."""
        self._slot_by: tuple[int, int, bool] | None = None
        """The neighbors, the state of the topology, and the part in slots, by which it was found."""
        self._gone = 0
        """The neighbors that are out of range by their last hello, though they were heard lately, as a set of bits."""
        self._held: dict[int, None] = {}
        """Packets of which a neighbor should be told that this node holds them, by key."""
        self._told_ns = OrderedDict[int, int]()
        """When neighbors were last told of each packet, the latest last."""
        self._hello: Packet | None = None
        """The hello that waits for the own turn."""
        self._hello_waits = 0
        """The number of turns in which the hello found no room."""
        self._near = 0
        """The nodes that were heard lately, as a set of bits (`topology.nodes_of`)."""
        self._near_until_ns = 0
        """The instant at which the first of them will have been silent for too long."""
        self._turn_ns = 0
        """The next own turn that may still be filled."""
        self._turn_asked = False
        """Whether this node has asked to be woken for that turn, because something waits for it."""
        self._speaks_ns = 0
        """The own turn that is used even if there is nothing new to say, because this node would be missed."""
        self._stated = 0
        """The number of bounds that were stated."""
        self._now_ns = 0
        """The instant at which this node was woken last."""

    def start(self, now_ns: int) -> None:
        self._topology.state(0, often=False, now_ns=now_ns)
        self._turn_ns = self._timing.turn_start_ns(self._port.node, from_ns=now_ns + self._lead_ns)
        self._speak_after(self._turn_ns)

    # --- packets --------------------------------------------------------------------------------------------------

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self._hold(packet, now_ns)
        if self._in_turns(packet):
            self._state_bound(packet, now_ns)
            self._queue(packet, src=None, now_ns=now_ns)
            return
        if packet.header.destination == BROADCAST:
            if not self._admission.admit(self._port.node, now_ns=now_ns):
                self._port.drop(DropReason.ADMISSION, packet, now_ns=now_ns)
                return
            heard_ns = self._bulk_likely.over_ns(self._law.way_ns(self._topology.farthest(now_ns)))
            if self._admission.steady and heard_ns is not None:
                self._state_likely(packet, round(_OTHERS_LATER * heard_ns), now_ns=now_ns)
        self._send_bulk(packet, from_ns=due_ns, now_ns=now_ns)

    def receive(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        src, header = reception.src, packet.header
        kind = header.kind
        young = now_ns - header.origin_us * US <= self._young_ns
        if young:
            self._heard_ns[src] = now_ns
            if not self._near >> (src - 1) & 1:
                self._meets(src, now_ns)
        if kind == _ROUND:
            if not young:
                self._port.drop(DropReason.EXPIRED, packet, now_ns=now_ns)
                return
            if not self._in_step.certain:
                self._in_step.hear(src, reception.end_ns)
            self._on_round(packet, src, now_ns)
            return
        if kind == _DATA:
            self._hold(packet, now_ns)
            if header.destination == BROADCAST:
                self._compare(packet, now_ns)
        if header.destination == self._port.node:
            return
        if is_used_up(header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
        elif self._in_turns(packet):
            self._queue(packet, src=src, now_ns=now_ns)
        elif not header.flags & FLAG_FLOOD:
            self._send_bulk(packet, from_ns=now_ns + self._lead_ns, now_ns=now_ns)
        else:
            self._tell_held(key_of(header.origin, header.seq), now_ns)
            self._queue_bulk(packet, src=src, from_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def on_copy(self, key: int, src: NodeId, *, now_ns: int) -> None:
        spreading = self._spreading
        if spreading.made_ns(key) >= now_ns - self._young_ns:
            self._heard_ns[src] = now_ns
            if not self._near >> (src - 1) & 1:
                self._meets(src, now_ns)
        if self._repair is not None and key in self._repair.pending:
            self._repair.on_copy(key, now_ns=now_ns)
        if spreading.on_copy(key, src, neighbors=self._near, now_ns=now_ns):
            self._tell_held(key, now_ns)

    def _state_bound(self, packet: Packet, now_ns: int) -> None:
        """State by when all nodes have an own packet, if that is known."""
        header = packet.header
        law_ns = self._law.bound_ns(
            self._topology,
            priority=header.priority, clock_error_ns=self._port.clock_error_ns, now_ns=now_ns, size=len(packet.frame),
        )  # fmt: skip
        if law_ns is None:
            return
        if self._likely is not None:
            likely_ns = self._likely.over_ns(self._law.way_ns(self._topology.farthest(now_ns)))
            self._state_likely(packet, likely_ns, now_ns=now_ns)
        elif law_ns <= self._lifetimes_ns[header.priority]:
            self._stated += 1
            self._port.record(BoundStated(header.origin_us * US, self._port.node, header.seq, law_ns))
            self._exclude(self._law.absent(self._topology, now_ns=now_ns) or (), packet)

    def _state_likely(self, packet: Packet, likely_ns: int | None, *, now_ns: int) -> None:
        """State by when nearly all nodes to which a way leads have an own packet, if that is known."""
        header = packet.header
        if likely_ns is None or likely_ns > self._lifetimes_ns[header.priority]:
            return
        absent = self._law.absent(self._topology, now_ns=now_ns)
        if absent is not None:
            origin_ns = header.origin_us * US
            self._port.record(LikelyStated(origin_ns, self._port.node, header.seq, likely_ns, LIKELY_SHARE))
            self._exclude(absent, packet)

    def _exclude(self, nodes: Iterable[NodeId], packet: Packet) -> None:
        """Record that the bound, or the likely delay, of an own packet does not apply to these nodes."""
        header = packet.header
        for node in nodes:
            self._port.record(BoundExcludes(header.origin_us * US, self._port.node, header.seq, node))

    def _compare(self, packet: Packet, now_ns: int) -> None:
        """Learn from the delay of another node's packet how long own packets may take."""
        origin = NodeId(packet.header.origin)
        delay_ns = now_ns + self._handover_ns - packet.header.origin_us * US
        likely, hops = self._likely, self._topology.hops_to(origin, now_ns)
        if not self._in_turns(packet):
            likely = self._bulk_likely
            self._admission.hear(origin, delay_ns, now_ns=now_ns)
        elif likely is None and hops is not None and now_ns - delay_ns > self._topology.reached_since_ns(origin):
            self._law.hear(delay_ns, hops=hops, priority=packet.header.priority, now_ns=now_ns)
        if likely is not None and hops is not None:
            likely.hear(delay_ns, way_ns=self._law.way_ns(hops))

    def _in_turns(self, packet: Packet) -> bool:
        """True for a packet that travels in turns: any but bulk, and bulk if rounds have no slots for it."""
        return self.bounds(packet.header.priority)

    def _hold(self, packet: Packet, now_ns: int) -> None:
        if self._repair is not None and packet.header.destination == BROADCAST and self._in_turns(packet):
            self._repair.hold(packet, flooded=True, expect_ns=now_ns, now_ns=now_ns)

    def _tell_held(self, key: int, now_ns: int) -> None:
        """Tell the neighbors in the next turns that this node has a packet."""
        hop_ns = self._law.hop_ns
        if len(self._held) >= _MOST_HELD or now_ns - self._told_ns.get(key, -hop_ns) < hop_ns:
            return  # who sent this copy could not know yet what was told lately
        self._held[key] = None

    # --- turns ----------------------------------------------------------------------------------------------------

    def _queue(self, packet: Packet, *, src: int | None, now_ns: int, once: bool = False) -> None:
        """A packet is to go in the node's next turn."""
        self._law.count(len(packet.frame), priority=packet.header.priority, now_ns=now_ns)
        evicted = self._spreading.push(packet, src=src, now_ns=now_ns, once=once)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)
        self._reach_turn(now_ns)
        if self._timing.slots and packet.header.priority == PRIORITY_SAFETY:
            self._send_at_once(packet, now_ns)
        elif self._timing.slots:
            self._reach_slot(now_ns, now_ns)

    def _send_at_once(self, packet: Packet, now_ns: int) -> None:
        """A warning contends between the turns, whoever owns the slot, and goes in the turn as well. One made during
        turns begins at random after their end, because all that wait for this end would begin there at once.
        """
        spread_ns = int(self._random() * _SPREAD_SLOTS * self._timing.slot_ns)
        wanted_ns = now_ns + self._lead_ns + spread_ns
        start_ns = self._timing.between_turns_ns(wanted_ns)
        start_ns += spread_ns if start_ns > wanted_ns else 0
        if not self._expired(packet, start_ns):
            self._spreading.went_ahead(packet)
            self._port.transmit_together([packet], flags=FLAG_FLOOD, at_ns=(start_ns,))

    def _reach_turn(self, now_ns: int) -> None:
        """Something waits: fill the next turn that can be announced in time. A turn for which the node has asked to be
        woken is kept while half a lead is left, because a process may be woken that late.
        """
        asked = self._turn_asked and now_ns <= self._turn_ns - self._lead_ns // 2
        if self._turn_ns < now_ns + self._lead_ns and not asked:
            self._turn_ns = self._timing.turn_start_ns(self._port.node, from_ns=now_ns + self._lead_ns)
        self._turn_asked = True

    def _use_turn(self, turn_ns: int, now_ns: int) -> None:
        """Announce the frame of a turn: urgent packets, what neighbors are told, then the hello, as they fit; a hello
        that has found no room for long goes first.
        """
        room, together = self._timing.turn_bytes, list[Packet]()
        hello = self._hello
        if hello is not None and self._hello_waits >= PATIENT_TURNS:
            room -= self._add_hello(together)
        kept = self._law.kept_bytes if self._topology.news else 0
        neighbors = self._neighbors(now_ns)
        for key in self._spreading.spared(neighbors):
            self._tell_held(key, now_ns)
        for packet in self._spreading.wanted(neighbors, gone=self._gone, start_ns=turn_ns):
            if self._expired(packet, turn_ns):
                continue
            size = len(packet.frame)
            if size <= room - kept or (size <= room and not together):
                room -= size
                together.append(packet)
                self._spreading.sent(packet, start_ns=turn_ns)
        told = self._told(room, now_ns)
        if told is not None:
            room -= len(told.frame)
            together.append(told)
        if self._hello is not None:
            if len(self._hello.frame) <= room:
                room -= self._add_hello(together)
            else:
                self._hello_waits += 1
        if together:
            self._speak_after(turn_ns)
            self._port.transmit_together(together, flags=FLAG_FLOOD, at_ns=(turn_ns,))

    def _speak_after(self, turn_ns: int) -> None:
        self._speaks_ns = self._timing.turn_start_ns(self._port.node, from_ns=turn_ns + self._law.speaks_ns)

    def _add_hello(self, together: list[Packet]) -> int:
        hello, self._hello, self._hello_waits = self._hello, None, 0
        assert hello is not None, "somebody has looked whether there is one"
        together.append(hello)
        return len(hello.frame)

    def _expired(self, packet: Packet, at_ns: int) -> bool:
        """True, and the packet is forgotten, if it is older than its lifetime at an instant."""
        if not self._is_too_old(packet, at_ns):
            return False
        if self._spreading.forget(packet):
            self._port.drop(DropReason.EXPIRED, packet, now_ns=at_ns)
        return True

    def _is_too_old(self, packet: Packet, at_ns: int) -> bool:
        header = packet.header
        return at_ns - header.origin_us * US > self._lifetimes_ns[header.priority]

    def _told(self, room: int, now_ns: int, *, ahead: bool = False) -> Packet | None:
        """A packet that tells the neighbors of links and of held packets; None if there is nothing, or no room.
        `ahead` of the turn: of changed links alone.
        """
        room -= HEADER_BYTES
        inner = b""
        if self._held and not ahead and room >= HELD_BYTES:
            told = list(self._held)[: room // HELD_BYTES * CAPACITY]
            for key in told:
                del self._held[key]
                self._told_ns[key] = now_ns
                self._told_ns.move_to_end(key)
            while len(self._told_ns) > _MOST_TOLD:
                self._told_ns.popitem(last=False)
            packets = [HeldPacket(seq, origin) for origin, seq in map(origin_and_seq, told)]
            inner += encode_held(packets, self._port.node)
            room -= HELD_BYTES * -(-len(told) // CAPACITY)
        if self._topology.news and room >= HEARD_BYTES:
            count = self._port.scenario.node_count
            most = room // HEARD_BYTES * heard_capacity(count)
            inner += encode_heard(self._topology.take_news(most, ahead=ahead), self._port.node, count=count)
        if not inner:
            return None
        return self._port.announce(Kind.ROUND, inner, now_ns=now_ns, flags=FLAG_FLOOD, hop_limit=1)

    def _on_round(self, packet: Packet, src: NodeId, now_ns: int) -> None:
        """A neighbor tells of links and of packets that it holds."""
        if packet.header.origin != src:
            return
        held, heard = decoded(packet.frame, _told_in)
        if held:
            self._spreading.on_held(held, src)
        self._topology.hear(heard, now_ns=now_ns)
        if self._topology.news:
            self._reach_turn(now_ns)
            self._hurry_changes(now_ns)

    def _hurry_changes(self, now_ns: int) -> None:
        """Use the next own bulk slot for changes of links, if one comes before the turn."""
        if self._timing.slots and self._topology.has_changes:
            self._reach_slot(now_ns, now_ns)

    # --- bulk -----------------------------------------------------------------------------------------------------

    def _send_bulk(self, packet: Packet, *, from_ns: int, now_ns: int, tried: int = 0) -> None:
        one = packet.header.destination != BROADCAST
        if one and self._one_way.send(
            packet, near=self._neighbors(now_ns), from_ns=from_ns, now_ns=now_ns, tried=tried
        ):
            return
        self._queue_bulk(packet, src=None, from_ns=from_ns, now_ns=now_ns)

    def _queue_bulk(self, packet: Packet, *, src: int | None, from_ns: int, now_ns: int) -> None:
        spare = src is not None and not self._topology.dominates()
        if spare:
            from_ns += _SPARE_HOPS * self._law.hop_ns
        evicted = self._spreading.push(packet, src=src, now_ns=now_ns, bulk_from_ns=from_ns, spare=spare)
        if evicted is not None:
            self._port.drop(DropReason.QUEUE_FULL, evicted, now_ns=now_ns)
        self._reach_slot(from_ns, now_ns)

    def _reach_slot(self, from_ns: int, now_ns: int) -> None:
        """Something may be sent from an instant on: the first own slot that can be announced in time is to be used."""
        from_ns = max(from_ns, now_ns + self._lead_ns)
        if self._slot_ns is None or from_ns < self._slot_from_ns:
            self._seek_slot(from_ns, now_ns)

    def _seek_slot(self, from_ns: int, now_ns: int) -> None:
        """Find the first own bulk slot at or after an instant."""
        self._slot_from_ns = from_ns
        rivals = self._topology.rivals(self._neighbors(now_ns))
        self._slot_ns = self._slots.next_ns(self._slot_from_ns, in_each_slot=self._often, rivals=rivals)
        self._slot_by = self._near, self._topology.changes, self._often

    def _use_slot(self, slot_ns: int, now_ns: int) -> None:
        """Announce the frame of a bulk slot, if it is still this node's own, and seek the next one."""
        rivals = self._topology.rivals(self._neighbors(now_ns))
        changed = self._slot_by != (self._near, self._topology.changes, self._often)
        lost = changed and self._slots.next_ns(slot_ns, in_each_slot=self._often, rivals=rivals) != slot_ns
        if slot_ns < now_ns or lost:
            self._seek_slot(max(slot_ns, now_ns + self._lead_ns), now_ns)
            return
        room, together, neighbors = self._timing.slot_bytes, list[Packet](), self._neighbors(now_ns)
        for urgent in self._spreading.take_hasty(self._timing.hasty_bytes, neighbors):
            if not self._expired(urgent, slot_ns):
                room -= len(urgent.frame)
                together.append(urgent)
        while (packet := self._spreading.next_bulk(neighbors, gone=self._gone, start_ns=slot_ns)) is not None:
            if self._expired(packet, slot_ns):
                continue
            if len(packet.frame) > room:
                self._spreading.look_again(packet, from_ns=slot_ns)
                break
            room -= len(packet.frame)
            together.append(packet)
            times = self._spreading.sent(packet, start_ns=slot_ns)
            rounds = min(_MOST_ROUNDS, 1 << times)
            again_ns = slot_ns + 2 * (self._law.hop_ns + self._blind_ns) + rounds * self._timing.period_ns
            self._spreading.look_again(packet, from_ns=again_ns)
        if self._topology.has_changes:
            told = self._told(room, now_ns, ahead=True)
            together += [told] if told is not None else []
        if together:
            self._port.transmit_together(together, flags=FLAG_FLOOD, at_ns=(slot_ns,))
        due_ns = self._spreading.bulk_due_ns(neighbors)
        self._slot_ns = None
        if due_ns is not None:
            soonest_ns = max(slot_ns + self._timing.slot_ns, now_ns + self._lead_ns // 2)  # it was woken late, perhaps
            self._seek_slot(max(due_ns, soonest_ns), now_ns)

    def on_status(self, status: TxStatus, *, now_ns: int) -> None:
        attempt = self._one_way.failed(status)
        if attempt is None:
            return
        if self._is_too_old(attempt.packet, now_ns):
            self._port.drop(DropReason.EXPIRED, attempt.packet, now_ns=now_ns)
        else:
            self._send_bulk(attempt.packet, from_ns=now_ns, now_ns=now_ns, tried=attempt.tried)

    def _meets(self, src: NodeId, now_ns: int) -> None:
        """A frame came from a node that was not near before: it cannot know what this node has told lately."""
        self._near |= 1 << (src - 1)
        old_ns = now_ns - self._flood_ns
        if self._topology.reaches(src, now_ns):
            self._spreading.assume(src, until_ns=old_ns)
        else:
            self._topology.on_other_part(now_ns)
            self._hurry_changes(now_ns)
        for key in self._spreading.recent(old_ns):
            self._held[key] = None

    def _neighbors(self, now_ns: int) -> int:
        """The nodes that were heard lately."""
        if now_ns > self._near_until_ns:
            horizon_ns = now_ns - self._law.silent_ns
            near = {node: heard_ns for node, heard_ns in self._heard_ns.items() if heard_ns >= horizon_ns}
            self._near = bits_of(near)
            self._near_until_ns = min(near.values(), default=now_ns) + self._law.silent_ns
        return self._near

    def _stayers(self, now_ns: int) -> int:
        """The neighbors that keep this node's rounds, and with which it has links that will last. While it falls it has
        none, so that no bound counts on it when its radio ends on the ground.
        """
        if self._port.velocity.up <= -_FALLS_M_S:
            return 0
        near = self._in_step.among(self._neighbors(now_ns))
        if self._lasting is None:
            return near
        own = Motion(self._port.position, self._port.velocity, now_ns)
        lasting = self._lasting.among(near, own)
        self._gone = self._lasting.gone
        return lasting

    # --- hellos ---------------------------------------------------------------------------------------------------

    def first_hello_ns(self, earliest_ns: int, start_ns: int) -> int:
        return self.hello_due_ns(earliest_ns)

    def hello_due_ns(self, start_ns: int) -> int:
        return self._timing.turn_start_ns(self._port.node, from_ns=start_ns) - _BEFORE_TURN_NS

    def hello_inner(self, room: int, *, now_ns: int) -> bytes:
        """The digest of recent packets, as far as the frame of one turn has room."""
        room -= self._port.scenario.radio.max_frame_bytes - self._timing.turn_bytes
        if self._repair is None or room < MESSAGE_BYTES:
            return b""
        return self._repair.digest(most=capacity(room), now_ns=now_ns).encode_frames(self._port.node)

    def send_hello(self, packet: Packet, *, start_ns: int, wants_status: bool, now_ns: int) -> int:
        """Put the hello into the frame of the turn; one whose end the clock must know has that turn alone."""
        turn_ns = self._timing.turn_start_ns(self._port.node, from_ns=start_ns)
        if not wants_status:
            self._hello = packet
            if not self._turn_asked:
                self._turn_ns = max(self._turn_ns, turn_ns)
                self._turn_asked = True
            return -1
        self._turn_ns = max(self._turn_ns, self._timing.turn_start_ns(self._port.node, from_ns=turn_ns + 1))
        return self._port.transmit(packet.frame, BROADCAST, turn_ns, wants_status=True)

    def on_hello(self, packet: Packet, reception: Reception, *, now_ns: int) -> None:
        src = reception.src
        self._heard_ns[src] = now_ns
        if not self._near >> (src - 1) & 1:
            self._meets(src, now_ns)
        self._in_step.hear(src, reception.end_ns)
        if self._lasting is not None:
            told = motion_in(packet.frame, own=self._port.node, now_ns=now_ns, place=self._place)
            if told is not None:
                self._lasting.hear(*told)
        digest = decoded(packet.frame, Digest.decode_frames) if self._repair else None
        if self._repair and digest:
            self._repair.on_digest(digest, now_ns=now_ns)

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        first_ns = self._topology.epoch_end_ns
        turn_ns, slot_ns, repair = self._turn_ns - self._lead_ns, self._slot_ns, self._repair
        if turn_ns < first_ns and (
            self._held or self._hello is not None or self._spreading.urgent or self._topology.news
        ):
            first_ns = turn_ns
        if self._speaks_ns - self._lead_ns < first_ns:
            first_ns = self._speaks_ns - self._lead_ns
        if slot_ns is not None and slot_ns - self._lead_ns < first_ns:
            first_ns = slot_ns - self._lead_ns
        if repair is not None and repair.pending:
            due_ns = repair.next_wake_ns()
            if due_ns is not None and due_ns < first_ns:
                first_ns = due_ns
        return first_ns

    def wake(self, now_ns: int) -> None:
        self._now_ns = now_ns
        if now_ns >= self._topology.epoch_end_ns:
            much = 1 if self._often else _MUCH_BULK  # what others are to send must not take the relays' slots
            self._often = self._topology.dominates() or self._spreading.has_due_bulk(much)
            self._topology.state(self._stayers(now_ns), often=self._often, now_ns=now_ns)
            self._hurry_changes(now_ns)
        self._repair_due(now_ns)
        if self._slot_ns is not None and self._slot_ns - self._lead_ns <= now_ns:
            self._use_slot(self._slot_ns, now_ns)
        if self._speaks_ns - self._lead_ns <= now_ns:
            self._topology.repeat()
            self._speak_after(now_ns + self._lead_ns)
            self._reach_turn(now_ns)
        turn_ns = self._turn_ns
        if turn_ns - self._lead_ns > now_ns:
            return
        if turn_ns + self._timing.turn_ns // 2 >= now_ns:
            self._use_turn(turn_ns, now_ns)
        waits = self._spreading.urgent or self._hello is not None or self._held or self._topology.news
        self._turn_asked = bool(waits)
        self._turn_ns = self._timing.turn_start_ns(self._port.node, from_ns=max(turn_ns + 1, now_ns + self._lead_ns))

    def _repair_due(self, now_ns: int) -> None:
        """Send again what a neighbor's hello has shown to be missing there."""
        if self._repair is None:
            return
        for _, packet in self._repair.due(now_ns=now_ns):
            if is_used_up(packet.header) and packet.header.origin != self._port.node:
                continue
            if key_of_packet(packet) not in self._spreading:
                self._queue(packet, src=None, now_ns=now_ns, once=True)

    # --- what is known --------------------------------------------------------------------------------------------

    def bound_ns(self) -> int | None:
        if self._likely is not None:
            return None
        return self._law.bound_ns(
            self._topology,
            priority=PRIORITY_REPORT if self._timing.slots else PRIORITY_BULK,
            clock_error_ns=self._port.clock_error_ns, now_ns=self._now_ns,
        )  # fmt: skip

    def parted(self, now_ns: int, *, without: Collection[int] = ()) -> Collection[NodeId]:
        return self._topology.parted(now_ns, without=without)

    def hold(self, nodes: Collection[NodeId]) -> None:
        if self._lasting is not None:
            self._lasting.held = bits_of(nodes)

    def lose_sight(self, ends_ns: Mapping[NodeId, int]) -> None:
        if self._lasting is not None:
            self._lasting.sight_ends_ns = ends_ns

    def bounds(self, priority: int) -> bool:
        return priority < PRIORITY_BULK or not self._timing.slots

    def least_interval_ns(self, deadline_ns: int) -> int | None:
        bound_ns = self.bound_ns()
        return None if bound_ns is None or bound_ns > deadline_ns else self._timing.period_ns

    def most_packet_bytes(self, priority: int) -> int:
        if self.bounds(priority):
            return self._timing.turn_bytes
        return self._timing.slot_bytes

    def waiting(self) -> int:
        return self._spreading.waiting() + self._one_way.waiting()

    def report(self) -> Mapping[str, object]:
        return {
            "waiting": self.waiting(),
            "repaired": self._repair.repaired if self._repair else 0,
            "repeated": self._spreading.repeated,
            "bounds_stated": self._stated,
            "admitted_each_ms": self._admission.interval_ns / MS,
        }
