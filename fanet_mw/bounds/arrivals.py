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

from fanet_mw.bounds.slot import SlotServer
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

    def delayed(self, *, least_ns: int, most_ns: int) -> "Periodic":
        """The flow behind something that delays each packet by between least and most: its jitter grows."""
        return Periodic(self.interval_ns, self.jitter_ns + most_ns - least_ns)


def token_bucket(*, burst: int, interval_ns: int) -> Periodic:
    """At most `burst` packets at once and one per interval in the long run: the staircase floor(burst + t/interval)."""
    if burst < 1:
        raise LocalProtocolError(f"burst = {burst} must be >= 1 packet")
    return Periodic(interval_ns, (burst - 1) * interval_ns)


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


class Limited(NamedTuple):
    """The output of the slot `through`, fed by `source`, each packet then delayed by up to `jitter_ns` more.

    A slot lets at most k frames out per period whatever burst went in, so the lesser of both curves holds.
    """

    source: Arrivals
    through: SlotServer
    jitter_ns: int = 0

    @property
    def rate(self) -> Fraction:
        return min(self.source.rate, Fraction(self.through.frames, self.through.period_ns))

    @property
    def burst(self) -> Fraction:
        slot_rate = Fraction(self.through.frames, self.through.period_ns)
        if self.source.rate <= slot_rate:
            return self.source.burst
        return self.slot_burst

    @property
    def slot_burst(self) -> Fraction:
        """The largest n - rate * span(n) of the slot alone; it repeats every k, except that span(1) is 0."""
        server = self.through
        rate = Fraction(server.frames, server.period_ns)
        return max(
            n - rate * (server.least_span_ns(n) - self.jitter_ns if n > 1 else -self.jitter_ns)
            for n in range(1, 3 * server.frames + 1)
        )

    def spans(self) -> Iterator[int]:
        for n, span_ns in enumerate(self.source.spans(), start=1):
            yield max(span_ns, self.through.least_span_ns(n) - self.jitter_ns)

    def repeat(self) -> tuple[int, int] | None:
        return None
