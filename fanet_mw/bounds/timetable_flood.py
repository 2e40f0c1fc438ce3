"""The delay bound of floods in a timetable: the packets of one node, which has some turns of each superframe to itself.

    |   t   t     t          |   t   t     t          |      the turns in which floods of this node begin (its roots)
        |~~~~~~~~~| flood                                    from such a turn until all nodes have its packets

A busy period is a time in which packets wait. It is longest if it begins just after a turn, and lasts until a turn
carries fewer than k packets, the most that fit. Up to then the n-th turn carries the packets from number (n - 1) k + 1
on. The first of these has waited longest: it was generated at least (n - 1) k intervals after the beginning of the
period, and all nodes have it

    done(n) = max over turns i of start(i + n) - start(i) + flood(i + n)

after that beginning. The bound is the maximum of done(n) - (n - 1) k intervals over all n of one superframe: after a
whole superframe the difference repeats or has become smaller. This is the method of Davis, Burns, Bril, Lukkien:
Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised, Real-Time Systems 35, 2007.

The bound holds while the swarm stays as it was when the timetable was made, no frame is lost, and nothing of higher
priority takes the room of these packets in the turns. `fanet_mw/routing/clustered/timetable/own_bound.py` adds the time
before the turn and after the flood.
"""

from collections.abc import Sequence
from functools import lru_cache


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
