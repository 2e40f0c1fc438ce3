"""Relays by a timetable: a node that hears a packet in a turn knows whose flood it is, and so its own turn of it.

Which turn it is follows from the end of the reception, whose flood from the turn and the sender. What is heard outside
of any turn is not relayed if it is data; until a timetable is in force, and for control, another rule decides.
"""

from collections.abc import Mapping, Sequence

from fanet_mw.bus.messages import Reception
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, Relay
from fanet_mw.routing.clustered.contract import Relaying
from fanet_mw.routing.clustered.timetable.turn_plan import TurnPlan
from fanet_mw.routing.clustered.timetable.turn_plans import TurnPlans
from fanet_mw.units import NodeId
from fanet_mw.wire import Kind


class ScheduledRelaying:
    """The relays of one node in the turns of its timetables."""

    def __init__(self, port: Port, plans: TurnPlans, otherwise: Relaying) -> None:
        self._port = port
        self._plans = plans
        self._otherwise = otherwise
        self._missed = 0
        """The number of packets whose turn had begun when the node heard of them."""

    def start(self, now_ns: int) -> None:
        """No packet is known yet."""

    def on_flood(self, packet: Packet, reception: Reception, *, at_once: bool, now_ns: int) -> Sequence[Relay]:
        plan = self._plans.at(reception.end_ns)
        if plan is None:
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        turn = plan.turns.turn_at(reception.end_ns)
        heard = None if turn is None else plan.heard.get((turn, reception.src))
        if heard is None:
            if packet.header.kind == Kind.DATA:
                return ()
            return self._otherwise.on_flood(packet, reception, at_once=at_once, now_ns=now_ns)
        if plan.whole and packet.header.origin != heard[1] and plan.has_turns(packet.origin):
            return ()  # its sender follows another timetable
        return self._in_turn(packet, plan, heard, reception, now_ns)

    def _in_turn(
        self, packet: Packet, plan: TurnPlan, heard: tuple[int, NodeId, int], reception: Reception, now_ns: int
    ) -> Sequence[Relay]:
        """The relays in those turns of this flood that are the node's and still to come."""
        offset, root, instance = heard
        own = plan.mine.get((root, instance), ())
        if not own or packet.header.hop_limit <= 1:
            return ()
        frame_ns = plan.turns.frame_start_ns(reception.end_ns) - offset // plan.turns.per_frame * plan.turns.period_ns
        starts_ns = [plan.turns.start_ns(turn, frame_start_ns=frame_ns) for turn in own]
        ahead_ns = [start_ns for start_ns in starts_ns if start_ns >= now_ns]
        if not ahead_ns and (plan.odds is None or own[-1] > offset):
            # A reception that came late has used up some of the lead, or all of it. Over lossy links the first copy
            # that arrives may be one that was sent after the node's own turns.
            self._missed += 1
            self._port.drop(DropReason.MISSED_TURN, packet, now_ns=now_ns)
        return [Relay(packet, start_ns) for start_ns in ahead_ns]

    def report(self) -> Mapping[str, object]:
        return {"missed_turns": self._missed}
