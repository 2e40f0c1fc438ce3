"""Floods that ended early because a frame was lost go on in a later superframe, in the turns of the same flood.

A node that has a packet which others lack sends it in its own turn of a flood of the same root, if nothing newer goes
there. Who hears it there takes it for a flood in its turn, so all nodes behind have it in the same superframe, without
contention. Where every turn is used, packets that were missed contend.
"""

from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable, TimetablesInForce
from fanet_mw.units import earliest

_SUPERFRAMES: Final = 3
"""A packet waits for a free turn for so many superframes."""


class ResumedFloods:
    """The packets of other nodes that one node sends again in turns."""

    def __init__(self, port: Port, timetables: TimetablesInForce, floods: Floods) -> None:
        self._timetables = timetables
        self._floods = floods
        self._lead_ns = port.scenario.radio.lead_ns
        self._taken: dict[int, int] = {}
        """The starts of the node's turns in which it relays, each with the end of the frame that it relays there."""
        self._waiting: dict[int, Packet] = {}
        """The packets that are sent again, by the starts of their turns."""

    def take(self, start_ns: int, *, heard_ns: int) -> bool:
        """Use a turn for what a frame held that ended then; False if another frame's contents were announced for it."""
        while self._taken and (first_ns := next(iter(self._taken))) < heard_ns:
            del self._taken[first_ns]  # it is over
        return self._taken.setdefault(start_ns, heard_ns) == heard_ns

    def resume(self, packet: Packet, *, now_ns: int) -> bool:
        """Send a packet in the next of the node's turns that is free; False if there is none."""
        from_ns = now_ns + self._lead_ns
        timetable = self._timetables.at(from_ns)
        if timetable is None or timetable.odds is not None:
            return False
        if any(packet.frame == other.frame for other in self._waiting.values()):
            return True
        turns, own = timetable.turns, _relays(timetable, packet)
        first_ns = turns.superframe_start_ns(from_ns)
        starts = sorted(
            turns.start_ns(turn, superframe_start_ns=first_ns + later * turns.period_ns)
            for later in range(_SUPERFRAMES)
            for turn in own
        )
        for start_ns in starts:
            if start_ns >= from_ns and start_ns not in self._waiting:
                self._waiting[start_ns] = packet
                return True
        return False

    def next_wake_ns(self) -> int | None:
        return earliest(*(start_ns - self._lead_ns for start_ns in self._waiting)) if self._waiting else None

    def wake(self, now_ns: int) -> None:
        """Announce what is due, one lead ahead. What gives way to a newer packet waits on, and so does what lost its
        turn to a newer timetable.
        """
        for start_ns in sorted(start_ns for start_ns in self._waiting if start_ns <= now_ns + self._lead_ns):
            packet = self._waiting.pop(start_ns)
            timetable = self._timetables.at(start_ns)
            holds = timetable is not None and timetable.turns.turn_at(start_ns) in _relays(timetable, packet)
            if holds and self.take(start_ns, heard_ns=now_ns):
                self._floods.answer([packet], start_ns=start_ns)
            else:
                self.resume(packet, now_ns=now_ns + 1)


def _relays(timetable: NodeTimetable, packet: Packet) -> list[int]:
    """The turns in which this node relays floods of a packet's origin."""
    return [
        offset % timetable.turns.per_superframe
        for (root, _), offsets in timetable.mine.items()
        if root == packet.header.origin
        for offset in offsets
    ]
