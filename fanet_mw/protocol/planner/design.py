"""What the planner may change: clusters, flooding period, how slots are divided, how floods are relayed.

`contended`: relays contend by CSMA/CA after a jitter, as `clusters.relay` says. `scheduled`: each relay has its
sub-slot (`broadcast_schedule`). `timetable`: each head has single turns, whose floods never meet (`timetable`), behind
a contention window. Slots are `equal`, or `by_load`: each head gets what its cluster's packets need.
"""

import math
from typing import Literal, NamedTuple

from fanet_mw.scenario import Scenario
from fanet_mw.units import MS

Relays = Literal["contended", "scheduled", "timetable"]
Slots = Literal["equal", "by_load"]


class Design(NamedTuple):
    """One set of choices."""

    clusters: int
    period_ns: int
    guard_ns: int
    slots: Slots = "equal"
    relays: Relays = "contended"
    contention_ns: int = 0
    """`timetable` only: what of each period is left to members and hellos."""

    @classmethod
    def of(cls, scenario: Scenario, *, relays: Relays, contention_ns: int = 0) -> "Design":
        clusters = scenario.clusters
        return cls(clusters.count, clusters.period_ns, round(clusters.guard_ms * MS), "equal", relays, contention_ns)

    def distance(self, other: "Design") -> tuple[int, float]:
        """How far another design is: keys that differ, then the sum of their ratios in octaves."""
        ours, theirs = ((d.clusters, d.period_ns, d.slots, d.relays) for d in (self, other))
        differing = sum(1 for a, b in zip(ours, theirs, strict=True) if a != b)
        octaves = abs(math.log2(other.clusters / self.clusters)) + abs(math.log2(other.period_ns / self.period_ns))
        return differing, octaves
