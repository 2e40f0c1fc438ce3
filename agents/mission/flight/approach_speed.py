"""The speed at which a UAV flies to a survivor."""

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId


def approach_speed_m_s(scenario: Scenario, node: NodeId) -> float:
    """The speed of one UAV: uniform between the bounds of the scenario, drawn by its seed."""
    least, most = scenario.mission.approach_speeds_m_s
    return least if least == most else stream(scenario.seed, "approach speed", node).uniform(least, most)
