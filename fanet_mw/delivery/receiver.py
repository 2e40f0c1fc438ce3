"""The receiving side of delivery: it puts pieces together, hands each message over once, and answers with receipts.

A confirmed message waits for the one before it in its flow, even if nobody listens to that one. The memory for
incomplete and waiting messages is bounded, per sender and in all; what does not fit gets no receipt, and is sent again.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Final, NamedTuple

from fanet_mw.delivery.retransmission_timeout import RetransmissionTimeout
from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import MS, US, NodeId, S, earliest
from fanet_mw.wire.application_message import DELIVERED, GIVEN_UP, MISSING, NO_LISTENER, Head, Piece, Receipt

MOST_BYTES: Final = 4 << 20
"""The greatest number of bytes of pieces that are kept, of all senders together."""
MOST_BYTES_EACH: Final = 1 << 20
"""The greatest number of bytes of pieces that are kept of one sender."""
MOST_MESSAGES: Final = 4096
"""The greatest number of messages, of all senders together, that are incomplete or wait for one before them."""
MOST_MESSAGES_EACH: Final = 512
"""The greatest number of messages of one sender that are incomplete or wait for one before them."""
RECEIPT_NS: Final = 20 * MS
"""A receipt waits this long for other receipts to the same node, and at random up to `_SPREAD_NS` longer, because nodes
that have received the same broadcast must not all answer at the same instant."""
_SPREAD_NS: Final = 80 * MS
_FIRST_GAP_NS: Final = 400 * MS
"""The gap between the pieces of a message that is taken to be usual until measured: what is missing is told when a gap
is longer than gaps usually are."""
_MOST_PAUSE_NS: Final = 5 * S
_MOST_DONE: Final = 8192
"""The number of messages that are remembered as handed over."""
_MOST_FLOWS: Final = 4096


class Whole(NamedTuple):
    """A complete message to hand over."""

    origin: NodeId
    head: Head
    data: bytes
    frame: bytes
    """The packet that brought its last piece."""


@dataclass
class _Incoming:
    """A message that is incomplete, or that waits for one before it."""

    head: Head
    until_ns: int
    wanted: bool = True
    """False for a message to which nobody listens: it is passed over when its turn in its flow has come."""
    pieces: dict[int, bytes] = field(default_factory=dict)
    frame: bytes = b""
    came_ns: int | None = None
    """When its last new piece came; None after a receipt has gone. A piece that comes twice leaves it as it is."""

    @property
    def held(self) -> int:
        return sum(1 << piece for piece in self.pieces)

    @property
    def size(self) -> int:
        return sum(map(len, self.pieces.values()))

    @property
    def whole(self) -> bool:
        return not self.wanted or len(self.pieces) == self.head.pieces


class _Owed(NamedTuple):
    """A receipt that is to be sent."""

    receipt: Receipt
    priority: int
    due_ns: int


class Receiver:
    """The messages from other nodes' applications to one node."""

    def __init__(self, node: NodeId, listens: Callable[[Piece], bool], *, random: Random) -> None:
        """`listens` tells from one piece whether any application of this node listens to its message."""
        self._node = node
        self._listens = listens
        self._random = random
        self._gaps = RetransmissionTimeout(_MOST_PAUSE_NS)
        """The gaps between the pieces of a message, by sender."""
        self._incoming: dict[tuple[NodeId, int], _Incoming] = {}
        self._bytes: dict[NodeId, int] = {}
        self._counts: dict[NodeId, int] = {}
        self._done: dict[tuple[NodeId, int], int] = {}
        """The last receipt of each message whose sender may not have received it."""
        self._last: dict[tuple[NodeId, int], int] = {}
        """The number of the last message that was handed over, by flow."""
        self._receipts: dict[NodeId, dict[int, _Owed]] = {}
        """The receipts by the node to which they go, and by the number of their message."""
        self._receipts_ns: int | None = None
        """The instant at which one of them is due, or sooner."""
        self._sweep_ns: int | None = None
        self.arrived: list[Whole] = []
        """The messages to hand over, in order; the caller empties this list."""
        self.not_taken = 0
        self.expired = 0

    @property
    def kept_bytes(self) -> int:
        return sum(self._bytes.values())

    @property
    def owes_receipts(self) -> bool:
        return self._receipts_ns is not None

    def hear(self, origin: NodeId, piece: Piece, frame: bytes, *, priority: int, now_ns: int) -> None:
        """A piece has arrived; raises MalformedFrameError if it contradicts another piece of its message."""
        head = piece.head
        if piece.targets is not None and self._node not in piece.targets:
            return
        name = origin, head.number
        outcome = self._done.get(name)
        followers: list[int] = []
        if outcome is None:
            outcome = self._take(name, piece, frame, now_ns, followers)
        if head.confirm:
            self._confirm(name, outcome, priority, now_ns)
            for number in followers:
                self._confirm((origin, number), self._done[origin, number], priority, now_ns)

    def _take(self, name: tuple[NodeId, int], piece: Piece, frame: bytes, now_ns: int, followers: list[int]) -> int:
        """Keep a new piece; returns its receipt's result. Waiting messages handed over by it go to `followers`."""
        head, (origin, number) = piece.head, name
        until_ns = min(head.born_us * US, now_ns) + head.lifetime_ms * MS
        late = head.confirm and number <= self._last.get((origin, head.flow), 0)
        if until_ns <= now_ns or late:
            return GIVEN_UP
        if not self._listens(piece):
            return self._pass_over(name, head, until_ns, followers)
        message = self._incoming.get(name)
        if message is None:
            if not self._has_room(origin):
                self.not_taken += 1
                return MISSING
            message = _Incoming(head, until_ns)
        elif message.head._replace(piece=0, previous=0) != head._replace(piece=0, previous=0):
            raise MalformedFrameError(f"piece {head} of {message.head}")
        else:
            message.head = head  # the message before it may have been given up by the sender
        if head.piece not in message.pieces:
            kept, size = self._bytes.get(origin, 0), len(piece.data)
            if kept + size > MOST_BYTES_EACH or self.kept_bytes + size > MOST_BYTES:
                self.not_taken += 1
                return MISSING
            self._bytes[origin] = kept + size
            message.pieces[head.piece] = piece.data
            message.frame = frame
            if message.came_ns is None:
                self._gaps.expect(origin, _FIRST_GAP_NS)
            else:
                self._gaps.measured(origin, now_ns - message.came_ns)
            message.came_ns = now_ns
        if name not in self._incoming:
            self._keep(name, message)
        followers += self._hand_over(name, message)[1:]
        return self._done.get(name, MISSING)

    def _pass_over(self, name: tuple[NodeId, int], head: Head, until_ns: int, followers: list[int]) -> int:
        """Answer an unwanted message: those that wait for it wait for those before it. See `_take` on `followers`."""
        self._over(name, NO_LISTENER)
        if head.confirm and self._has_room(name[0]):
            message = _Incoming(head, until_ns, wanted=False)
            self._keep(name, message)
            followers += self._hand_over(name, message)[1:]
        return NO_LISTENER

    def _has_room(self, origin: NodeId) -> bool:
        """True if one more message of this sender may be incomplete or wait."""
        return len(self._incoming) < MOST_MESSAGES and self._counts.get(origin, 0) < MOST_MESSAGES_EACH

    def _keep(self, name: tuple[NodeId, int], message: _Incoming) -> None:
        self._incoming[name] = message
        self._counts[name[0]] = self._counts.get(name[0], 0) + 1
        self._sweep_ns = earliest(self._sweep_ns, message.until_ns)

    def _hand_over(self, name: tuple[NodeId, int], message: _Incoming) -> list[int]:
        """Hand over a complete message whose turn it is, and then those that waited for it; returns their numbers."""
        numbers: list[int] = []
        origin, flow = name[0], message.head.flow
        while message.whole and self._is_next(origin, message.head):
            if message.wanted:
                data = b"".join(message.pieces[piece] for piece in range(message.head.pieces))
                self.arrived.append(Whole(origin, message.head, data, message.frame))
            confirm = message.head.confirm
            self._forget(name, message)
            self._over(name, DELIVERED if message.wanted else NO_LISTENER)
            numbers.append(name[1])
            if not confirm:
                break
            self._last.pop((origin, flow), None)
            self._last[origin, flow] = name[1]
            while len(self._last) > _MOST_FLOWS:
                del self._last[next(iter(self._last))]
            following = [
                number
                for (other, number), m in self._incoming.items()
                if other == origin and m.head.confirm and m.head.flow == flow and m.head.previous <= name[1] < number
                if m.whole
            ]
            if not following:
                break
            name = origin, min(following)
            message = self._incoming[name]
        return numbers

    def _is_next(self, origin: NodeId, head: Head) -> bool:
        return not head.confirm or head.previous <= self._last.get((origin, head.flow), 0)

    def _over(self, name: tuple[NodeId, int], outcome: int) -> int:
        self._done[name] = outcome
        while len(self._done) > _MOST_DONE:
            del self._done[next(iter(self._done))]
        return outcome

    def _forget(self, name: tuple[NodeId, int], message: _Incoming) -> None:
        del self._incoming[name]
        for counts, less in ((self._bytes, message.size), (self._counts, 1)):
            left = counts.get(name[0], 0) - less
            if left:
                counts[name[0]] = left
            else:
                counts.pop(name[0], None)

    def _confirm(self, name: tuple[NodeId, int], outcome: int, priority: int, now_ns: int) -> None:
        origin, number = name
        message = self._incoming.get(name)
        held = message.held if message is not None else 0
        owed = self._receipts.setdefault(origin, {})
        before = owed.get(number)
        wait_ns = RECEIPT_NS
        if outcome == MISSING and message is not None and message.came_ns == now_ns and not message.whole:
            wait_ns = min(self._gaps.wait_ns(origin), _MOST_PAUSE_NS)  # an old piece asks for its receipt at once
        due_ns = now_ns + wait_ns + int(self._random.random() * _SPREAD_NS)
        if before is not None and before.receipt.outcome == outcome != MISSING:
            due_ns = min(due_ns, before.due_ns)
        owed[number] = _Owed(Receipt(held, number, outcome), priority, due_ns)
        self._receipts_ns = earliest(self._receipts_ns, due_ns)

    # --- out ------------------------------------------------------------------------------------------------------

    def due(self, now_ns: int) -> list[tuple[NodeId, list[Receipt], int]]:
        """The receipts to send now: for each node its receipts, and the most urgent priority among their messages."""
        if self._sweep_ns is not None and self._sweep_ns <= now_ns:
            self._sweep(now_ns)
        if self._receipts_ns is None or now_ns < self._receipts_ns:
            return []
        found = []
        for origin, owed in list(self._receipts.items()):
            if all(each.due_ns > now_ns for each in owed.values()):
                continue
            # what is known goes along; a message of which pieces are still coming waits for them
            ready = {
                number: each for number, each in owed.items() if each.due_ns <= now_ns or (origin, number) in self._done
            }
            for number in ready:
                del owed[number]
                if (message := self._incoming.get((origin, number))) is not None:
                    message.came_ns = None  # the sender begins anew, at its own time
            if not owed:
                del self._receipts[origin]
            latest = [self._latest(origin, each.receipt) for each in ready.values()]
            found.append((origin, latest, min(each.priority for each in ready.values())))
        self._receipts_ns = min(
            (each.due_ns for owed in self._receipts.values() for each in owed.values()), default=None
        )
        return found

    def _latest(self, origin: NodeId, receipt: Receipt) -> Receipt:
        outcome = self._done.get((origin, receipt.number))
        return receipt if outcome is None else Receipt(receipt.held, receipt.number, outcome)

    def _sweep(self, now_ns: int) -> None:
        for name, message in list(self._incoming.items()):
            if message.until_ns <= now_ns:
                self._forget(name, message)
                self.expired += message.wanted
        self._sweep_ns = min((message.until_ns for message in self._incoming.values()), default=None)

    def next_wake_ns(self) -> int | None:
        receipts_ns, sweep_ns = self._receipts_ns, self._sweep_ns
        return sweep_ns if receipts_ns is None or (sweep_ns is not None and sweep_ns < receipts_ns) else receipts_ns
