"""The nodes of a scenario where they stand, and what follows from positions alone: links and floods."""

from collections.abc import Mapping, Sequence

from fanet_mw.bounds.slot_service import PLANNED_ERROR_NS, slot_guard_ns
from fanet_mw.graph.topology import Adjacency, within_range
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId
from fanet_mw.wire.places import rounded
from sim.planner.flood_cost import FloodCost, flood_cost


class Site:
    """A scenario and the positions of its nodes. What depends on positions alone is computed once for all variants."""

    def __init__(
        self,
        scenario: Scenario,
        positions: Mapping[NodeId, Enu],
        adjacency: Adjacency | None = None,
        reported: Sequence[Mapping[NodeId, Enu]] = (),
        standing: Mapping[NodeId, Enu] | None = None,
    ) -> None:
        """`reported`: draws with errors of GPS; `standing`: where nodes are, if `positions` is such a draw."""
        self.scenario = scenario
        self.positions = {node: rounded(at) for node, at in positions.items()} if self.timetable else positions
        """The positions in whole metres if timetables are computed from them, as a leader announces them."""
        self._standing = standing or self.positions
        self.reported = reported
        self._exact = positions
        self.adjacency = (
            within_range(positions, range_m=scenario.radio.range_m, reaches=scenario.reaches)
            if adjacency is None
            else adjacency
        )
        self._floods: dict[tuple[NodeId, int], FloodCost] = {}

    def of(self, scenario: Scenario) -> "Site":
        """The same nodes with another scenario; the costs of floods are shared if relaying is the same."""
        other = Site(scenario, self._exact, self.adjacency, self.reported)
        if scenario.clusters.relay == self.scenario.clusters.relay and scenario.radio == self.scenario.radio:
            other._floods = self._floods
        return other

    def as_reported(self) -> list["Site"]:
        """The same nodes and links, with the positions of each draw: those from which nodes compute a timetable."""
        return [Site(self.scenario, positions, self.adjacency, standing=self._standing) for positions in self.reported]

    def within(self, distance_m: float) -> Adjacency:
        """The pairs of nodes that stand within this distance of each other, whatever positions they report."""
        return within_range(self._standing, range_m=distance_m, reaches=self.scenario.reaches)

    def varying_links(self) -> int:
        """The number of pairs of nodes that are near enough for a link of the timetable in some draws only."""
        link_m = self.scenario.clusters.link_m or self.scenario.radio.range_m
        found = [
            {
                (a, b)
                for a, near in within_range(positions, range_m=link_m, reaches=self.scenario.reaches).items()
                for b in near
                if a < b
            }
            for positions in self.reported
        ]
        return len(set().union(*found)) - len(found[0].intersection(*found)) if found else 0

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
