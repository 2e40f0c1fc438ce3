"""Arrival curves, represented by least spans: for n = 1, 2, ..., `spans()` yields the shortest time in which n packets
can arrive.

A span is the pseudo-inverse of an arrival curve (Le Boudec & Thiran, Network Calculus, ch. 1): span(n) <= t if and only
if a closed window of length t can hold n packets. Spans are exact for whole packets, where affine curves round up, and
they are integer nanoseconds. span(1) = 0, and spans never decrease. The spans of a sum of curves are those of all
curves, merged; each span of the minimum of several curves is the greatest of theirs.

`rate` [packets/ns] and `burst` [packets] give the token bucket around a curve: span(n) >= (n - burst) / rate.
"""

import heapq
from collections.abc import Iterator
from fractions import Fraction
from itertools import count
from math import lcm
from typing import NamedTuple, Protocol

from fanet_mw.errors import LocalProtocolError


class Bounded(NamedTuple):
    """No packet waits longer than this, under the assumptions of the function that returned it."""

    delay_ns: int


class Refused(NamedTuple):
    """No bound exists, or none can be given; the reason names the quantity, its value and the limit it exceeds."""

    reason: str


DelayBound = Bounded | Refused


class Arrivals(Protocol):
    """An arrival curve: the traffic that can arrive at a queue."""

    @property
    def rate(self) -> Fraction:
        """The number of packets per nanosecond in the long run."""
        ...

    @property
    def burst(self) -> Fraction:
        """The greatest number of packets that can arrive in addition to the rate."""
        ...

    def spans(self) -> Iterator[int]:
        """The least spans [ns] of 1, 2, 3, ... packets, without an end."""
        ...

    def repeat(self) -> tuple[int, int] | None:
        """(onset, length) [ns]: after the onset the spans repeat with this length. None if that is not known."""
        ...


class Periodic(NamedTuple):
    """One packet per interval, each late by at most `jitter_ns`, so in bursts of up to 1 + jitter / interval."""

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
    """The sum of several sources that feed one queue, with any phases between them."""

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
