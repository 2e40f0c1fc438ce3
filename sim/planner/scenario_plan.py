"""What `plan` returns for a scenario: what its clusters and traffic classes are promised, or why it is not feasible."""

from typing import NamedTuple

from fanet_mw.bounds import Bounded, DelayBound
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, S
from sim.planner.demand import ClassPlan
from sim.planner.goodput_bound import Goodput
from sim.planner.head_slot import ClusterPlan
from sim.planner.timetable_plan import TimetablePlan


class ScenarioPlan(NamedTuple):
    """The plan of a whole scenario, with its problems; feasible if it has none."""

    scenario: Scenario
    clusters: tuple[ClusterPlan, ...]
    classes: tuple[ClassPlan, ...]
    access: DelayBound
    paper: DelayBound
    """The estimate of the paper's equations (1)-(4) for the cluster with the greatest load, for comparison only."""
    superframe: TimetablePlan | None
    """The timetable; None if relays are not scheduled."""
    cut_off: tuple[NodeId, ...]
    """The nodes that floods from the leader's part of the swarm do not reach."""
    goodput: Goodput | None
    """The goodput that no protocol can exceed; None if traffic is not for all nodes, or if the swarm is separated."""
    deadline_ns: int | None
    problems: tuple[str, ...]
    """The reasons why the scenario is not feasible; empty if it is."""
    notes: tuple[str, ...]
    """The assumptions of the bounds, and what they do not include."""
    draws: int = 0
    """The number of draws of reported positions, besides the true ones, for which the bounds hold as well."""
    varying: int = 0
    """The number of pairs of nodes that a timetable links in some of these draws only."""

    @property
    def feasible(self) -> bool:
        return not self.problems

    @property
    def proven(self) -> bool:
        """True if the bounds hold; False if some are estimates of contention, or if repairs may reach into turns."""
        repaired = self.superframe is not None and self.scenario.repair_ns > 0
        return isinstance(self.access, Bounded) and all(c.flood.proven for c in self.clusters) and not repaired

    @property
    def confidence(self) -> float:
        """Another draw of GPS positions exceeds the greatest bound of n with a probability of 1 / (n + 1)."""
        return self.draws / (self.draws + 1) if self.draws else 1.0

    @property
    def carried_per_second(self) -> float | None:
        """Packets per second that can be carried: by the capacity, else what fills the fullest slot; None: unknown."""
        application = next((c for c in self.classes if c.name == "application"), None)
        if application is None or not application.sources:
            return None
        if self.superframe is not None:
            least_ns = self.superframe.least_interval_ns
            return None if least_ns is None else application.sources * S / least_ns
        used = self.bottleneck.utilization if self.bottleneck else 0.0
        return application.sources * S / application.interval_ns / used if used else None

    @property
    def bottleneck(self) -> ClusterPlan | None:
        return max(self.clusters, key=lambda c: (c.utilization, -c.head), default=None)
