"""The greatest speed of a UAV in its mission, which differs from UAV to UAV (`mission.approach_speeds_m_s`)."""

from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId


def approach_speed_m_s(scenario: Scenario, node: NodeId) -> float:
    """The greatest speed of one UAV, drawn by the seed, uniformly between the bounds of the scenario."""
    least, most = scenario.mission.approach_speeds_m_s
    return least if least == most else stream(scenario.seed, "approach speed", node).uniform(least, most)
