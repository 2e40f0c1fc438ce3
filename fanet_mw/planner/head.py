"""One head's slot: what of it the floods need, and how long packets wait for it.

One class is served first come first served, whole floods in the slot: exact. Several are counted in units of a
quarter of the longest spacing, and one longest spacing is taken off the slot for the flood that no longer fits: the
rest is work that a slot certainly does. The more urgent go first, and a flood that has begun is not taken back.
"""

from collections.abc import Sequence
from itertools import chain
from math import ceil, inf
from typing import Final, NamedTuple

from fanet_mw.bounds import Bounded, Outcome, Periodic, Refused, SlotServer, Total, backlog, delay_any_order, delay_fifo
from fanet_mw.planner.flood import FloodCost

_PARTS: Final = 4
"""Units per longest spacing: finer is tighter and slower."""


class Share(NamedTuple):
    """A class at one head: how many sources, one packet per interval each, and what a flood of it costs."""

    sources: int
    interval_ns: int
    flood: FloodCost
    urgent: bool = False
    """More urgent than bulk: under a timetable it has room of its own in each turn."""


class ClusterPlan(NamedTuple):
    """One head's slot. `usable_ns` is where floods may begin; `work_ns` is what they take of it per flooding period."""

    head: int
    members: int
    hops: int
    slot_ns: int
    usable_ns: int
    work_ns: int
    packets: float
    """Per flooding period."""
    flood: FloodCost
    """Of the longest packet."""
    delays: tuple[Outcome, ...]
    """Per class, from the head's queue to the last node; nothing waits where a class has no source."""
    backlog: int | None

    @property
    def utilization(self) -> float:
        return self.work_ns / self.usable_ns if self.usable_ns > 0 else inf if self.work_ns else 0.0


def work_ns(shares: Sequence[Share], *, period_ns: int) -> int:
    """How much of one flooding period the floods take."""
    return ceil(sum(s.sources * s.flood.spacing_ns * period_ns / s.interval_ns for s in shares))


def slot_delays(
    shares: Sequence[Share], *, usable_ns: int, period_ns: int, jitter_ns: int
) -> tuple[list[Outcome], int | None]:
    """Per class, most urgent first, the longest time from the head's queue to the last node; and the most waiting.

    A class without sources is bounded by 0. Packets arrive late by up to `jitter_ns`.
    """
    present = [s for s in shares if s.sources]
    if not present:
        return [Bounded(0) for _ in shares], None
    longest_ns = max(s.flood.spacing_ns for s in present)
    if len(present) == 1:
        unit_ns, slot_ns = longest_ns, usable_ns
    else:
        unit_ns, slot_ns = ceil(longest_ns / _PARTS), usable_ns - longest_ns
    if slot_ns < unit_ns:
        refused = Refused(f"{usable_ns / 1e6:.1f} ms of slot have no room for floods of {longest_ns / 1e6:.1f} ms")
        return [refused if s.sources else Bounded(0) for s in shares], None
    server = SlotServer(unit_ns, slot_ns, period_ns)
    units = [[Periodic(s.interval_ns, jitter_ns)] * (s.sources * ceil(s.flood.spacing_ns / unit_ns)) for s in shares]
    if len(present) == 1:
        delays = [_flooded(s, delay_fifo(Total(tuple(units[i])), server)) for i, s in enumerate(shares)]
    else:
        delays = [_flooded(s, _by_priority(i, shares, units, server)) for i, s in enumerate(shares)]
    waiting = backlog(Total(tuple(chain.from_iterable(units))), server)
    shortest = min(ceil(s.flood.spacing_ns / unit_ns) for s in present)
    return delays, None if isinstance(waiting, Refused) else ceil(waiting / shortest)


def _by_priority(
    index: int, shares: Sequence[Share], units: Sequence[Sequence[Periodic]], server: SlotServer
) -> Outcome:
    """All as urgent or more go before the packet's last unit, and one less urgent packet may have begun."""
    if not units[index]:
        return Bounded(0)
    before = [*chain.from_iterable(units[:index]), *units[index][1:]]
    lower = [len(units[i]) // s.sources for i, s in enumerate(shares) if i > index and s.sources]
    return delay_any_order(units[index][0], Total(tuple(before)), server, blocking=max(lower, default=0))


def _flooded(share: Share, queue: Outcome) -> Outcome:
    """From the head's queue to the last node: the slot, then the flood from its first spacing on."""
    if isinstance(queue, Refused) or not share.sources:
        return queue
    return Bounded(queue.delay_ns + max(0, share.flood.duration_ns - share.flood.spacing_ns))
