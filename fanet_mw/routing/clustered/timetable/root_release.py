"""The transmit queue of a node with turns of its own: which packets go in each turn. Each is announced one lead ahead.

    a turn:  | one warning | one report | bulk, in order, as many as fit              | the rest, most urgent first |
                                        | or, in its place, a leader's announcements |

Each class of packets in use (`reserved_room.reserved`) has room of its own in a turn, so the wait of a bulk packet
depends on nothing that comes later, such as reports or warnings. Only a leader's announcements delay its bulk. A packet
that is larger than the room of its class waits like bulk. A turn is used only if its flood is over before the next
timetable comes into force. `tdma/turn_timing.py` explains root, turn and span.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_release import OwnTurn, TurnRelease
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import NodeId
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, Kind

_LAST: Final = PRIORITY_BULK + 1
"""The rank of packets that only use the room that all classes leave free."""


class TurnsInForce(NamedTuple):
    """The turns of a node by one timetable, and the instant from which the timetable is in force."""

    valid_ns: int
    turns: Turns
    offsets: tuple[int, ...]
    """The offsets of the node's turns, ascending."""
    frame_bytes: int
    """The number of bytes that one turn can carry."""
    span: int
    """The duration of a flood, in turns: from one of the node's turns until all nodes have the packet."""


class RootRelease(TurnRelease):
    """The transmit queue of one node, and the turns in which the node is the root of a flood."""

    def __init__(self, node: NodeId, queue: TxQueue, *, reserved: Mapping[int, int], lead_ns: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._node = node
        self.reserved: Mapping[int, int] = dict(sorted(reserved.items()))
        """The number of bytes of each turn that bulk must leave free, by priority."""
        self._in_force: Sequence[TurnsInForce] = ()

    def follow(self, in_force: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over the turns of new timetables, in the order in which they come into force."""
        self._in_force = in_force
        self._arm(now_ns)

    def push(self, packet: Packet, *, now_ns: int, last: bool = False) -> Packet | None:
        """Queue a packet; returns the packet that was evicted for it, if any. With `last` it goes behind all others."""
        return self._push(packet, _LAST if last else self._rank(packet), now_ns)

    def outdated(self, *, before_us: int) -> list[Packet]:
        """Take out waiting announcements of this node that were made before an instant [swarm us]."""
        return self._queue.take_older(before_us=before_us, rank=PRIORITY_CONTROL)

    def through_ns(self, packet: Packet, *, now_ns: int) -> int | None:
        """The instant at which the flood of a packet that was just queued is over; None if it is not known.

        Packets that come later do not change it, because they use room of their own or wait behind.
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
        """The number of bytes of a turn that are reserved for a class."""
        if rank < PRIORITY_BULK:
            return self.reserved.get(rank, 0)
        return turn.frame_bytes - sum(self.reserved.values())

    def _rank(self, packet: Packet) -> int:
        """The rank at which a packet waits. A packet whose class has no room of its own waits like bulk, and overtakes
        nothing.

        Only a leader's announcements go before all others; a leader states no bound.
        """
        header = packet.header
        if header.kind in (Kind.SCHEDULE, Kind.LINKS) and header.origin == self._node:
            return PRIORITY_CONTROL
        fits = len(packet.frame) <= self.reserved.get(header.priority, 0)
        return header.priority if fits else PRIORITY_BULK

    def _fill(self, size: int) -> list[Packet]:
        """Take out the packets for one turn that can carry `size` bytes, as shown at the top of this file; always at
        least one packet.
        """
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

        Each turn is one of the timetable that is in force then. There is no end of them unless there is no timetable.
        """
        for index, (valid_ns, turns, offsets, size, span) in enumerate(self._in_force):
            if not offsets:
                continue
            until_ns = self._in_force[index + 1].valid_ns if index + 1 < len(self._in_force) else None
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
