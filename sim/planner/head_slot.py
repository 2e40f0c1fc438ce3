"""The slot of one head: how much of it the floods need, and how long packets wait for it.

A single class is served in FIFO order with whole floods in the slot, and its bound is exact. Several classes are
counted in units of a quarter of the longest spacing. One longest spacing is subtracted from the slot for a flood that
no longer fits at its end, so the rest is work that the slot certainly does. More urgent classes go first, and a flood
that has begun is not interrupted.
"""

from collections.abc import Sequence
from itertools import chain
from math import ceil, inf
from typing import Final, NamedTuple

from fanet_mw import wire
from fanet_mw.bounds import (
    Bounded,
    DelayBound,
    Periodic,
    Refused,
    SlotServer,
    Total,
    backlog,
    delay_any_order,
    delay_fifo,
)
from sim.planner.flood_cost import FloodCost

_PARTS: Final = 4
"""The number of units in the longest spacing; with more, bounds are tighter and take longer to compute."""


class ClassLoad(NamedTuple):
    """The load of a class at one head: the number of sources, with one packet per interval each, and a flood's cost."""

    sources: int
    interval_ns: int
    flood: FloodCost
    priority: int = wire.PRIORITY_BULK
    """In a timetable, classes of one priority share the room that each turn has for this priority."""
    payload_bytes: int = 0

    @property
    def urgent(self) -> bool:
        return self.priority < wire.PRIORITY_BULK


class ClusterPlan(NamedTuple):
    """The slot of one head, of which `work_ns` per period are taken; floods may begin in `usable_ns` of it."""

    head: int
    members: int
    hops: int
    slot_ns: int
    usable_ns: int
    work_ns: int
    packets: float
    """The number of packets per flooding period."""
    flood: FloodCost
    """The cost of a flood of the longest packet."""
    delays: tuple[DelayBound, ...]
    """For each class, the time from the head's queue to the last node; 0 for a class without sources."""
    backlog: int | None

    @property
    def utilization(self) -> float:
        return self.work_ns / self.usable_ns if self.usable_ns > 0 else inf if self.work_ns else 0.0


def work_ns(shares: Sequence[ClassLoad], *, period_ns: int) -> int:
    """The part of a flooding period that all floods together take."""
    return ceil(sum(s.sources * s.flood.spacing_ns * period_ns / s.interval_ns for s in shares))


def slot_delays(
    shares: Sequence[ClassLoad], *, usable_ns: int, period_ns: int, jitter_ns: int
) -> tuple[list[DelayBound], int | None]:
    """For each class the longest time from the head's queue to the last node (0 without sources); and the backlog."""
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
    index: int, shares: Sequence[ClassLoad], units: Sequence[Sequence[Periodic]], server: SlotServer
) -> DelayBound:
    """Packets of the same or more urgent classes go first, and a less urgent one may have begun."""
    if not units[index]:
        return Bounded(0)
    before = [*chain.from_iterable(units[:index]), *units[index][1:]]
    lower = [len(units[i]) // s.sources for i, s in enumerate(shares) if i > index and s.sources]
    return delay_any_order(units[index][0], Total(tuple(before)), server, blocking=max(lower, default=0))


def _flooded(share: ClassLoad, queue: DelayBound) -> DelayBound:
    """The time from the head's queue to the last node: the wait for the slot, and the rest of the flood."""
    if isinstance(queue, Refused) or not share.sources:
        return queue
    return Bounded(queue.delay_ns + max(0, share.flood.duration_ns - share.flood.spacing_ns))
