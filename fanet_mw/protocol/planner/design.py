"""What the planner may change: clusters, flooding period, how slots are divided, how floods are relayed.

`contended`: heads own slots, relays contend by CSMA/CA (`clusters.relay` all, gossip, counter). `timetable`: roots and
relays have turns of their own behind a contention window (`clusters.relay = "scheduled"`). Slots are `equal`, as the
leader makes them, or `by_load`: each head gets what its cluster's packets need.
"""

import math
from typing import Literal, NamedTuple

from fanet_mw.protocol.guard import PLANNED_ERROR_NS, slot_guard_ns
from fanet_mw.scenario import Scenario

Relays = Literal["contended", "timetable"]
Slots = Literal["equal", "by_load"]


class Design(NamedTuple):
    """One set of choices."""

    clusters: int
    period_ns: int
    guard_ns: int
    slots: Slots = "equal"
    relays: Relays = "contended"

    @classmethod
    def of(cls, scenario: Scenario) -> "Design":
        """The scenario as it stands."""
        clusters = scenario.clusters
        relays: Relays = "timetable" if clusters.relay == "scheduled" else "contended"
        error_ns = PLANNED_ERROR_NS if scenario.clock.sync != "none" else 0
        return cls(
            clusters.count, clusters.period_ns, slot_guard_ns(scenario, clock_error_ns=error_ns), "equal", relays
        )

    def distance(self, other: "Design") -> tuple[int, float]:
        """How far another design is: keys that differ, then the sum of their ratios in octaves."""
        differing = sum(1 for a, b in zip(self, other, strict=True) if a != b)
        octaves = abs(math.log2(other.clusters / self.clusters)) + abs(math.log2(other.period_ns / self.period_ns))
        return differing, octaves
