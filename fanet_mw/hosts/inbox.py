"""What has come off the bus and waits for an actor: bounded, decoded in turns, every put counted once.

    samples = taken + malformed + overflowed + waiting

A put that finds its topic's share or the whole inbox full is dropped: those before it are older and come first, and a
node's next request shows the gap. A share is a quarter, so that one that floods does not silence the others. The bound
is what an actor takes in within some tens of milliseconds: what waited longer would be too late for the air.

`offer` may be called on another thread than `deliver`: a deque's two ends are safe, and each counter has one writer.
Does not model: priorities among topics.
"""

from collections import deque
from collections.abc import Callable
from typing import Final

from fanet_mw import topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.messages import Message

BOUND: Final = 4096
"""Puts that may wait."""
TURN: Final = 256
"""Puts handed over before others may run: a flood of input must not keep an actor from its time."""
_MAX_TOPICS: Final = 8192
"""Topics that have a share of their own; what comes on still others shares one."""


class Inbox:
    """A bounded queue of (topic, bytes) of one actor."""

    def __init__(self, *, bound: int = BOUND) -> None:
        self._waiting: deque[tuple[str, bytes]] = deque()
        self._bound = bound
        self._share = max(1, bound // 4)
        self._offered: dict[str, int] = {}
        self._gone: dict[str, int] = {}
        """Puts taken out so far by topic; what `_offered` has more than that waits."""
        self.samples = 0
        self.inbox_full = 0
        self.share_full = 0
        self.taken = 0
        self.malformed = 0

    def offer(self, topic: str, payload: bytes) -> None:
        """Take in one put, or count it as overflowed."""
        self.samples += 1
        offered = self._offered
        key = topic if topic in offered or len(offered) < _MAX_TOPICS else ""
        before = offered.get(key, 0)
        if len(self._waiting) >= self._bound:
            self.inbox_full += 1
            return
        if before - self._gone.get(key, 0) >= self._share:
            self.share_full += 1
            return
        offered[key] = before + 1
        self._waiting.append((topic, payload))

    def deliver(self, receive: Callable[[str, Message], object], *, most: int = TURN) -> bool:
        """Hand the messages of at most `most` puts to `receive`, in order; returns whether puts still wait."""
        waiting, gone = self._waiting, self._gone
        for _ in range(most):
            if not waiting:
                return False
            topic, payload = waiting.popleft()
            key = topic if topic in self._offered else ""
            gone[key] = gone.get(key, 0) + 1
            try:
                messages = topics.decode(payload)
            except MalformedFrameError:
                self.malformed += 1
                continue
            self.taken += 1
            for message in messages:
                receive(topic, message)
        return bool(waiting)

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
            "overflowed": self.overflowed,
            "share_full": self.share_full,
            "waiting": len(self._waiting),
        }
