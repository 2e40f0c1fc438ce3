"""What motion does to a timetable: whether links that it counts on may end during the run."""

from collections.abc import Iterator, Mapping

from fanet_mw.graph.topology import Adjacency
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


def outdated(scenario: Scenario, at: Mapping[NodeId, Enu], adjacency: Adjacency) -> Iterator[str]:
    """A sentence about two UAVs that may fly out of range while a timetable counts on their link."""
    speed_m_s, range_m = scenario.mobility.speed_m_s, scenario.radio.range_m
    lengths = [at[a].minus(at[b]).norm() for a in adjacency for b in adjacency[a] if a < b]
    lengths = [length_m for length_m in lengths if length_m <= range_m]  # antennas of the ground reach farther
    if scenario.clusters.relay != "scheduled" or scenario.mobility.rigid or not lengths:
        return
    lasts_s = (range_m - max(lengths)) / (2 * speed_m_s)
    if lasts_s < scenario.duration_s:
        yield (
            f'UAVs move among each other (mobility.model = "{scenario.mobility.model}", {speed_m_s:g} m/s): two that '
            f"are linked over {max(lengths):.0f} m may be out of range after {lasts_s:.1f} s, and what a timetable "
            'promises ends with its links; bounds of routing.protocol = "rounds" count on no link that ends'
        )
