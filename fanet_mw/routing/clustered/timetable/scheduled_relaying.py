"""Relaying by a timetable: the turn in which a packet is received tells its flood, and when this node relays it.

With a clock behind the sender's a frame may seem to end before its turn begins, by at most the slack; one that found
the medium busy ends some turns later. What was heard too late for this node's own turn is counted, and passed on in
contention if nobody else does. Control packets, and all packets without a timetable, are relayed by another rule.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay, is_used_up
from fanet_mw.routing.clustered.contract import Relaying
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.routing.clustered.timetable.followers import Followers
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable, TimetablesInForce
from fanet_mw.routing.clustered.timetable.resumed_floods import ResumedFloods
from fanet_mw.routing.missing_packets import MissingPackets
from fanet_mw.routing.packet_repair import Repair
from fanet_mw.units import NodeId
from fanet_mw.wire import FLAG_DEAF, FLAG_TURN, Kind

_MOST_LATE_TURNS: Final = 8
"""A frame that ends more turns after its own one is taken for none of its flood."""


class ScheduledRelaying:
    """The relays of one node (`contract.Relaying`), in the turns of its timetables."""

    def __init__(
        self,
        port: Port,
        timetables: TimetablesInForce,
        otherwise: Relaying,
        *,
        resumed: ResumedFloods | None,
        repair: Repair | None,
        missing: MissingPackets | None,
        followers: Followers,
    ) -> None:
        self._port = port
        self._timetables = timetables
        self._otherwise = otherwise
        self._resumed = resumed
        self._repair = repair
        self._missing = missing
        self._followers = followers
        self._slack_ns = turn_slack_ns(port.scenario)
        self._missed = 0
        """The number of packets that arrived only after the node's turn to relay them had begun."""

    def start(self, now_ns: int) -> None: ...

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        timetable = self._timetables.at(reception.end_ns)
        if timetable is None:
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        foreign = False
        for instant_ns in (reception.end_ns, reception.end_ns + self._slack_ns):
            turn = timetable.turns.turn_at(instant_ns)
            heard = None if turn is None else timetable.heard.get((turn, reception.src))
            if heard is None:
                continue
            if _is_of(packet, heard, timetable):
                return self._in_turn(packet, timetable, heard, instant_ns, end_ns=reception.end_ns, now_ns=now_ns)
            foreign = True  # the sender follows another timetable, or is late
        if not foreign and packet.header.kind != Kind.DATA:
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        late = None
        if self._missing is not None:
            self._missing.suspect(now_ns)
            late = self._late(packet, timetable, reception)
        if late is not None:
            return self._in_turn(packet, timetable, *late, end_ns=reception.end_ns, now_ns=now_ns)
        if packet.origin != self._port.node:  # a copy of an own packet that comes back changes nothing
            self._port.drop(DropReason.OUT_OF_TURN, packet, now_ns=now_ns)
            if any(root == packet.header.origin for root, _ in timetable.mine):
                self._pass_on(packet, now_ns)
        return ()

    def _late(
        self, packet: Packet, timetable: NodeTimetable, reception: Reception
    ) -> tuple[tuple[int, NodeId, int], int] | None:
        """The flood of a frame that ended after its turn, and an instant in that turn; None if it is of no flood."""
        turns = timetable.turns
        for instant_ns in range(
            reception.end_ns - turns.turn_ns, reception.end_ns - _MOST_LATE_TURNS * turns.turn_ns - 1, -turns.turn_ns
        ):
            turn = turns.turn_at(instant_ns)
            heard = None if turn is None else timetable.heard.get((turn, reception.src))
            if heard is not None and timetable.odds is None and _is_of(packet, heard, timetable):
                return heard, instant_ns
        return None

    def _in_turn(
        self,
        packet: Packet,
        timetable: NodeTimetable,
        heard: tuple[int, NodeId, int],
        heard_ns: int,
        *,
        end_ns: int,
        now_ns: int,
    ) -> Sequence[Relay]:
        """The relays of this flood in turns to come; `heard_ns`: in the sender's turn, `end_ns`: of the reception."""
        offset, root, instance = heard
        if packet.header.origin == root and packet.header.flags & (FLAG_TURN | FLAG_DEAF) == FLAG_TURN:
            self._followers.hear(timetable.version, root, now_ns=now_ns)
        own = timetable.mine.get((root, instance), ())
        if not own:
            return ()
        if is_used_up(packet.header):
            self._port.drop(DropReason.HOP_LIMIT, packet, now_ns=now_ns)
            return ()
        superframe_ns = (
            timetable.turns.superframe_start_ns(heard_ns)
            - offset // timetable.turns.per_superframe * timetable.turns.period_ns
        )
        starts_ns = [timetable.turns.start_ns(turn, superframe_start_ns=superframe_ns) for turn in own]
        ahead_ns = [start_ns for start_ns in starts_ns if start_ns >= now_ns]
        if not ahead_ns and (timetable.odds is None or own[-1] > offset):
            # A reception that came late has used up some of the lead, or all of it. Over lossy links the first copy
            # that arrives may be one that was sent after the node's own turns.
            self._missed += 1
            self._port.drop(DropReason.MISSED_TURN, packet, now_ns=now_ns)
            self._pass_on(packet, now_ns)
        if self._resumed is not None and not all(self._resumed.take(at_ns, heard_ns=end_ns) for at_ns in ahead_ns):
            self._pass_on(packet, now_ns)
            return ()
        return [(packet, start_ns) for start_ns in ahead_ns]

    def _pass_on(self, packet: Packet, now_ns: int) -> None:
        """Flood a packet that came too late for the node's turn, unless another node does."""
        if self._repair is not None:
            self._repair.pass_on(packet, now_ns)

    def report(self) -> Mapping[str, object]:
        return {"missed_turns": self._missed}


def _is_of(packet: Packet, heard: tuple[int, NodeId, int], timetable: NodeTimetable) -> bool:
    return not timetable.whole or packet.header.origin == heard[1] or not timetable.has_turns(packet.origin)
