"""What of a search may change in flight: the scenario says how it begins, an operator how it goes on."""

from fanet_mw.scenario import Scenario
from fanet_mw.units import seconds_to_ns


class SearchLimits:
    """When one UAV leaves the search; its keys are those of `[mission]`."""

    def __init__(self, scenario: Scenario) -> None:
        mission = scenario.mission
        self.reserve = mission.reserve_charge
        self.lost_link_ns = seconds_to_ns(mission.lost_link_s)
        self.sweeps = mission.sweeps

    def change(self, key: str, value: float) -> None:
        match key:
            case "reserve_charge":
                self.reserve = value
            case "lost_link_s":
                self.lost_link_ns = seconds_to_ns(value)
            case "sweeps":
                self.sweeps = round(value)
            case _:
                raise AssertionError(f"mission.{key} does not change in flight")
