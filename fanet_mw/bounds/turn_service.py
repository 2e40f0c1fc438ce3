"""The service of a head that transmits one packet in each of its turns, at given places of a repeating superframe.

    |   t   t     t          |   t   t     t          |      the turns of this head; those of others are not shown

A packet that is announced less than `lead_ns` before a turn misses it. The worst instant is just too late for turn i:
then the n-th packet of a queue that never empties is completed at the end of the n-th turn after it:

    completion(n) = lead + max over i of start(i+n) - start(i) + airtime

Each turn can take one packet of any length, so no time is lost at the end of a turn, and no packet blocks another: an
urgent packet takes the next turn for which it can be announced.

Floods in a timetable (`done_ns`, `worst_ns`) begin in turns of their root, and last until all nodes have the packet. A
busy period is a time in which packets wait for these turns. It is longest if it begins just after a turn, and it ends
with a turn that carries fewer than k packets, the most that fit. Up to then the n-th turn carries those from number
(n - 1) k + 1 on. The first of these has waited longest: it was generated at least (n - 1) k intervals after the
beginning of the period, and all nodes have it

    done(n) = max over turns i of start(i + n) - start(i) + flood(i + n)

after that beginning. The bound is the maximum of done(n) - (n - 1) k intervals over all n of one superframe: after a
whole superframe the difference repeats or has become smaller. This is the method of Davis, Burns, Bril, Lukkien:
Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised, Real-Time Systems 35, 2007. It
holds while the swarm stays as it was when the timetable was made, no frame is lost, and nothing of higher priority
takes the room of these packets in the turns. `fanet_mw/routing/clustered/timetable/own_bound.py` adds the time before
the turn and after the flood.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

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


def done_ns(starts_ns: Sequence[int], floods_ns: Sequence[int], *, period_ns: int) -> list[int]:
    """done(n) for n up to the number of turns, by each turn's start, ascending, and its flood's duration."""
    return list(_done_ns(tuple(starts_ns), tuple(floods_ns), period_ns))


@lru_cache(maxsize=1024)
def _done_ns(starts_ns: tuple[int, ...], floods_ns: tuple[int, ...], period_ns: int) -> tuple[int, ...]:
    """All nodes of a run ask for the same few, and each answer takes time by the square of the number of turns."""
    count = len(starts_ns)
    horizon = [later * period_ns + start for later in range(3) for start in starts_ns]
    return tuple(
        max(horizon[begin + n] - horizon[begin] + floods_ns[(begin + n) % count] for begin in range(count))
        for n in range(1, count + 1)
    )


def worst_ns(completions_ns: Sequence[int], *, period_ns: int, interval_ns: int, together: int = 1) -> int | None:
    """The bound from done(1), done(2) ... for packets `interval_ns` apart, `together` a turn; None if too many."""
    if together * len(completions_ns) * interval_ns < period_ns:
        return None
    return max(done - later * together * interval_ns for later, done in enumerate(completions_ns))
