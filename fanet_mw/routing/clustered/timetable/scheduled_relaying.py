"""Relaying by a timetable: the turn in which a packet is received tells which flood it is, and when this node relays
it.

The turn follows from the instant at which the reception ended; the flood follows from the turn and the sender. If this
node's clock is behind the sender's, a frame may seem to end before its turn begins, by at most the slack of a turn.
Data that is received outside of any turn of its flood is counted and not relayed. Control packets, and all packets as
long as no timetable is in force, are relayed by another rule.
"""

from collections.abc import Mapping, Sequence

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.hop_limit import is_used_up
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.clustered.contract import Relaying
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable
from fanet_mw.routing.clustered.timetable.timetables_in_force import TimetablesInForce
from fanet_mw.units import NodeId
from fanet_mw.wire import Kind


class ScheduledRelaying:
    """The relays of one node, in the turns of its timetables."""

    def __init__(self, port: Port, timetables: TimetablesInForce, otherwise: Relaying) -> None:
        self._port = port
        self._timetables = timetables
        self._otherwise = otherwise
        self._slack_ns = turn_slack_ns(port.scenario)
        self._missed = 0
        """The number of packets that arrived only after the node's turn to relay them had begun."""

    def start(self, now_ns: int) -> None:
        """The node has started; no packet is known yet."""

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
            if not timetable.whole or packet.header.origin == heard[1] or not timetable.has_turns(packet.origin):
                return self._in_turn(packet, timetable, heard, instant_ns, now_ns)
            foreign = True  # the sender follows another timetable
        if not foreign and packet.header.kind != Kind.DATA:
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        if packet.origin != self._port.node:  # a copy of an own packet that comes back changes nothing
            self._port.drop(DropReason.OUT_OF_TURN, packet, now_ns=now_ns)
        return ()

    def _in_turn(
        self, packet: Packet, timetable: NodeTimetable, heard: tuple[int, NodeId, int], heard_ns: int, now_ns: int
    ) -> Sequence[Relay]:
        """The relays of this flood in those turns of the node that are still to come; `heard_ns` lies in the turn of
        reception.
        """
        offset, root, instance = heard
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
        return [(packet, start_ns) for start_ns in ahead_ns]

    def report(self) -> Mapping[str, object]:
        return {"missed_turns": self._missed}
