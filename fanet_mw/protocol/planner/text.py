"""A plan in lines for people. Every figure has its unit; what is not proven says so."""

from collections.abc import Iterator, Sequence
from typing import Final

from fanet_mw.protocol.delay import Bounded, Outcome, Refused
from fanet_mw.protocol.planner.feasibility import ClassPlan, Plan
from fanet_mw.protocol.planner.head import ClusterPlan
from fanet_mw.units import MS, S

_SHOWN: Final = 12
"""Heads listed, the fullest first."""


def describe(found: Plan | Refused) -> str:
    """The plan as text, without a final newline."""
    return f"cannot be planned: {found.reason}" if isinstance(found, Refused) else "\n".join(_lines(found))


def _lines(found: Plan) -> Iterator[str]:
    design = found.design
    yield (
        f"{'feasible' if found.feasible else 'not feasible'}: {design.clusters} clusters, flooding period "
        f"{design.period_ns / S:g} s, slots {design.slots.replace('_', ' ')}, relays {design.relays}"
    )
    yield from (f"  problem: {problem}" for problem in found.problems)
    yield from _classes(found.classes)
    yield "  head  members  hops  slot ms  flood ms  every ms  packets/period  used %  queue"
    fullest = sorted(found.clusters, key=lambda c: (-c.utilization, c.head))
    yield from (_cluster(cluster) for cluster in fullest[:_SHOWN])
    if len(fullest) > _SHOWN:
        yield f"  and {len(fullest) - _SHOWN} heads with no fuller slots"
    bottleneck = found.bottleneck
    if bottleneck is not None and bottleneck.usable_ns:
        yield f"  bottleneck: the slot of head {bottleneck.head}, {100 * bottleneck.utilization:.0f} % used"
    if isinstance(found.access, Bounded):
        yield f"  way to the head: {_say(found.access)}"
    yield f"  equations (1)-(4) say {_say(found.paper)}"
    if found.change is not None:
        yield f"  cheapest change: {'; '.join(found.change.keys)}"
        yield from (f"  {line}" for line in _classes(found.change.classes))
    elif not found.feasible:
        yield "  no change within the search makes it feasible"
    yield from (f"  note: {note}" for note in found.notes)


def _classes(classes: Sequence[ClassPlan]) -> Iterator[str]:
    for c in classes:
        line = f"  {c.name}, {c.sources} sources: {_say(c.bound)}"
        yield line if isinstance(c.from_head, Refused) else f"{line}; from the head on {_say(c.from_head)}"


def _cluster(c: ClusterPlan) -> str:
    queue = "-" if c.backlog is None else str(c.backlog)
    used = f"{100 * c.utilization:.0f}" if c.usable_ns else "-"
    return (
        f"  {c.head:4}  {c.members:7}  {c.hops:4}  {c.slot_ns / MS:7.1f}  {c.flood.duration_ns / MS:8.1f}  "
        f"{c.flood.spacing_ns / MS:8.1f}  {c.packets:14.1f}  {used:>6}  {queue:>5}"
    )


def _say(outcome: Outcome) -> str:
    if isinstance(outcome, Bounded):
        return f"at most {outcome.delay_ns / S:.3f} s"
    return f"no bound ({outcome.reason})"
