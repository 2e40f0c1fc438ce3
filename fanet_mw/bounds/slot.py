"""One slot per period that sends whole frames in FIFO order: the service that it guarantees, and the exact bound.

|<------------- P ------------->|
|   S   |                       |   S   |      a frame of airtime C starts only if it also ends within the slot
 C C C x                                       k = floor(S/C) frames fit; the rest x of the slot stays empty

The worst instant to arrive is just after the last start that fits, S - C into the slot. From there the n-th frame of
a queue that never empties is completed within

    completion(n) = (P - S + C) + floor((n-1)/k) P + ((n-1) mod k + 1) C

Arriving earlier, with room for j frames, costs the first j only their airtime and postpones none. Frames shorter than
C start no later than if all had airtime C, so the largest airtime bounds a mix. Not modeled: contention within the
slot, loss, clock error (subtract the guard time from S).
"""

from fractions import Fraction
from typing import NamedTuple, Protocol

from fanet_mw.bounds.delay_bound import Bounded, DelayBound, Refused
from fanet_mw.errors import LocalProtocolError


class Server(Protocol):
    """What the bounds need to know of a head's service: how fast its queue empties in the worst case."""

    @property
    def frames(self) -> int:
        """The number of frames per period."""
        ...

    @property
    def period_ns(self) -> int: ...

    @property
    def latency_ns(self) -> Fraction:
        """T of the rate-latency curve below the service: completion(n) <= T + n period / frames."""
        ...

    def check(self) -> None:
        """Raise LocalProtocolError when the geometry is impossible."""
        ...

    def completion_ns(self, n: int) -> int:
        """The longest time from the beginning of a busy period until `n` frames are completed."""
        ...

    def served(self, window_ns: int) -> int:
        """The number of frames that are certainly completed after `window_ns` of a busy period."""
        ...


class SlotServer(NamedTuple):
    """The service of one slot per period: C, S and P as above."""

    airtime_ns: int
    slot_ns: int
    period_ns: int

    def check(self) -> None:
        """Raise LocalProtocolError unless 0 < C and 0 < S <= P."""
        if self.airtime_ns <= 0 or not 0 < self.slot_ns <= self.period_ns:
            raise LocalProtocolError(
                f"airtime_ns = {self.airtime_ns} must be > 0 and "
                f"slot_ns = {self.slot_ns} in (0, period_ns = {self.period_ns}]"
            )

    @property
    def frames(self) -> int:
        """k, the number of whole frames that fit one slot."""
        return self.slot_ns // self.airtime_ns

    @property
    def latency_ns(self) -> Fraction:
        """The first frame of a slot decides the latency: since P >= k C, the other frames need less."""
        return self.completion_ns(1) - Fraction(self.period_ns, self.frames)

    def completion_ns(self, n: int) -> int:
        """The longest time from the beginning of a busy period until `n` frames are completed."""
        turns, rest = divmod(n - 1, self.frames)
        return self.period_ns - self.slot_ns + self.airtime_ns * (rest + 2) + turns * self.period_ns

    def served(self, window_ns: int) -> int:
        """The service curve: the frames that are certainly completed after `window_ns` of a busy period."""
        left_ns = window_ns - (self.period_ns - self.slot_ns + self.airtime_ns)
        if left_ns < self.airtime_ns:
            return 0
        turns, rest_ns = divmod(left_ns, self.period_ns)
        return turns * self.frames + min(self.frames, rest_ns // self.airtime_ns)

    def least_span_ns(self, n: int) -> int:
        """The least time from the end of one frame to the end of the (n-1)-th after it: how bursty the output is.

        Up to k frames follow each other directly. More frames need several slots: the last frames of one slot, the
        first of another, and whole slots in between.
        """
        slots = -(-n // self.frames)
        if slots == 1:
            return (n - 1) * self.airtime_ns
        outer = n - (slots - 2) * self.frames
        return (slots - 1) * self.period_ns - self.slot_ns + (outer - 1) * self.airtime_ns


def single_slot_bound(server: SlotServer, *, interval_ns: int) -> DelayBound:
    """The worst delay, from arrival to end of airtime, of packets that arrive every `interval_ns` = p in any phase.

    It is the maximum over q of completion(q) - (q-1) p, for all q of the busy period (Davis et al. 2007, "Controller
    Area Network (CAN) schedulability analysis: refuted, revisited and revised"). Stable iff k p >= P; then q and q + k
    differ by P - k p <= 0, so q = 1..k hold the maximum; and p >= P/k >= C makes the terms fall from q = 1 on. What
    remains is P - S + 2 C for every p. It is a supremum: arrivals 1 ns after the last start stay 1 ns below it.
    """
    server.check()
    if interval_ns <= 0:
        raise LocalProtocolError(f"interval_ns = {interval_ns} must be > 0")
    if not server.frames:
        return Refused(f"airtime {server.airtime_ns} ns > slot {server.slot_ns} ns: no frame ever fits")
    if server.frames * interval_ns < server.period_ns:
        return Refused(
            f"unstable: {server.frames} frames fit a slot every {server.period_ns} ns, "
            f"{server.period_ns / interval_ns:.3f} arrive (one every {interval_ns} ns)"
        )
    return Bounded(server.completion_ns(1))
