"""The sending side of delivery: confirmed messages, which pieces each target lacks, and what to send next.

The wait for a receipt follows from earlier round trips (RFC 6298), and is doubled with each repetition; when its
lifetime is over, the application is told which nodes have not confirmed the message. A longer message than a packet is
cut into pieces of `stride` bytes and the rest; a MAVLink frame is never cut. The caller asks `full` first.
"""

import heapq
import itertools
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

from fanet_mw.delivery.retransmission_timeout import RetransmissionTimeout
from fanet_mw.units import BROADCAST, MS, US, NodeId
from fanet_mw.wire import application_message
from fanet_mw.wire.application_message import DELIVERED, MAVLINK_PORT, MOST_PIECES, Head, Receipt

FEW: Final = 2
"""Up to this number of targets, missing pieces are sent to each target; to more targets they are broadcast."""
MOST_NAMED: Final = 32
"""A message for all nodes that is broadcast again names at most this many nodes that still lack something."""
Targets = tuple[NodeId, ...] | None
"""The nodes that a message is for, one by one; None if it is for all."""


class Fragments(NamedTuple):
    """How a message is cut."""

    stride: int
    """The number of bytes of each piece but the last."""
    pieces: int

    @property
    def whole(self) -> int:
        """All pieces, as bits."""
        return (1 << self.pieces) - 1

    def part(self, data: bytes, piece: int) -> bytes:
        return data[piece * self.stride : (piece + 1) * self.stride]


