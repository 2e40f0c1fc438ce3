"""Where the UAVs are, as far as the post on the ground knows, and which of them can best be spared."""

import math

from agents.mission.search_formation.formation_planner import pattern_of
from fanet_mw.scenario import Scenario
from fanet_mw.serial_number import newer
from fanet_mw.wire.search_plan import Search, SearchStatus

_REVISION_BITS = 16


class KnownUavs:
    """The latest status of each UAV, and the newest plan."""

    def __init__(self, scenario: Scenario) -> None:
        self._reach_m = scenario.radio.range_m
        self._statuses: dict[int, SearchStatus] = {}
        self._plan: Search | None = None

    def on_status(self, status: SearchStatus) -> None:
        """A UAV states where it is."""
        before = self._statuses.get(status.node)
        if before is None or status.t_us > before.t_us:
            self._statuses[status.node] = status

    def on_plan(self, plan: Search) -> None:
        """A plan was received."""
        if self._plan is None or newer(plan.revision, self._plan.revision, bits=_REVISION_BITS):
            self._plan = plan

    def nearest(self, east_m: float, north_m: float) -> int | None:
        """The nearest follower that takes part in the search, otherwise the nearest UAV that does; None without any."""
        followers: set[int] = set()
        if self._plan is not None:
            places = pattern_of(self._plan, reach_m=self._reach_m).followers
            followers = {self._plan.nodes[place] for place in places if place < len(self._plan.nodes)}
        found = [
            (node not in followers, math.hypot(at.position.east - east_m, at.position.north - north_m), node)
            for node, at in self._statuses.items()
            if at.charge > 0
        ]
        return min(found)[2] if found else None
