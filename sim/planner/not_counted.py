"""What a scenario has and a plan does not count, and which statements of the plan then hold under which condition.

A plan is for nodes that stay where they start, and for frames that arrive wherever links are taken to be. A bound that
a node states in flight is another one: it follows from the timetable that is in force then.
"""

from collections.abc import Iterator, Mapping

from fanet_mw.graph.topology import Adjacency
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId

_STATED = "the bounds that nodes state for their packets in flight hold for every delivery all the same"


def not_counted(scenario: Scenario) -> Iterator[str]:
    """A sentence for each; nothing for nodes at rest whose frames arrive."""
    bounded = scenario.clusters.relay == "scheduled" and not scenario.measures_links
    begins = [fault.at_s for fault in scenario.faults if fault.kind != "restore" and fault.at_s < scenario.duration_s]
    if begins:
        yield f"[[faults]]: what is said here holds until {min(begins):g} s; then packets may miss nodes" + (
            f", and a timetable without nodes that fall silent has other bounds; {_STATED}" if bounded else ""
        )
    if scenario.mobility.model != "static":
        yield f'movement (mobility.model = "{scenario.mobility.model}"): what is said here is for where nodes start' + (
            f"; the timetable follows them, and its bounds change; {_STATED}" if bounded else ""
        )
    held = "; bounds are for packets that arrive" if bounded else ""
    if scenario.world.has_obstacles:
        yield f"obstacles: a link that they block loses its frames, and packets may miss nodes{held}"
    losses = [f"{key} = {value}" for key, value in _losses(scenario)]
    if losses and not scenario.measures_links:
        yield f"losses by {' and '.join(losses)}: packets may miss nodes{held}"


def _losses(scenario: Scenario) -> Iterator[tuple[str, str]]:
    radio = scenario.radio
    if radio.channel != "range" and scenario.clusters.relay != "scheduled":
        yield "radio.channel", f'"{radio.channel}"'  # for a timetable the plan states them as a probability
    if radio.fading != "none":
        yield "radio.fading", f'"{radio.fading}"'
    if radio.shadowing_db:
        yield "radio.shadowing_db", f"{radio.shadowing_db:g}"


def outdated(scenario: Scenario, at: Mapping[NodeId, Enu], adjacency: Adjacency) -> Iterator[str]:
    """A sentence about two UAVs that may fly out of range while a timetable counts on their link."""
    range_m, speed_m_s = scenario.radio.range_m, scenario.mobility.speed_m_s
    why = f'mobility.model = "{scenario.mobility.model}"'
    if scenario.mobility.rigid:
        speed_m_s = scenario.mission.approach_speeds_m_s[1]
        why = f"to survivors, mission.survivors = {scenario.mission.survivors}"
    lengths = [at[a].minus(at[b]).norm() for a in adjacency for b in adjacency[a] if a < b]
    lengths = [length_m for length_m in lengths if length_m <= range_m]  # antennas of the ground reach farther
    if scenario.clusters.relay != "scheduled" or scenario.rigid or not lengths:
        return
    lasts_s = (range_m - max(lengths)) / (2 * speed_m_s)
    if lasts_s < scenario.duration_s:
        yield (
            f"UAVs move among each other ({why}, {speed_m_s:g} m/s): two that are linked over {max(lengths):.0f} m may "
            f"be out of range after {lasts_s:.1f} s, and what a timetable "
            'promises ends with its links; bounds of routing.protocol = "rounds" count on no link that ends'
        )
