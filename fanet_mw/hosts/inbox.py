"""What has come off the bus and waits for an actor: bounded, decoded in turns, every put counted once.

    samples = taken + malformed + oversized + overflowed + waiting

A put carries any number of messages, so what waits is bounded by puts and by bytes, and a turn by messages and by
bytes: a put of many messages is handed over in several turns. A put that finds its topic's share or the whole inbox
full is dropped: those before it are older and come first, and a node's next request shows the gap. A share is a
quarter, so that one that floods does not silence the others. The bound is what an actor takes in within some tens of
milliseconds: what waited longer would be too late for the air. Of a put whose bytes go wrong in the middle the
messages before have been handed over.

`offer` may be called on another thread than `deliver`: a deque's two ends are safe, and each counter has one writer.
Does not model: priorities among topics.
"""

from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from fanet_mw.bus import topics
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Message, Report, TraceBatch
from fanet_mw.errors import MalformedFrameError

BOUND: Final = 4096
"""Puts that may wait."""
BOUND_BYTES: Final = 16 << 20
"""Bytes that may wait."""
MOST_PUT_BYTES: Final = BOUND_BYTES // 4
"""Bytes of one put; twice what a world of 1,000 nodes says of its lines of sight."""
TURN: Final = 256
"""Messages handed over before others may run: a flood of input must not keep an actor from its time."""
TURN_BYTES: Final = 1 << 18
"""Bytes handed over in a turn, but for the last message."""
_MAX_TOPICS: Final = 8192
"""Topics that have a share of their own; what comes on still others shares one."""
_FOR_COLLECTORS: Final = topics.codes_of(TraceBatch, Report, LinkStats)
"""Messages that no actor hears: decoding their text would take an actor's time."""


class _Share:
    """What one topic has of an inbox: taken in, written by one thread, and gone, written by the other."""

    __slots__ = ("bytes_gone", "bytes_in", "puts_gone", "puts_in")

    def __init__(self) -> None:
        self.puts_in = self.bytes_in = self.puts_gone = self.bytes_gone = 0


class _Put(NamedTuple):
    """A put of which messages are still to be handed over."""

    topic: str
    payload: bytes
    share: _Share
    items: deque[topics.Item]


class Inbox:
    """A bounded queue of (topic, bytes) of one actor."""

    def __init__(self, *, bound: int = BOUND) -> None:
        self._waiting: deque[tuple[str, bytes, _Share]] = deque()
        self._open: _Put | None = None
        self._bound = bound
        self._share = max(1, bound // 4)
        self._shares: dict[str, _Share] = {}
        self._all = _Share()
        self.samples = 0
        self.oversized = 0
        self.inbox_full = 0
        self.share_full = 0
        self.taken = 0
        self.malformed = 0

    def offer(self, topic: str, payload: bytes) -> None:
        """Take in one put, or count it as oversized or overflowed."""
        self.samples += 1
        size = len(payload)
        if size > MOST_PUT_BYTES:
            self.oversized += 1
            return
        share, whole = self._share_of(topic), self._all
        if len(self._waiting) >= self._bound or whole.bytes_in - whole.bytes_gone + size > BOUND_BYTES:
            self.inbox_full += 1
            return
        held = share.bytes_in - share.bytes_gone
        if share.puts_in - share.puts_gone >= self._share or (held and held + size > BOUND_BYTES // 4):
            self.share_full += 1
            return
        share.puts_in += 1
        share.bytes_in += size
        whole.bytes_in += size
        self._waiting.append((topic, payload, share))

    def _share_of(self, topic: str) -> _Share:
        share = self._shares.get(topic)
        if share is None:
            key = topic if len(self._shares) < _MAX_TOPICS else ""
            share = self._shares.setdefault(key, _Share())
        return share

    def deliver(self, receive: Callable[[str, Message], object], *, most: int = TURN) -> bool:
        """Hand at most `most` messages to `receive`, in order; returns whether any may still wait."""
        left_bytes = TURN_BYTES
        while most > 0 and left_bytes > 0:
            if self._open is None:
                if not self._waiting:
                    return False
                self._open = self._opened(*self._waiting.popleft())
            most -= 1  # a put without messages counts as one: a turn ends whatever is offered meanwhile
            put = self._open
            if put is not None:
                left_bytes -= self._hand_over_one(put, receive)
        return self._open is not None or bool(self._waiting)

    def _hand_over_one(self, put: _Put, receive: Callable[[str, Message], object]) -> int:
        """The next message of the open put, which is closed with its last; returns its bytes."""
        item = put.items.popleft() if put.items else None
        if item is None:
            self._close(put)
            return 0
        try:
            message = topics.decode_item(put.payload, item)
        except MalformedFrameError:
            self._close(put, malformed=True)
        else:
            if not put.items:
                self._close(put)
            receive(put.topic, message)
        return item.end - item.start

    def _opened(self, topic: str, payload: bytes, share: _Share) -> _Put | None:
        """A put with its messages found, not decoded; None when it is malformed or not for an actor."""
        put = _Put(topic, payload, share, deque())
        try:
            put.items.extend(topics.items(payload))
        except MalformedFrameError:
            self._close(put, malformed=True)
            return None
        if any(item.code in _FOR_COLLECTORS for item in put.items):
            self._close(put, malformed=True)
            return None
        return put

    def _close(self, put: _Put, *, malformed: bool = False) -> None:
        """Count a put that is done with, and give back its room."""
        self._open = None
        if malformed:
            self.malformed += 1
        else:
            self.taken += 1
        put.share.puts_gone += 1
        put.share.bytes_gone += len(put.payload)
        self._all.bytes_gone += len(put.payload)

    @property
    def overflowed(self) -> int:
        """Puts dropped here, for either reason."""
        return self.inbox_full + self.share_full

    def figures(self) -> dict[str, int]:
        """Counters for a report."""
        return {
            "samples": self.samples,
            "taken": self.taken,
            "malformed": self.malformed,
            "oversized": self.oversized,
            "overflowed": self.overflowed,
            "share_full": self.share_full,
            "waiting": len(self._waiting) + (self._open is not None),
        }
