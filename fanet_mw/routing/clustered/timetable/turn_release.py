"""The transmit queues of a node that has turns: one frame in each turn, announced to the radio one lead ahead.

    a turn:  | one warning | one report | bulk, in order, as many as fit              | the rest, most urgent first |
                                        | or, in its place, a leader's announcements |

Each class in use has room of its own in a turn (`turn_size.reserved`); a packet larger than that waits like bulk. A
turn is used only if its flood is over before the next timetable.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.units import NodeId
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, Kind

_LAST: Final = PRIORITY_BULK + 1
"""The rank of packets that only use the room that all classes leave free."""


def _all(packet: Packet) -> bool:
    return True


class TurnsInForce(NamedTuple):
    """The turns of a node by one timetable, and the instant from which the timetable is in force."""

    valid_ns: int
    turns: Turns
    offsets: tuple[int, ...]
    """The offsets of the node's turns, ascending."""
    frame_bytes: int
    span: int
    """The duration of a flood, in turns: from one of the node's turns until all nodes have the packet."""


class OwnTurn(NamedTuple):
    """A future turn in which the node may transmit."""

    start_ns: int
    frame_bytes: int
    """The number of bytes that the turn can carry; 0 means one packet of any length."""


class TurnRelease(ABC):
    """The queue of one node, and the next turn for which a frame is planned."""

    def __init__(self, queue: TxQueue, *, lead_ns: int) -> None:
        self._queue = queue
        self.expire = queue.expire
        """The method that drops expired packets; it is called at every wake-up."""
        self._lead_ns = lead_ns
        self._free_ns = 0
        """The first instant after the start of the last turn that was used or reserved."""
        self.planned: OwnTurn | None = None
        """The turn for which a frame is planned, if any; public, because it is looked at after every reception."""
        self._in_force: Sequence[TurnsInForce] = ()
        """The node's turns of this kind by each timetable that is in force or announced."""

    def follow(self, in_force: Sequence[TurnsInForce], *, now_ns: int) -> None:
        """Take over the turns of new timetables, in the order in which they come into force."""
        self._in_force = in_force
        self._arm(now_ns)

    @abstractmethod
    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        """The first turn of the node from an instant on."""

    def has_turn(self, *, now_ns: int) -> bool:
        return self._turn(max(now_ns + self._lead_ns, self._free_ns)) is not None

    def __len__(self) -> int:
        return len(self._queue)

    def push(self, packet: Packet, *, now_ns: int) -> None:
        self._push(packet, packet.header.priority, now_ns)

    def _push(self, packet: Packet, rank: int, now_ns: int) -> None:
        self._queue.push(packet, rank=rank, now_ns=now_ns)
        if self.planned is None:
            self._arm(now_ns)

    def holds(self, key: int) -> bool:
        """True if the packet with this key (`duplicates.key_of`) is queued."""
        return key in self._queue

    def drain(self) -> list[Packet]:
        self.planned = None
        return self._queue.drain()

    def next_wake_ns(self) -> int | None:
        return None if self.planned is None else self.planned.start_ns - self._lead_ns

    def due(self, *, now_ns: int) -> list[tuple[list[Packet], int]]:
        """Take out the packets to announce now: for each frame its packets, and the instant of the frame."""
        released = []
        while self.planned is not None and self.planned.start_ns - self._lead_ns <= now_ns and len(self._queue):
            released.append((self._fill(self.planned.frame_bytes), self.planned.start_ns))
            self._free_ns = self.planned.start_ns + 1
            self._arm(now_ns)
        if not len(self._queue):
            self.planned = None
        return released

    def _fill(self, size: int) -> list[Packet]:
        """Take out the packets for one turn: the most urgent one, and others that fit into the same frame."""
        first = self._queue.pop()
        return [first, *self._queue.pop_fitting(size - len(first.frame))]

    def _arm(self, now_ns: int) -> None:
        earliest_ns = max(now_ns + self._lead_ns, self._free_ns)
        self.planned = self._turn(earliest_ns) if len(self._queue) else None


