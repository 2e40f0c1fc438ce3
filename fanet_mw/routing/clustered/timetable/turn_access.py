"""Access by a timetable: a node transmits its own packets in its own turns; its relays are in `scheduled_relaying.py`.

Until a timetable gives the node turns, it sends packets to a head, as in slots. Frames without a turn contend in the
window at the beginning of each superframe. Over lossy links, hellos and missed packets have turns of their own, the
calls, and each frame is repeated in later turns (`redundant_scheduling.py`). A packet for one neighbor goes in the next
turn that floods leave this node.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.airtime import longest_access_ns
from fanet_mw.errors import DropReason
from fanet_mw.node.contract import Port
from fanet_mw.node.duplicates import key_of_packet
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.clustered.forwarding.floods import Floods
from fanet_mw.routing.clustered.slots import SlotAccess
from fanet_mw.routing.clustered.timetable.node_timetable import NodeTimetable, TimetablesInForce
from fanet_mw.routing.clustered.timetable.resumed_floods import ResumedFloods
from fanet_mw.routing.clustered.timetable.stated_delays import StatedDelays
from fanet_mw.routing.clustered.timetable.turn_release import CallRelease, RootRelease, TurnsInForce
from fanet_mw.routing.clustered.timetable.turn_size import most_packet_bytes, superframe
from fanet_mw.units import BROADCAST, S, earliest, seconds_to_ns
from fanet_mw.wire import FLAG_FLOOD, FLAG_TURN, PRIORITY_BULK, Kind

_MOST_ANSWERS: Final = 2
"""The greatest number of missed packets that wait for calls; any further ones contend."""

_SHOWN_NS: Final = 1 * S
"""Packets of applications show soonest that a node keeps a timetable; if none comes in this time, a join does."""
_SHOWN: Final = 1.5
"""A join shows it again after so many superframes, or hello intervals if these are longer, without a flood."""


class TurnAccess:
    """The turns of one node (`contract.ScheduledAccess`); the slots of heads while it has no turns."""

    def __init__(
        self,
        port: Port,
        *,
        timetables: TimetablesInForce,
        roots: RootRelease,
        calls: CallRelease,
        spare: CallRelease,
        slots: SlotAccess,
        delays: StatedDelays,
        floods: Floods,
        contention: ContentionTiming,
        resumed: ResumedFloods | None,
    ) -> None:
        self._port = port
        self._timetables = timetables
        self._roots = roots
        self._calls = calls
        self._spare = spare
        self._slots = slots
        self._delays = delays
        self._floods = floods
        self._contention = contention
        self._resumed = resumed
        timed = (slots, delays, resumed)
        self._asks = tuple(part.next_wake_ns for part in timed if part is not None)
        self._lead_ns = port.scenario.radio.lead_ns
        self._has_shown: NodeTimetable | None = None
        """The timetable in whose turns the node has last begun a flood."""
        self._shown_ns = 0
        self._hello_ns = seconds_to_ns(port.scenario.routing.hello_interval_s)
        self._hello_sent_ns = self._hello_waits_ns = 0
        """The instant of the node's latest hello, and the time by which that was put off until a window."""

    def start(self, now_ns: int) -> None:
        self._delays.start(now_ns)

    # --- timetables and roles -------------------------------------------------------------------------------------

    def follow(self, timetable: NodeTimetable | None, *, now_ns: int) -> None:
        """Follow a later timetable, or one of another leader, which may be in force: the node changes to it when what
        it promised under the former has gone. None: no timetable fits.
        """
        if timetable is not None:
            timetable = timetable._replace(valid_ns=max(timetable.valid_ns, self._delays.kept_until_ns(now_ns)))
        self._timetables.follow(timetable, now_ns=now_ns)
        self._change_turns(now_ns)

    def give_up(self, now_ns: int) -> None:
        """Keep no timetable, but out of the turns of those who do."""
        self._timetables.give_up(superframe(self._port.scenario))
        self._change_turns(now_ns)

    def _change_turns(self, now_ns: int) -> None:
        self._delays.follow(now_ns=now_ns)
        self.use_turns(now_ns)
        if self._timetables.newest is None:
            self._calls.drain()  # neighbors will state again what they lack
        stranded = [] if self._roots.has_turn(now_ns=now_ns) else self._stranded(now_ns)
        if not self._spare.has_turn(now_ns=now_ns):
            stranded += self._kept(self._spare.drain(), through_ns=None, now_ns=now_ns)
        for packet in [*stranded, *self._slots.drain()]:
            self.forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns)

    def _stranded(self, now_ns: int) -> list[Packet]:
        """Take out packets whose turns are gone; those with a stated bound are dropped, as other ways may break it."""
        return self._kept(self._roots.drain(), through_ns=None, now_ns=now_ns)

    def _kept(self, packets: Sequence[Packet], *, through_ns: int | None, now_ns: int) -> list[Packet]:
        """Drop those of some packets whose stated bound would be broken; returns the others."""
        kept = []
        for packet in packets:
            if self._delays.keeps(packet, through_ns=through_ns):
                kept.append(packet)
            else:
                self._port.drop(DropReason.BOUND_LOST, packet, now_ns=now_ns)
        return kept

    def use_turns(self, now_ns: int) -> None:
        timetables, node = self._timetables.in_order, self._port.node
        roots = [(one, one.table.spans.get(node, 1)) for one in timetables]
        self._roots.follow(
            [TurnsInForce(one.valid_ns, one.turns, one.roots, one.frame_bytes, span) for one, span in roots],
            now_ns=now_ns,
        )
        self._calls.follow(
            [TurnsInForce(one.valid_ns, one.turns, one.calls, one.frame_bytes, 1) for one in timetables], now_ns=now_ns
        )
        self._spare.follow(
            [TurnsInForce(one.valid_ns, one.turns, one.spare, one.frame_bytes, 1) for one in timetables], now_ns=now_ns
        )

    def serve(self, now_ns: int) -> None:
        self._slots.arm(now_ns)
        for packet in self._slots.drain_uplink():
            if self._roots.has_turn(now_ns=now_ns):
                self._enqueue(packet, now_ns=now_ns)
            else:  # the schedule has made this node a head, and its timetable has yet to come
                self._slots.enqueue(packet, now_ns=now_ns)

    def renew_slot(self) -> None:
        self._slots.renew_slot()

    def must_show(self, now_ns: int) -> bool:
        """True if others cannot know that this node keeps the timetable: no flood of it began lately, none waits."""
        timetable = self._timetables.at(now_ns)
        if timetable is None or timetable.odds is not None or not timetable.roots or len(self._roots):
            return False
        if timetable is self._has_shown:
            return now_ns > self._shown_ns + _SHOWN * max(self._hello_ns, timetable.turns.period_ns)
        return now_ns > timetable.valid_ns + _SHOWN_NS

    # --- packets --------------------------------------------------------------------------------------------------

    def admit(self, packet: Packet, *, due_ns: int) -> bool:
        return self._delays.admit(packet, due_ns=due_ns)

    def most_packet_bytes(self, priority: int) -> int:
        return most_packet_bytes(self._port.scenario, priority)

    def originate(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        self.forward(packet, start_ns=due_ns, now_ns=now_ns)
        bound_ns = self._delays.greatest_bound_ns(packet, now_ns=now_ns)
        through_ns = None if bound_ns is None else self._over_ns(packet, now_ns)
        if self._delays.state(packet, bound_ns, through_ns=through_ns, now_ns=now_ns):
            self._roots.put_off(self._delays.has_promised)

    def _over_ns(self, packet: Packet, now_ns: int) -> int | None:
        """The instant at which all that the node sends of a packet that was just queued is over; None: unknown."""
        timetable = self._timetables.at(now_ns)
        flooded = packet.header.destination == BROADCAST or not self._spare.holds(key_of_packet(packet))
        if timetable is None or flooded:
            return self._roots.through_ns(packet, stays=self._delays.has_promised, now_ns=now_ns)
        start_ns = self._spare.last_ns(now_ns=now_ns)
        return None if start_ns is None else start_ns + timetable.turns.turn_ns

    def forward(self, packet: Packet, *, start_ns: int, now_ns: int, tries: int = 0) -> None:
        if self._roots.has_turn(now_ns=now_ns):
            self._enqueue(packet, now_ns=now_ns)
        else:
            access_ns = longest_access_ns(len(packet.frame), self._port.scenario.radio)
            start_ns = self._contention.with_room(start_ns, access_ns)
            self._slots.forward(packet, start_ns=start_ns, now_ns=now_ns, tries=tries)

    def _enqueue(self, packet: Packet, *, last: bool = False, now_ns: int) -> None:
        """Queue a packet for the turns of this node; with `last` it goes behind all others, including later ones."""
        newest = self._timetables.newest
        assert newest is not None, "a node without a timetable has no turn"
        if self._is_for_neighbor(packet, now_ns):
            self._spare.push(packet, now_ns=now_ns)
            return
        size = newest.frame_bytes
        if packet.header.kind == Kind.DATA:
            reserved = self._roots.reserved
            size = max(size - sum(reserved.values()), reserved.get(packet.header.priority, 0))
        if len(packet.frame) > size:
            self._port.drop(DropReason.TOO_LARGE, packet, now_ns=now_ns)
            return
        self._roots.push(packet, last=last, now_ns=now_ns)

    def _is_for_neighbor(self, packet: Packet, now_ns: int) -> bool:
        """True for bulk to one neighbor, which hears it in a turn that floods leave, as all keep the same timetable."""
        header, timetable = packet.header, self._timetables.at(now_ns + self._lead_ns)
        return (
            timetable is not None
            and header.destination in timetable.near
            and header.priority == PRIORITY_BULK
            and len(packet.frame) <= timetable.frame_bytes
            and self._spare.has_turn(now_ns=now_ns)
            and self._delays.all_keep(timetable, now_ns=now_ns)
        )

    def flood_control(
        self, kind: Kind, inner: bytes, *, now_ns: int, urgent: bool = False, patient: bool = False
    ) -> Packet:
        timetable = self._timetables.at(now_ns + self._lead_ns)
        bound = timetable is not None and timetable.odds is None
        last = kind is Kind.JOIN and not urgent and bound
        if timetable is None or not timetable.roots or (last and (not patient or len(self._roots))):
            # Turns serve packets with a bound. A join uses a turn that nothing else needs if it can wait for one, and
            # any turn if there is no bound. An announcement does not wait for turns of a timetable yet to come.
            return self._floods.contend_control(kind, inner, now_ns=now_ns)
        packet = self._floods.control(kind, inner, now_ns=now_ns)
        for stale in self._roots.outdated(before_us=packet.header.origin_us) if kind is not Kind.JOIN else ():
            self._port.drop(DropReason.EXPIRED, stale, now_ns=now_ns)
        self._enqueue(packet, last=last, now_ns=now_ns)
        return packet

    def answer(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Transmit a missed packet in the node's next call, if it fits; not while it waits for its own flood: who
        receives it outside of its turns would relay neither this copy nor the flood afterwards.
        """
        key = key_of_packet(packet)
        if self._roots.holds(key):
            return
        timetable = self._timetables.at(now_ns)
        crowded = len(self._calls) >= _MOST_ANSWERS
        if self._resumed is not None and self._resumed.resume(packet, now_ns=now_ns):
            return
        if timetable is None or not timetable.calls or crowded or len(packet.frame) > timetable.frame_bytes:
            self._floods.contend_again(packet, due_ns=due_ns, now_ns=now_ns)
        elif not self._calls.holds(key):
            self._calls.push(packet, now_ns=now_ns)

    def hello_due_ns(self, start_ns: int) -> int:
        """When a hello may be sent, so that it is not made long before, and its digest up to date. One a window; after
        one that waited, the next is due sooner, so that they come as often as without windows.
        """
        due_ns = start_ns - min(self._hello_waits_ns, (start_ns - self._hello_sent_ns) // 2)
        timetable = self._timetables.at(start_ns)
        sent_ns = due_ns if timetable is None or timetable.calls else self._contention.not_before(due_ns)
        self._hello_waits_ns, self._hello_sent_ns = sent_ns - due_ns, sent_ns
        return sent_ns

    def hello_start_ns(self, start_ns: int) -> int:
        timetable = self._timetables.at(start_ns)
        if timetable is not None and timetable.calls:
            called_ns = self._calls.reserve(not_before_ns=start_ns, now_ns=start_ns - self._lead_ns)
            if called_ns is not None:
                return called_ns
        return self._contention.not_before(start_ns)

    def hello_until_ns(self, start_ns: int, size: int) -> int:
        return self._contention.ends_ns(start_ns, longest_access_ns(size, self._port.scenario.radio))

    # --- time -----------------------------------------------------------------------------------------------------

    def next_wake_ns(self) -> int | None:
        turns = (release.next_wake_ns() for release in (self._roots, self._calls, self._spare))
        return earliest(*turns, *(ask() for ask in self._asks))

    def wake(self, now_ns: int) -> None:
        self._slots.wake(now_ns)
        self._delays.wake(now_ns)
        if self._resumed is not None:
            self._resumed.wake(now_ns)
        for release in (self._roots, self._spare):
            release.expire(now_ns=now_ns)
        for packets, start_ns in self._roots.due(now_ns=now_ns):
            kept = self._kept(packets, through_ns=self._through_ns(start_ns), now_ns=now_ns)
            if kept:
                self._has_shown, self._shown_ns = self._timetables.at(start_ns), start_ns
                flags = FLAG_FLOOD | FLAG_TURN
                self._floods.begin(kept, start_ns=start_ns, again_ns=self._repetitions(start_ns), flags=flags)
        if len(self._roots) and not self._roots.has_turn(now_ns=now_ns):
            for packet in self._stranded(now_ns):  # that was the node's last turn: the next timetable gives it none
                self.forward(packet, start_ns=now_ns + self._lead_ns, now_ns=now_ns)
        for packets, start_ns in self._calls.due(now_ns=now_ns):
            self._floods.answer(packets, start_ns=start_ns)
        for packets, start_ns in self._spare.due(now_ns=now_ns):
            timetable = self._timetables.at(start_ns)
            assert timetable is not None, "a spare turn is one of a timetable"
            kept = self._kept(packets, through_ns=start_ns + timetable.turns.turn_ns, now_ns=now_ns)
            self._port.transmit_together(kept, flags=0, at_ns=(start_ns,))

    def _through_ns(self, start_ns: int) -> int | None:
        """The end of the flood that begins in one of the node's turns; None if no timetable is in force."""
        timetable = self._timetables.at(start_ns)
        turn = None if timetable is None else timetable.turns.turn_at(start_ns)
        if timetable is None or turn is None:
            return None
        return start_ns + timetable.turns.flood_ns(turn, span=timetable.table.spans.get(self._port.node, 1))

    def _repetitions(self, start_ns: int) -> list[int]:
        """The instants at which a frame that is first transmitted at an instant is repeated."""
        timetable = self._timetables.at(start_ns)
        turn = None if timetable is None else timetable.turns.turn_at(start_ns)
        if timetable is None or turn is None:
            return []
        superframe_ns = timetable.turns.superframe_start_ns(start_ns)
        return [
            timetable.turns.start_ns(later, superframe_start_ns=superframe_ns)
            for later in timetable.again.get(turn, ())
        ]

    # --- for people -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        return self._slots.waiting() + len(self._roots) + len(self._spare)

    def report(self) -> Mapping[str, object]:
        newest = self._timetables.newest
        return {
            **self._delays.report(),
            "planned": newest is not None,
            "turns": None if newest is None else newest.report(),
        }