class Fragmentation:
    """Cuts the messages of one node."""

    def __init__(self, others: int, room: Callable[[int], int]) -> None:
        """`others`: the number of other nodes. `room`: the room for inner frames in a packet of a priority [bytes]."""
        self._others = others
        self._room = room

    def most_bytes(self, *, port: int, targets: Targets, confirm: bool, priority: int) -> int:
        """The length of the longest message to these targets; below 0 if not even an empty one fits a packet."""
        room = self._room_beside_head(self._most_named(targets, confirm=confirm), priority)
        return room if port == MAVLINK_PORT or room < 0 else MOST_PIECES * application_message.room_for_data(room)

    def cut(self, data: bytes, *, port: int, targets: Targets, confirm: bool, priority: int) -> Fragments:
        """How to cut a message to these targets that is no longer than `most_bytes`."""
        if port == MAVLINK_PORT or not data:
            return Fragments(len(data), 1)
        room = self._room_beside_head(self._most_named(targets, confirm=confirm), priority)
        stride = min(len(data), application_message.room_for_data(room))
        return Fragments(stride, -(-len(data) // stride))

    def _most_named(self, targets: Targets, *, confirm: bool) -> int:
        """The greatest number of targets that any packet of a message names; a repetition to all nodes names some."""
        if targets is not None:
            return len(targets) if len(targets) > 1 else 0
        return min(self._others, MOST_NAMED) if confirm and self._others > FEW else 0

    def _room_beside_head(self, named: int, priority: int) -> int:
        """The room of a packet for data, and for what stands around it."""
        return self._room(priority) - application_message.HEAD_BYTES - application_message.targets_bytes(named)


MOST_BYTES: Final = 4 << 20
"""The greatest number of bytes that are kept, of all messages together."""
MOST_MESSAGES: Final = 4096
EXPIRED: Final = -1
"""The outcome of a message whose lifetime is over; all other outcomes are those of receipts."""
_MOST_DOUBLINGS: Final = 3
_MOST_FLOWS: Final = 1024


_MOST: Final = 32
"""The greatest number of pieces under way: ten kilobytes and more, but no burst that fills all queues."""
_LEAST: Final = 2


class SendWindow:
    """Which confirmed messages may be sent now, so that what is under way never fills all queues: the most urgent
    first, then the oldest (repetitions: those for which a target waits, then those repeated least). First transmissions
    and repetitions each have a window, halved at a repetition, one more when a target has all of a message (RFC 5681).
    """

    def __init__(self) -> None:
        self._pieces = _MOST
        self._waiting: tuple[list[tuple[int, bool, int, int]], ...] = ([], [])
        """Heaps of (priority, behind another, times sent, number) of the messages that were never sent, and of all
        others."""
        self._under_way = [0, 0]
        """The number of pieces of first transmissions and of repetitions for which receipts are awaited."""

    def wait(self, number: int, *, priority: int, rounds: int, behind: bool = False) -> None:
        """`behind`: all its targets wait for messages before it. One that waits already may be moved to the front."""
        heapq.heappush(self._waiting[rounds > 0], (priority, behind, rounds, number))

    def next(self) -> int | None:
        """Take out the message to send now, which may have been sent since; None if there is none, or no room."""
        for waiting, under_way in zip(self._waiting, self._under_way, strict=True):
            if waiting and under_way < self._pieces:
                return heapq.heappop(waiting)[-1]
        return None

    def sent(self, pieces: int, *, rounds: int) -> None:
        """A message of so many pieces was sent for the `rounds`-th time, and its receipts are awaited."""
        self._under_way[rounds > 1] += pieces

    def over(self, pieces: int, *, rounds: int) -> None:
        """Receipts of what was said by `sent` are awaited no longer."""
        self._under_way[rounds > 1] -= pieces

    def widen(self) -> None:
        """A target has all of a message."""
        self._pieces = min(_MOST, self._pieces + 1)

    def halve(self) -> None:
        """A message must be sent again."""
        self._pieces = max(_LEAST, self._pieces // 2)


class PieceToSend(NamedTuple):
    """A piece of a message that the node must send now."""

    number: int
    inner: bytes
    destination: NodeId
    priority: int
    first: bool


class Told(NamedTuple):
    """The outcome of a message: a target has confirmed or refused it, or its lifetime is over."""

    number: int
    outcome: int
    """The outcome, as in a receipt, or `EXPIRED`."""
    targets: tuple[NodeId, ...]
    """The targets with this outcome; if the message has expired, those that have not confirmed it."""
    last: bool
    """True if no further outcome of this message will follow."""


@dataclass
class _Flow:
    """The messages to the same nodes, on one port and of one priority."""

    number: int
    open: list[int] = field(default_factory=list)
    """The numbers of the messages that are neither confirmed by all targets nor given up, ascending."""


@dataclass
class _OutgoingMessage:
    """One confirmed message."""

    number: int
    flow: _Flow
    data: bytes
    port: int
    priority: int
    fragments: Fragments
    born_us: int
    lifetime_ms: int
    everyone: bool
    lacking: dict[NodeId, int]
    """For each target that has not confirmed the message, the pieces that it has, as bits."""
    again_ns: int = 0
    """The instant at which missing pieces are sent again; 0 while the message waits for room in the window."""
    sent_ns: int = 0
    """When its last packet was handed over, or last known to wait in this node."""
    last_seq: int | None = None
    """The sequence number of that packet."""
    rounds: int = 0
    unanswered: int = 0
    """The number of rounds since a target has last answered."""
    put_off: bool = False
    """True while it takes up no room in the window, because its targets have all of it and wait for one before it."""

    @property
    def until_ns(self) -> int:
        return self.born_us * US + self.lifetime_ms * MS

    @property
    def waits(self) -> bool:
        """True if it waits for room in the window to be sent again."""
        return self.rounds > 0 and not self.again_ns


class Sender:
    """The confirmed messages of one node that are under way."""

    def __init__(
        self,
        node: NodeId,
        everyone: Collection[int],
        *,
        room: Callable[[int], int],
        wait_ns: int,
        holds: Callable[[int], bool] = lambda _: False,
    ) -> None:
        """`room` for inner frames by priority; `wait_ns` for a first receipt; `holds`: a packet still waits here."""
        self._holds = holds
        self._node = node
        self._nodes = everyone
        self.fragmentation = Fragmentation(len(everyone) - (node in everyone), room)
        self._round_trips = RetransmissionTimeout(wait_ns)
        self._messages: dict[int, _OutgoingMessage] = {}
        self._flows: dict[tuple[tuple[NodeId, ...], int, int], _Flow] = {}
        self._next_flow = 0
        self._next_number = 1
        self._timers: list[tuple[int, int]] = []
        """A heap of (instant, number) at which a message is sent again or expires; outdated entries are skipped."""
        self._kept_bytes = 0
        self._window = SendWindow()
        self.told: list[Told] = []
        """The outcomes of messages; the caller empties this list."""
        self.repeated = 0

    def start(self, first_number: int) -> None:
        """Begin to number messages; a node that starts again must not use the numbers of earlier messages."""
        self._next_number = first_number
        self._next_flow = first_number

    # --- in -------------------------------------------------------------------------------------------------------

    @cached_property
    def _everyone(self) -> tuple[NodeId, ...]:
        """All other nodes; few nodes ever send a message that all must confirm."""
        return tuple(NodeId(other) for other in self._nodes if other != self._node)

    @property
    def full(self) -> bool:
        return self._kept_bytes >= MOST_BYTES or len(self._messages) >= MOST_MESSAGES

    def unconfirmed(
        self, data: bytes, *, port: int, destination: NodeId, targets: tuple[NodeId, ...], priority: int,
        born_us: int, lifetime_ms: int,
    ) -> tuple[int, Sequence[PieceToSend]]:  # fmt: skip
        """The number and all packets of a message that is not confirmed."""
        number = self.take_number()
        fragments = self.fragmentation.cut(data, port=port, targets=targets or None, confirm=False, priority=priority)
        stride, pieces = fragments
        packets = []
        for piece in range(pieces):
            head = Head(born_us, number, 0, len(data), lifetime_ms, port, 0, stride, piece, pieces, 0)
            part = fragments.part(data, piece)
            inner = application_message.encode_piece(head, part, node=self._node, targets=targets)
            packets.append(PieceToSend(number, inner, destination, priority, piece == 0))
        return number, packets

    def confirmed(
        self, data: bytes, *, port: int, targets: tuple[NodeId, ...] | None, priority: int, born_us: int,
        lifetime_ms: int,
    ) -> int:  # fmt: skip
        """Accept a message that its targets are to confirm (None: all other nodes); returns its number."""
        whom = self._everyone if targets is None else targets
        number = self.take_number()
        if not whom:  # the swarm has one node
            self.told.append(Told(number, DELIVERED, (), last=True))
            return number
        flow = self._flow(whom, port, priority)
        flow.open.append(number)
        fragments = self.fragmentation.cut(data, port=port, targets=targets, confirm=True, priority=priority)
        message = _OutgoingMessage(
            number, flow, data, port, priority, fragments, born_us, lifetime_ms, targets is None, dict.fromkeys(whom, 0)
        )
        self._kept_bytes += len(data)
        self._messages[number] = message
        self._window.wait(number, priority=priority, rounds=0)
        heapq.heappush(self._timers, (message.until_ns, number))
        return number

    def take_number(self) -> int:
        self._next_number += 1
        return self._next_number - 1

    def _flow(self, whom: tuple[NodeId, ...], port: int, priority: int) -> _Flow:
        key = whom, port, priority
        flow = self._flows.pop(key, None)
        if flow is None:
            if len(self._flows) >= _MOST_FLOWS:
                del self._flows[next(iter(self._flows))]
            flow = _Flow(self._next_flow & 0xFFFF)
            self._next_flow += 1
        self._flows[key] = flow  # flows are forgotten in the order of their last use
        return flow

    def receipt(self, origin: NodeId, receipt: Receipt, now_ns: int) -> None:
        """A target's receipt has arrived."""
        message = self._messages.get(receipt.number)
        if message is None or origin not in message.lacking:
            return
        if message.rounds == 1 and not message.lacking[origin]:  # of a repetition the copy that is answered is unknown
            self._round_trips.measured(origin, now_ns - message.sent_ns)
        if receipt.outcome == application_message.MISSING:
            message.lacking[origin] |= receipt.held & message.fragments.whole
            self._on_answer(message, origin, now_ns)
            return
        del message.lacking[origin]
        self._window.widen()
        self.told.append(Told(message.number, receipt.outcome, (origin,), last=not message.lacking))
        self._move_up(message, origin)
        if not message.lacking:
            self._close(message)

    def _on_answer(self, message: _OutgoingMessage, target: NodeId, now_ns: int) -> None:
        """A silent target answers: what it lacks is not sent later than a first repetition would be."""
        message.unanswered = 0
        soon_ns = max(now_ns, message.sent_ns + self._round_trips.wait_ns(target))
        if not message.put_off and soon_ns < message.again_ns:
            message.again_ns = soon_ns
            heapq.heappush(self._timers, (soon_ns, message.number))

    def _move_up(self, message: _OutgoingMessage, target: NodeId) -> None:
        """Let the next message of the flow that a target lacks go before those for which nobody waits."""
        later = (self._messages[number] for number in message.flow.open if number > message.number)
        after = next((one for one in later if target in one.lacking), None)
        if after is not None and after.waits and not self._before(after, target):
            self._window.wait(after.number, priority=after.priority, rounds=after.rounds)

    def _before(self, message: _OutgoingMessage, target: NodeId) -> bool:
        """True if this target lacks an earlier message of the flow."""
        earlier = itertools.takewhile(lambda number: number < message.number, message.flow.open)
        return any(target in self._messages[number].lacking for number in earlier)

    def _close(self, message: _OutgoingMessage) -> None:
        for target in message.lacking:
            self._move_up(message, target)
        del self._messages[message.number]
        message.flow.open.remove(message.number)
        self._kept_bytes -= len(message.data)
        if message.again_ns and not message.put_off:
            self._window.over(message.fragments.pieces, rounds=message.rounds)

    # --- out ------------------------------------------------------------------------------------------------------

    def due(self, now_ns: int) -> list[PieceToSend]:
        while self._timers and self._timers[0][0] <= now_ns:
            _, number = heapq.heappop(self._timers)
            message = self._messages.get(number)
            if message is None:
                continue
            if message.until_ns <= now_ns:
                self.told.append(Told(number, EXPIRED, tuple(message.lacking), last=True))
                self._close(message)
            elif 0 < message.again_ns <= now_ns and message.last_seq is not None and self._holds(message.last_seq):
                self._await_receipts(message, now_ns)
            elif 0 < message.again_ns <= now_ns:
                self._send_again(message, now_ns)
        packets: list[PieceToSend] = []
        while (ready := self._window.next()) is not None:
            message = self._messages.get(ready)
            if message is not None and not message.again_ns:
                packets += self._round(message, now_ns)
        return packets

    def _send_again(self, message: _OutgoingMessage, now_ns: int) -> None:
        """Let a message wait for room in the window; put it off if that would bring its targets nothing."""
        if not message.put_off:
            self._window.over(message.fragments.pieces, rounds=message.rounds)
        behind = [self._before(message, target) for target in message.lacking]
        held = all(pieces == message.fragments.whole for pieces in message.lacking.values())
        message.put_off = held and all(behind)
        if message.put_off:
            self._be_patient(message, now_ns)
            return
        message.again_ns = 0
        self._window.halve()
        self._window.wait(message.number, priority=message.priority, rounds=message.rounds, behind=all(behind))

    def _round(self, message: _OutgoingMessage, now_ns: int) -> list[PieceToSend]:
        """All pieces the first time, later those lacked; a silent target, or one with all, gets the last one again."""
        whole, last = message.fragments.whole, 1 << (message.fragments.pieces - 1)
        unknown = last if message.rounds else whole
        wanted = {target: (whole & ~held or last) if held else unknown for target, held in message.lacking.items()}
        alone, together = self._divided(wanted)
        packets: list[PieceToSend] = []
        for target, bits in alone.items():
            packets += self._packets(message, bits, target, (), (target,))
        if together:
            all_lack = len(wanted) == len(self._everyone)
            named = () if all_lack or (message.everyone and len(wanted) > MOST_NAMED) else tuple(wanted)
            packets += self._packets(message, together, BROADCAST, named, tuple(wanted))
        if message.rounds:
            self.repeated += len(packets)
        else:
            packets[0] = packets[0]._replace(first=True)
        message.rounds += 1
        message.unanswered += 1
        message.last_seq = None
        self._window.sent(message.fragments.pieces, rounds=message.rounds)
        self._await_receipts(message, now_ns)
        return packets

    @staticmethod
    def _divided(wanted: Mapping[NodeId, int]) -> tuple[dict[NodeId, int], int]:
        """The pieces that few targets want, which go to each of them alone, and the pieces that go to all together."""
        counts = Counter(piece for bits in wanted.values() for piece in range(bits.bit_length()) if bits >> piece & 1)
        together = sum(1 << piece for piece, count in counts.items() if count > FEW)
        return {target: rest for target, bits in wanted.items() if (rest := bits & ~together)}, together

    def handed_over(self, number: int, seq: int) -> None:
        """The node has given this sequence number to the latest packet of a message."""
        message = self._messages.get(number)
        if message is not None:
            message.last_seq = seq

    def _await_receipts(self, message: _OutgoingMessage, now_ns: int) -> None:
        message.sent_ns = now_ns
        self._be_patient(message, now_ns)

    def _be_patient(self, message: _OutgoingMessage, now_ns: int) -> None:
        message.again_ns = now_ns + self._patience_ns(message)
        heapq.heappush(self._timers, (message.again_ns, message.number))

    def _patience_ns(self, message: _OutgoingMessage) -> int:
        most_ns = max(map(self._round_trips.wait_ns, message.lacking), default=0)
        return most_ns << max(0, min(message.unanswered - 1, _MOST_DOUBLINGS))

    def _previous(self, message: _OutgoingMessage, readers: tuple[NodeId, ...]) -> int:
        """The youngest open message of its flow before this that a reader still lacks, or 0. A reader that has
        confirmed one may have started again since, and would wait for it in vain.
        """
        older = (number for number in reversed(message.flow.open) if number < message.number)
        return next((n for n in older if not self._messages[n].lacking.keys().isdisjoint(readers)), 0)

    def _packets(
        self, message: _OutgoingMessage, bits: int, destination: NodeId, named: tuple[NodeId, ...],
        readers: tuple[NodeId, ...],
    ) -> list[PieceToSend]:  # fmt: skip
        """The pieces of `bits`, in packets to the destination; `readers` are the targets that lack any of them."""
        previous = self._previous(message, readers)
        packets: list[PieceToSend] = []
        for piece in range(message.fragments.pieces):
            if not bits >> piece & 1:
                continue
            head = Head(
                message.born_us, message.number, previous, len(message.data), message.lifetime_ms, message.port,
                message.flow.number, message.fragments.stride, piece, message.fragments.pieces, 1,
            )  # fmt: skip
            part = message.fragments.part(message.data, piece)
            inner = application_message.encode_piece(head, part, node=self._node, targets=named)
            packets.append(PieceToSend(message.number, inner, destination, message.priority, first=False))
        return packets

    def next_wake_ns(self) -> int | None:
        """The instant at which something must be sent again, or expires."""
        timers = self._timers
        while timers:
            t_ns, number = timers[0]
            message = self._messages.get(number)
            if message is not None and t_ns in (message.until_ns, message.again_ns):
                return t_ns
            heapq.heappop(timers)
        return None
