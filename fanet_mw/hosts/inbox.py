"""The inbox of an actor: a bounded queue of puts from the bus, decoded in portions; each put is counted exactly once.

    samples = taken + malformed + oversized + overflowed + waiting

A put is dropped if the inbox, or the quota of its topic (a quarter, so that no sender shuts out others), is full. It
holds about what an actor handles in some tens of milliseconds; more would be too late for the air. `offer` and
`deliver` may run on different threads: the ends of a deque are safe, and each counter has one writer.
"""

from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Message, Report, TraceBatch
from fanet_mw.errors import MalformedFrameError

BOUND: Final = 4096
"""The greatest number of waiting puts."""
BOUND_BYTES: Final = 16 << 20
MOST_PUT_BYTES: Final = BOUND_BYTES // 4
"""The greatest length of a put: twice that of the lines of sight that a world of 1,000 nodes publishes."""
PORTION: Final = 256
"""The number of messages in one portion, after which timers may run, so that a flood of input cannot hold them up."""
PORTION_BYTES: Final = 1 << 18
"""The number of bytes in one portion, without its last message."""
_MAX_TOPICS: Final = 8192
"""The number of topics with a quota of their own; all further topics share one."""
_FOR_COLLECTORS: Final = codecs.codes_of(TraceBatch, Report, LinkStats)
"""The codes of messages that no actor receives; an actor should not spend time on decoding their text."""


class _Usage:
    """A topic's use of the inbox: bytes accepted, written by one thread, and bytes gone, written by the other."""

    __slots__ = ("bytes_gone", "bytes_in", "puts_gone", "puts_in")

    def __init__(self) -> None:
        self.puts_in = self.bytes_in = self.puts_gone = self.bytes_gone = 0


class _Put(NamedTuple):
    """A put of which some messages have yet to be handed over."""

    topic: str
    payload: bytes
    usage: _Usage
    items: deque[codecs.Item]


class Inbox:
    """The bounded queue of (topic, bytes) for one actor."""

    def __init__(self, *, bound: int = BOUND) -> None:
        self._waiting: deque[tuple[str, bytes, _Usage]] = deque()
        self._open: _Put | None = None
        self._bound = bound
        self._quota = max(1, bound // 4)
        self._usages: dict[str, _Usage] = {}
        self._all = _Usage()
        self.samples = 0
        self.oversized = 0
        self.inbox_full = 0
        self.share_full = 0
        self.taken = 0
        self.unread = 0
        """The number of receptions that came only after the end of the run."""
        self.malformed = 0

    def offer(self, topic: str, payload: bytes) -> None:
        """Accept one put, or count it as oversized or overflowed."""
        self.samples += 1
        size = len(payload)
        if size > MOST_PUT_BYTES:
            self.oversized += 1
            return
        usage, whole = self._usage_of(topic), self._all
        if len(self._waiting) >= self._bound or whole.bytes_in - whole.bytes_gone + size > BOUND_BYTES:
            self.inbox_full += 1
            return
        held = usage.bytes_in - usage.bytes_gone
        if usage.puts_in - usage.puts_gone >= self._quota or (held and held + size > BOUND_BYTES // 4):
            self.share_full += 1
            return
        usage.puts_in += 1
        usage.bytes_in += size
        whole.bytes_in += size
        self._waiting.append((topic, payload, usage))

    def _usage_of(self, topic: str) -> _Usage:
        usage = self._usages.get(topic)
        if usage is None:
            key = topic if len(self._usages) < _MAX_TOPICS else ""
            usage = self._usages.setdefault(key, _Usage())
        return usage

    def deliver(self, receive: Callable[[str, Message], object], *, most: int = PORTION) -> bool:
        """Pass at most `most` messages to `receive`, in order; returns True if more may be waiting."""
        left_bytes = PORTION_BYTES
        while most > 0 and left_bytes > 0:
            if self._open is None:
                if not self._waiting:
                    return False
                self._open = self._opened(*self._waiting.popleft())
            most -= 1  # a put without messages counts as one, so that a portion always ends
            put = self._open
            if put is not None:
                left_bytes -= self._hand_over_one(put, receive)
        return self.waiting

    def _hand_over_one(self, put: _Put, receive: Callable[[str, Message], object]) -> int:
        """Pass on the open put's next message, and close the put after its last one; returns the message's bytes."""
        item = put.items.popleft() if put.items else None
        if item is None:
            self._close(put)
            return 0
        try:
            message = codecs.decode_item(put.payload, item)
        except MalformedFrameError:
            self._close(put, malformed=True)
        else:
            if not put.items:
                self._close(put)
            receive(put.topic, message)
        return item.end - item.start

    def _opened(self, topic: str, payload: bytes, usage: _Usage) -> _Put | None:
        """Open a put: its messages are located but not decoded. None if it is malformed, or not meant for an actor."""
        try:
            items = codecs.items(payload)
        except MalformedFrameError:
            items = None
        put = _Put(topic, payload, usage, deque(items or ()))
        if items is None or not _FOR_COLLECTORS.isdisjoint([item.code for item in items]):
            self._close(put, malformed=True)
            return None
        return put

    def _close(self, put: _Put, *, malformed: bool = False) -> None:
        self._open = None
        if malformed:
            self.malformed += 1
        else:
            self.taken += 1
        put.usage.puts_gone += 1
        put.usage.bytes_gone += len(put.payload)
        self._all.bytes_gone += len(put.payload)

    @property
    def waiting(self) -> bool:
        """True if there is something to hand over."""
        return self._open is not None or bool(self._waiting)

    @property
    def overflowed(self) -> int:
        """The number of puts dropped because the inbox or their topic's quota was full."""
        return self.inbox_full + self.share_full

    def figures(self) -> dict[str, int]:
        return {
            "samples": self.samples,
            "taken": self.taken,
            "unread_receptions": self.unread,
            "malformed": self.malformed,
            "oversized": self.oversized,
            "overflowed": self.overflowed,
            "share_full": self.share_full,
            "waiting": len(self._waiting) + (self._open is not None),
        }
