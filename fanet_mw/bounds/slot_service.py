"""One slot per period that sends whole frames in FIFO order: the service that it guarantees.

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
