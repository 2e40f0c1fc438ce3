"""Counts the incidents of a run: contacts, losses of separation, and entries into no-fly areas."""

from fanet_mw.scenario import Scenario
from sim.world.arrays import Rows
from sim.world.incidents.no_fly_entries import NoFlyEntries
from sim.world.incidents.separation import Separation


class Incidents:
    """The incidents of one run."""

    def __init__(self, scenario: Scenario, starts: Rows) -> None:
        """Raises ConfigError if a UAV would start in a no-fly area."""
        self.collisions = 0
        self.no_fly = NoFlyEntries(scenario.world.no_fly_m, starts)
        self.separation = Separation(scenario.mission.collision_distance_m)
