"""Jitter of what several nodes send on the same event (RFC 5148, 5.2): they must not all begin at one instant.

All receivers of GPS give their fixes at the same instants, so that both UAVs of a conflict foresee it together; all who
hear a packet may answer it; and applications wake at round times. On an idle channel frames that begin at one instant
collide with certainty, and so do their repetitions.
"""

from random import Random


class EventJitter:
    """By how much later the own packets of one node start: U(0, most), the same for all of one instant."""

    def __init__(self, random: Random, *, most_ns: int) -> None:
        self._random = random
        self._most_ns = most_ns
        self._drawn = -1, 0
        """The last instant, and its jitter."""

    def ns(self, now_ns: int) -> int:
        if self._drawn[0] != now_ns:
            self._drawn = now_ns, int(self._random.random() * self._most_ns)
        return self._drawn[1]
