"""Arrival curves as least spans: `spans()` yields, for n = 1, 2, ..., the least time in which n packets can arrive.

A span is the pseudo-inverse of an arrival curve (Le Boudec & Thiran, Network Calculus, ch. 1): span(n) <= t iff a
closed window of length t can hold n packets. For whole packets it is exact where affine curves round up, and it stays
in integer nanoseconds. span(1) = 0, and spans never decrease. The sum of several curves merges their spans; the least
of several curves has the greatest of their spans.

`rate` [packets/ns] and `burst` [packets] give the token bucket around each curve: span(n) >= (n - burst) / rate.
"""

import heapq
from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from math import lcm
from typing import NamedTuple, Protocol

from fanet_mw.errors import LocalProtocolError


class Arrivals(Protocol):
    """An arrival curve: what can arrive at a queue."""

    @property
    def rate(self) -> Fraction:
        """Packets per nanosecond in the long run."""
        ...

    @property
    def burst(self) -> Fraction:
        """The most packets that can arrive beyond the rate."""
        ...

    def spans(self) -> Iterator[int]:
        """The least spans [ns] of 1, 2, 3, ... packets, without end."""
        ...

    def repeat(self) -> tuple[int, int] | None:
        """(onset, length) [ns]: beyond the onset the spans repeat with this length. None if that is not known."""
        ...


class Periodic(NamedTuple):
    """One packet per interval, each of them late by at most `jitter_ns`.

    Jitter beyond the interval is a burst: up to 1 + jitter / interval packets at once.
    """

    interval_ns: int
    jitter_ns: int = 0

    def check(self) -> None:
        """Raise LocalProtocolError unless interval > 0 and jitter >= 0."""
        if self.interval_ns <= 0 or self.jitter_ns < 0:
            raise LocalProtocolError(f"{self} must have interval_ns > 0 and jitter_ns >= 0")

    @property
    def rate(self) -> Fraction:
        return Fraction(1, self.interval_ns)

    @property
    def burst(self) -> Fraction:
        return 1 + Fraction(self.jitter_ns, self.interval_ns)

    def spans(self) -> Iterator[int]:
        for n in count():
            yield max(0, n * self.interval_ns - self.jitter_ns)

    def repeat(self) -> tuple[int, int]:
        return self.jitter_ns, self.interval_ns


class Total(NamedTuple):
    """The sum of several sources into one queue, in any phase to each other."""

    parts: tuple[Arrivals, ...]

    @property
    def rate(self) -> Fraction:
        return sum((part.rate for part in self.parts), Fraction(0))

    @property
    def burst(self) -> Fraction:
        return sum((part.burst for part in self.parts), Fraction(0))

    def spans(self) -> Iterator[int]:
        return heapq.merge(*(part.spans() for part in self.parts))

    def repeat(self) -> tuple[int, int] | None:
        found = [part.repeat() for part in self.parts]
        if None in found:
            return None
        known = [pattern for pattern in found if pattern is not None]
        return max((onset for onset, _ in known), default=0), lcm(*(length for _, length in known))
