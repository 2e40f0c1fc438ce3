"""The nodes of a scenario where they stand, and what follows from positions alone: links, floods, claimed slots."""

from collections.abc import Mapping

from fanet_mw.bounds.guard_time import PLANNED_ERROR_NS, slot_guard_ns
from fanet_mw.graph.topology import Adjacency, within_range
from fanet_mw.planner.claimed_turns import Claimants
from fanet_mw.planner.flood_cost import FloodCost, flood_cost
from fanet_mw.routing.clustered.claimed.claiming import geometry
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


class Site:
    """A scenario and the positions of its nodes. What depends on positions alone is computed once for all variants."""

    def __init__(self, scenario: Scenario, positions: Mapping[NodeId, Enu], adjacency: Adjacency | None = None) -> None:
        self.scenario = scenario
        self.positions = positions
        self.adjacency = within_range(positions, range_m=scenario.radio.range_m) if adjacency is None else adjacency
        self._floods: dict[tuple[NodeId, int], FloodCost] = {}
        self._claimants: dict[object, Claimants] = {}

    def of(self, scenario: Scenario) -> "Site":
        """The same nodes with another scenario; the costs of floods are shared if the rules of
        relaying are the same.
        """
        other = Site(scenario, self.positions, self.adjacency)
        if scenario.clusters.relay == self.scenario.clusters.relay and scenario.radio == self.scenario.radio:
            other._floods = self._floods
        other._claimants = self._claimants
        return other

    def claimants(self) -> Claimants:
        """The slots and relays of claimed slots, which follow from the positions and the geometry of turns."""
        scenario = self.scenario
        key = geometry(scenario), scenario.clusters.slots, scenario.radio
        if key not in self._claimants:
            self._claimants[key] = Claimants(scenario, self.adjacency)
        return self._claimants[key]

    @property
    def timetable(self) -> bool:
        return self.scenario.clusters.relay == "scheduled"

    @property
    def guard_ns(self) -> int:
        clock = self.scenario.clock
        alone_ns = clock.unsynchronized_error_ns(self.scenario.duration_ns)
        error_ns = alone_ns if clock.sync == "none" else PLANNED_ERROR_NS
        return slot_guard_ns(self.scenario, clock_error_ns=error_ns)

    def flood(self, head: NodeId, payload_bytes: int) -> FloodCost:
        key = head, payload_bytes
        if key not in self._floods:
            self._floods[key] = flood_cost(self.scenario, self.adjacency, head, payload_bytes=payload_bytes)
        return self._floods[key]