class RootRelease(TurnRelease):
    """The transmit queue of one node, and the turns in which the node is the root of a flood."""

    def __init__(self, node: NodeId, queue: TxQueue, *, reserved: Mapping[int, int], lead_ns: int) -> None:
        super().__init__(queue, lead_ns=lead_ns)
        self._node = node
        self.reserved: Mapping[int, int] = dict(sorted(reserved.items()))
        """The number of bytes of each turn that bulk must leave free, by priority."""

    def push(self, packet: Packet, *, now_ns: int, last: bool = False) -> None:
        """Queue a packet, with `last` behind all others."""
        self._push(packet, _LAST if last else self._rank(packet), now_ns)

    def outdated(self, *, before_us: int) -> list[Packet]:
        """Take out waiting announcements of this node that were made before an instant [swarm us]."""
        return self._queue.take_older(before_us=before_us, rank=PRIORITY_CONTROL)

    def through_ns(self, packet: Packet, *, stays: Callable[[Packet], bool] = _all, now_ns: int) -> int | None:
        """The end of the flood of a packet just queued, or None; later packets have room of their own. Of the bulk
        before it only what `stays` counts, as when `put_off` moves the rest.
        """
        rank = self._rank(packet)
        waiting = self._queue.waiting(rank)
        if not waiting or waiting[-1] is not packet:
            return None
        end_ns, left = None, 0
        turns = self._upcoming(max(now_ns + self._lead_ns, self._free_ns))
        for ahead in waiting:
            if rank == PRIORITY_BULK and ahead is not packet and not stays(ahead):
                continue
            if end_ns is None or len(ahead.frame) > left:
                following = next(turns, None)
                if following is None:
                    return None
                turn, end_ns = following
                left = self._room(rank, turn)
            left -= len(ahead.frame)
        return end_ns

    def put_off(self, stays: Callable[[Packet], bool]) -> None:
        """Move bulk behind all other packets, later ones included, but for what stays."""
        self._queue.put_off(stays, rank=PRIORITY_BULK, behind=_LAST)

    def _room(self, rank: int, turn: OwnTurn) -> int:
        """The number of bytes of a turn that are reserved for a class."""
        if rank < PRIORITY_BULK:
            return self.reserved.get(rank, 0)
        return turn.frame_bytes - sum(self.reserved.values())

    def _rank(self, packet: Packet) -> int:
        """The rank at which a packet waits: without room for its class as bulk; a leader's announcements first."""
        header = packet.header
        if header.kind in (Kind.SCHEDULE, Kind.LINKS) and header.origin == self._node:
            return PRIORITY_CONTROL
        fits = len(packet.frame) <= self.reserved.get(header.priority, 0)
        return header.priority if fits else PRIORITY_BULK

    def _fill(self, size: int) -> list[Packet]:
        """The packets for one turn of `size` bytes, as shown at the top of this file; at least one."""
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
        """The node's turns from an instant on, by the timetable in force at each, with the end of each one's flood."""
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


class CallRelease(TurnRelease):
    """One queue of packets for neighbors, and the node's next call or spare turn."""

    def reserve(self, *, not_before_ns: int, now_ns: int) -> int | None:
        """Reserve the next call for an unqueued frame, such as a hello; returns its start, or None."""
        turn = self._turn(max(not_before_ns, self._free_ns))
        if turn is None:
            return None
        self._free_ns = turn.start_ns + 1
        self._arm(now_ns)
        return turn.start_ns

    def last_ns(self, *, now_ns: int) -> int | None:
        """The latest start of the turn that carries the packet queued last; None if it is unknown."""
        earliest_ns, start_ns = max(now_ns + self._lead_ns, self._free_ns), None
        for _ in range(len(self._queue)):
            turn = self._turn(earliest_ns)
            if turn is None:
                return None
            start_ns = turn.start_ns
            earliest_ns = start_ns + 1
        return start_ns

    @property
    def pending(self) -> TxQueue:
        return self._queue

    def on_copy(self, key: int, *, now_ns: int) -> None:
        """Another node has sent this packet (`duplicates.key_of`), so it is removed from the queue."""
        self._queue.remove(key)

    def _turn(self, earliest_ns: int) -> OwnTurn | None:
        for index, calls in enumerate(self._in_force):
            if calls.offsets:
                not_before_ns = max(earliest_ns, calls.valid_ns)
                start_ns = calls.turns.next_start_ns(calls.offsets, not_before_ns=not_before_ns)
                if index + 1 == len(self._in_force) or start_ns < self._in_force[index + 1].valid_ns:
                    return OwnTurn(start_ns, calls.frame_bytes)
        return None
