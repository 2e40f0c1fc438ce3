"""What has come off the bus and waits for an actor: bounded, decoded in turns, every put counted once.

    samples = taken + malformed + overflowed + waiting

A put that finds the inbox full is dropped: those before it are older and come first, and a node's next request shows
the gap. `offer` may be called on another thread than `deliver`: a deque's two ends are safe, and each counter has one
writer. Does not model: priorities among topics.
"""

from collections import deque
from collections.abc import Callable
from typing import Final

from fanet_mw import topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.messages import Message

BOUND: Final = 16_384
"""Puts that may wait: some seconds of a busy swarm. What has waited that long is too late for the air anyway."""
TURN: Final = 256
"""Puts handed over before others may run: a flood of input must not keep an actor from its time."""


class Inbox:
    """A bounded queue of (topic, bytes) of one actor."""

    def __init__(self, *, bound: int = BOUND) -> None:
        self._waiting: deque[tuple[str, bytes]] = deque()
        self._bound = bound
        self.samples = 0
        self.overflowed = 0
        self.taken = 0
        self.malformed = 0

    def offer(self, topic: str, payload: bytes) -> None:
        """Take in one put, or count it as overflowed."""
        self.samples += 1
        if len(self._waiting) >= self._bound:
            self.overflowed += 1
        else:
            self._waiting.append((topic, payload))

    def deliver(self, receive: Callable[[str, Message], None], *, most: int = TURN) -> bool:
        """Hand the messages of at most `most` puts to `receive`, in order; returns whether puts still wait."""
        waiting = self._waiting
        for _ in range(most):
            if not waiting:
                return False
            topic, payload = waiting.popleft()
            try:
                messages = topics.decode(payload)
            except MalformedFrameError:
                self.malformed += 1
                continue
            self.taken += 1
            for message in messages:
                receive(topic, message)
        return bool(waiting)

    def figures(self) -> dict[str, int]:
        """Counters for a report."""
        return {
            "samples": self.samples,
            "malformed": self.malformed,
            "overflowed": self.overflowed,
            "waiting": len(self._waiting),
        }
