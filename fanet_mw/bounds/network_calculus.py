"""Delay and backlog of one head's queue: the horizontal and vertical deviation of its arrival and service curves.

A busy period begins with a packet that finds the queue empty. Its q-th packet is delayed by completion(q) - span(q) at
most (Le Boudec & Thiran, theorem 1.4.2, for staircases), and it ends with the first Q for which completion(Q) <=
span(Q+1); all q up to Q are examined (Davis et al. 2007). At a load of exactly one spans are examined until they
repeat; if that is not known, or takes too long, the result is the affine bound T + burst / R, which is looser but
sound.
"""

from fractions import Fraction
from itertools import islice
from math import ceil, lcm
from typing import Final

from fanet_mw.bounds.arrivals import Arrivals, Bounded, DelayBound, Periodic, Refused
from fanet_mw.bounds.slot_service import Server

_PACKETS_EXAMINED: Final = 100_000


def load(arrivals: Arrivals, server: Server) -> Fraction:
    """Packets that arrive in one period over those that its slot can hold; the queue is stable up to 1."""
    return arrivals.rate * server.period_ns / server.frames


def refusal(arrivals: Arrivals, server: Server) -> Refused | None:
    """The reason why there is no bound; None if there is one."""
    server.check()
    if not server.frames:
        return Refused(f"no frame ever fits {server}")
    if load(arrivals, server) > 1:
        return Refused(
            f"unstable: {server.frames} frames fit a slot every {server.period_ns / 1e6:g} ms, "
            f"{float(arrivals.rate * server.period_ns):.3f} arrive"
        )
    return None


def delay_fifo(arrivals: Arrivals, server: Server) -> DelayBound:
    """The worst delay [ns] of any packet of the aggregate, in FIFO order, from arrival to the end of its airtime."""
    refused = refusal(arrivals, server)
    if refused is not None:
        return refused
    examined = _busy_period(arrivals, server)
    if examined is None:
        return Bounded(_affine_ns(arrivals, server))
    return Bounded(max(server.completion_ns(q) - span_ns for q, span_ns in enumerate(examined, start=1)))


def backlog(arrivals: Arrivals, server: Server) -> int | Refused:
    """The greatest number of packets in the queue, including the one on the air."""
    refused = refusal(arrivals, server)
    if refused is not None:
        return refused
    examined = _busy_period(arrivals, server)
    if examined is None:
        return ceil(arrivals.burst + arrivals.rate * server.latency_ns)
    return max(q - server.served(span_ns) for q, span_ns in enumerate(examined, start=1))


def delay_any_order(flow: Periodic, cross: Arrivals, server: Server, *, blocking: int = 0) -> DelayBound:
    """The worst delay of `flow`'s packets when the head may send `cross` first (priorities: traffic as urgent or more).

    `blocking`: frames of the longest less urgent packet, which may just have begun. What the cross traffic leaves of
    the slot, a strict service curve, is one for the flow (Le Boudec & Thiran, theorem 6.2.1): the q-th packet is
    completed at the first w with w >= completion(q + cross(w)).
    """
    worst_ns = 0
    both = flow.rate + cross.rate
    server.check()
    if not server.frames or both * server.period_ns >= server.frames:
        return Refused(
            f"unstable or full: {server.frames} frames fit a slot every {server.period_ns / 1e6:g} ms, "
            f"{float(both * server.period_ns):.3f} arrive; any order needs less than a full slot"
        )
    before = _Counter(cross)
    for q, span_ns in enumerate(flow.spans(), start=1):
        w_ns = server.completion_ns(q + blocking)
        while w_ns < (through_ns := server.completion_ns(q + blocking + before.within(w_ns))):
            w_ns = through_ns
        worst_ns = max(worst_ns, w_ns - span_ns)
        if w_ns <= max(0, q * flow.interval_ns - flow.jitter_ns):
            return Bounded(worst_ns)
        if q + before.seen > _PACKETS_EXAMINED:
            break
    return Refused(f"the busy period is longer than {_PACKETS_EXAMINED} packets")


class _Counter:
    """Counts how many packets a window can hold, for windows of growing length."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._spans = arrivals.spans()
        self._next_ns = next(self._spans, None)
        self.seen = 0

    def within(self, window_ns: int) -> int:
        while self._next_ns is not None and self._next_ns <= window_ns:
            self.seen += 1
            self._next_ns = next(self._spans, None)
        return self.seen


def _busy_period(arrivals: Arrivals, server: Server) -> list[int] | None:
    """The spans of the longest busy period, or until they repeat; None if that is too long to examine."""
    horizon_ns = _horizon_ns(arrivals, server)
    if horizon_ns is None and load(arrivals, server) == 1:
        return None
    if not arrivals.rate:
        return [0]
    examined: list[int] = []
    for span_ns in islice(arrivals.spans(), _PACKETS_EXAMINED):
        if examined and server.completion_ns(len(examined)) <= span_ns:
            return examined
        examined.append(span_ns)
        if horizon_ns is not None and span_ns > horizon_ns:
            return examined
    return None


def _horizon_ns(arrivals: Arrivals, server: Server) -> int | None:
    """The span after which both completion and arrivals repeat, so that no greater delay can follow."""
    pattern = arrivals.repeat()
    if pattern is None:
        return None
    onset_ns, length_ns = pattern
    return onset_ns + 2 * lcm(length_ns, server.period_ns)


def _affine_ns(arrivals: Arrivals, server: Server) -> int:
    """The bound T + burst / R of a token bucket and a rate-latency server (Le Boudec & Thiran, 1.4.1)."""
    return ceil(server.latency_ns + arrivals.burst * Fraction(server.period_ns, server.frames))
