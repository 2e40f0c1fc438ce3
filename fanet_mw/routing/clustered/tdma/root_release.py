"""A root's queue and when it lets packets out: what a frame holds in each of its turns, one lead ahead.

    a turn:  | one warning | one report | bulk, in order, as many as fit              | the rest, most urgent first |
                                        | or, in its place, a leader's announcements |

Every class has room of its own, so the wait of one depends on nothing that comes later: not on reports,
not on warnings. A turn is used only if its flood is over before the next timetable comes into force.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease
from fanet_mw.routing.clustered.tdma.turns import Turns
from fanet_mw.units import NodeId
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, Kind

_LAST: Final = PRIORITY_BULK + 1
"""The rank of what goes only where every class leaves room."""


class TurnsInForce(NamedTuple):
    """A timetable in force from an instant on, as far as a root needs it."""

    valid_ns: int
    turns: Turns
    offsets: tuple[int, ...]
    """The node's turns, ascending."""
    frame_bytes: int
    """The bytes that one turn holds."""
    span: int
    """The number of turns from one of the node's own until all nodes have what it let out."""


class RootRelease(TurnRelease):
    """The queue of one node, let out in its own turns."""

    def __init__(self, node: NodeId, queue: TxQueue, *, reserved: Mapping[int, int], lead_ns: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._node = node
        self.reserved: Mapping[int, int] = dict(sorted(reserved.items()))
        """The bytes of each turn that bulk leaves free, by priority."""
        self._plans: Sequence[TurnsInForce] = ()

    def follow(self, plans: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over new turns, given in the order of the instants from which they hold."""
        self._plans = plans
        self._arm(now_ns)

    def has_turn(self, *, now_ns: int) -> bool:
        """True if a turn of this node lies ahead under any timetable that is known."""
        return self._turn(max(now_ns + self._lead_ns, self._free_ns)) is not None

    def push(self, packet: Packet, *, now_ns: int, last: bool = False) -> Packet | None:
        """Queue a packet, `last` of all; returns the one evicted for it."""
        return self._push(packet, _LAST if last else self._rank(packet), now_ns)

    def outdated(self, *, before_us: int) -> list[Packet]:
        """Take out the node's announcements that were made before an instant [swarm us] and still wait."""
        return self._queue.take_older(before_us=before_us, rank=PRIORITY_CONTROL)

    def through_ns(self, packet: Packet, *, now_ns: int) -> int | None:
        """The instant by which the flood of a packet that was just pushed is over; None: it is not known.

        What comes later does not count: it finds room of its own, or waits behind.
        """
        rank = self._rank(packet)
        waiting = self._queue.waiting(rank)
        if not waiting or waiting[-1] is not packet:
            return None
        end_ns, left = None, 0
        turns = self._upcoming(max(now_ns + self._lead_ns, self._free_ns))
        for ahead in waiting:
            if end_ns is None or len(ahead.frame) > left:
                following = next(turns, None)
                if following is None:
                    return None
                turn, end_ns = following
                left = self._room(rank, turn)
            left -= len(ahead.frame)
        return end_ns

    def _room(self, rank: int, turn: OwnTurn) -> int:
        """The bytes of a turn that a class has for itself."""
        if rank < PRIORITY_BULK:
            return self.reserved.get(rank, 0)
        return turn.frame_bytes - sum(self.reserved.values())

    def _rank(self, packet: Packet) -> int:
        """The rank at which a packet waits: one without room of its own in a turn waits like bulk, and overtakes none.

        Only a leader's announcements go before everything; a leader promises no bound.
        """
        header = packet.header
        if header.kind in (Kind.SCHEDULE, Kind.LINKS) and header.origin == self._node:
            return PRIORITY_CONTROL
        fits = len(packet.frame) <= self.reserved.get(header.priority, 0)
        return header.priority if fits else PRIORITY_BULK

    def _fill(self, size: int) -> list[Packet]:
        queue = self._queue
        taken = queue.take(size - sum(self.reserved.values()), rank=PRIORITY_CONTROL)
        announces = bool(taken)
        for rank, room in self.reserved.items():
            taken += queue.take(room, rank=rank)
        if not announces:
            taken += queue.take(size - _bytes(taken), rank=PRIORITY_BULK)
        taken += queue.pop_fitting(size - _bytes(taken))
        return taken or [queue.pop()]

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        following = next(self._upcoming(earliest_ns), None)
        return None if following is None else following[0]

    def _upcoming(self, earliest_ns: int) -> Iterator[tuple[OwnTurn, int]]:
        """The node's turns from an instant on, each with the instant at which its flood is over.

        Each is one of the timetable that is in force then. The turns are endless if there is one.
        """
        for index, (valid_ns, turns, offsets, size, span) in enumerate(self._plans):
            if not offsets:
                continue
            until_ns = self._plans[index + 1].valid_ns if index + 1 < len(self._plans) else None
            at_ns = max(earliest_ns, valid_ns)
            while True:
                start_ns = turns.next_start_ns(offsets, not_before_ns=at_ns)
                offset = turns.turn_at(start_ns)
                assert offset is not None, "a turn of this node is one of the superframe"
                end_ns = start_ns + turns.flood_ns(offset, span=span)
                if until_ns is not None and end_ns > until_ns:
                    break
                yield OwnTurn(start_ns, size), end_ns
                at_ns = start_ns + 1


def _bytes(packets: Sequence[Packet]) -> int:
    return sum(len(packet.frame) for packet in packets)
