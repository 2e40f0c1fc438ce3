"""The service of a head that transmits one packet in each of its turns, at given places of a repeating superframe.

    |   t   t     t          |   t   t     t          |      the turns of this head; those of others are not shown

A packet that is announced less than `lead_ns` before a turn misses it. The worst instant is just too late for turn i:
then the n-th packet of a queue that never empties is completed at the end of the n-th turn after it:

    completion(n) = lead + max over i of start(i+n) - start(i) + airtime

Each turn can take one packet of any length, so no time is lost at the end of a turn, and no packet blocks another: an
urgent packet takes the next turn for which it can be announced.
"""

from dataclasses import dataclass, field
from fractions import Fraction

from fanet_mw.errors import LocalProtocolError


@dataclass(frozen=True)
class TurnServer:
    """The service of one head's turns; it takes the place of `SlotServer` in all bounds of a queue."""

    airtime_ns: int
    period_ns: int
    starts_ns: tuple[int, ...]
    """The starts of the turns, ascending within one period."""
    lead_ns: int = 0
    _apart_ns: tuple[int, ...] = field(init=False, repr=False, compare=False)
    """The greatest distance of two turns with n - 1 turns between them, at index n, for n below `frames`."""

    def __post_init__(self) -> None:
        k, starts = self.frames, self.starts_ns
        longer = (*starts, *(start + self.period_ns for start in starts))
        apart = tuple(max((longer[i + n] - starts[i] for i in range(k)), default=0) for n in range(k))
        object.__setattr__(self, "_apart_ns", apart)

    def check(self) -> None:
        """Raise LocalProtocolError unless the turns ascend within the period, at least one airtime apart."""
        following = (*self.starts_ns[1:], *(start + self.period_ns for start in self.starts_ns[:1]))
        apart = all(b - a >= self.airtime_ns for a, b in zip(self.starts_ns, following, strict=True))
        within = all(0 <= start < self.period_ns for start in self.starts_ns)
        if self.airtime_ns <= 0 or self.lead_ns < 0 or not (apart and within):
            raise LocalProtocolError(
                f"starts_ns = {self.starts_ns} must ascend in [0, period_ns = {self.period_ns}), "
                f"airtime_ns = {self.airtime_ns} > 0 apart, lead_ns = {self.lead_ns} >= 0"
            )

    @property
    def frames(self) -> int:
        return len(self.starts_ns)

    @property
    def latency_ns(self) -> Fraction:
        """T of the rate-latency curve: completion(n) <= T + n P/k."""
        share = Fraction(self.period_ns, self.frames)
        return max(self.completion_ns(n) - n * share for n in range(1, self.frames + 1))

    def completion_ns(self, n: int) -> int:
        periods, rest = divmod(n, self.frames)
        return self.lead_ns + periods * self.period_ns + self._apart_ns[rest] + self.airtime_ns

    def served(self, window_ns: int) -> int:
        n = max(0, (window_ns - self.lead_ns - self.airtime_ns) // self.period_ns) * self.frames
        while self.completion_ns(n + 1) <= window_ns:
            n += 1
        return n
