"""Plans one scenario with given positions: its traffic classes first, then whether they are feasible.

plan -> demand.py                  the traffic classes
-> feasibility.py             if heads have slots, or turns of a timetable
-> claimed_feasibility.py     if nodes claim slots
"""

from collections.abc import Mapping, Sequence

from fanet_mw.bounds import Refused
from fanet_mw.graph.topology import Adjacency
from fanet_mw.planner.claimed_feasibility import evaluate_claims
from fanet_mw.planner.demand import demands
from fanet_mw.planner.feasibility import evaluate, heads_of
from fanet_mw.planner.scenario_plan import ScenarioPlan
from fanet_mw.planner.site import Site
from fanet_mw.routing.clustered.timetable.turn_allocation import least_interval_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


def plan(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    adjacency: Adjacency | None = None,
    sources: Sequence[NodeId] | None = None,
    deadline_ns: int | None = None,
) -> ScenarioPlan | Refused:
    """Judge the scenario as it stands; refused if its traffic cannot be planned at all.

    `adjacency` says which nodes hear each other, by default those within `radio.range_m`; a timetable uses only
    positions. `sources` are the nodes that send the application's traffic. Each class has to meet the deadline.
    """
    return judge(Site(scenario, positions, adjacency), sources, deadline_ns)


def judge(
    site: Site, sources: Sequence[NodeId] | None, deadline_ns: int | None, *, quick: bool = False
) -> ScenarioPlan | Refused:
    """Judge a scenario at its site; with `quick`, a timetable that carries too little is not computed (`evaluate`)."""
    classes = demands(site.scenario, sources)
    if isinstance(classes, Refused):
        return classes
    if site.scenario.clusters.relay == "claimed":
        return evaluate_claims(site, classes, deadline_ns=deadline_ns)
    return evaluate(site, classes, deadline_ns=deadline_ns, quick=quick)


def with_capacity(found: ScenarioPlan, positions: Mapping[NodeId, Enu]) -> ScenarioPlan:
    """The same plan with the least traffic interval at which its slots carry everything; this takes a second."""
    if found.superframe is None or not found.superframe.used or found.cut_off:
        return found
    least = least_interval_ns(found.scenario, tuple(sorted(positions.items())), heads_of(found.scenario, positions))
    return found._replace(superframe=found.superframe._replace(least_interval_ns=least))
