"""Plans one scenario with given positions: its traffic classes first, then whether they are feasible.

plan -> demand.py                  the traffic classes
-> feasibility.py             if heads have slots, or turns of a timetable
-> claimed_feasibility.py     if nodes claim slots
"""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.bounds import Refused
from fanet_mw.graph.topology import Adjacency
from fanet_mw.planner.claimed_feasibility import evaluate_claims
from fanet_mw.planner.demand import demands
from fanet_mw.planner.feasibility import evaluate, heads_of
from fanet_mw.planner.reported_positions import worst_of
from fanet_mw.planner.scenario_plan import ScenarioPlan
from fanet_mw.planner.site import Site
from fanet_mw.routing.clustered.timetable.turn_allocation import least_interval_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId

_TURNS: Final = 50_000
"""The number of turns of all timetables that are computed for reported positions; a thousand take a tenth of a
second."""
_LEAST_DRAWS: Final = 3


def plan(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    adjacency: Adjacency | None = None,
    reported: Sequence[Mapping[NodeId, Enu]] = (),
    sources: Sequence[NodeId] | None = None,
    deadline_ns: int | None = None,
) -> ScenarioPlan | Refused:
    """Judge the scenario as it stands; refused if its traffic cannot be planned at all.

    `adjacency` says which nodes hear each other, by default those within `radio.range_m`; a timetable uses only
    positions. Nodes take these from GPS, so a timetable is judged for each draw of `reported` positions as well: the
    bounds are the greatest of all, and what fails with one is a problem. `sources` are the nodes that send the
    application's traffic. Each class has to meet the deadline.
    """
    return judge(Site(scenario, positions, adjacency, reported), sources, deadline_ns)


def judge(
    site: Site, sources: Sequence[NodeId] | None, deadline_ns: int | None, *, quick: bool = False
) -> ScenarioPlan | Refused:
    """Judge a scenario at its site; with `quick`, only for the exact positions, and a timetable that carries too little
    is not computed (`evaluate`).
    """
    classes = demands(site.scenario, sources)
    if isinstance(classes, Refused):
        return classes
    if site.scenario.clusters.relay == "claimed":
        return evaluate_claims(site, classes, deadline_ns=deadline_ns)
    found = evaluate(site, classes, deadline_ns=deadline_ns, quick=quick)
    if not site.timetable or quick or not found.feasible:
        return found
    drawn = [evaluate(other, classes, deadline_ns=deadline_ns) for other in site.as_reported()[: _draws(found)]]
    return worst_of(found, drawn, varying=site.varying_links()) if drawn else found


def _draws(found: ScenarioPlan) -> int:
    """The number of draws of reported positions to judge: as many as take some seconds, but not too few."""
    table = None if found.superframe is None else found.superframe.table
    return max(_LEAST_DRAWS, _TURNS // max(1, len(table.turns))) if table is not None else _LEAST_DRAWS


def with_capacity(found: ScenarioPlan, positions: Mapping[NodeId, Enu]) -> ScenarioPlan:
    """The same plan with the least traffic interval at which its slots carry everything; this takes a second."""
    if found.superframe is None or not found.superframe.used or found.cut_off:
        return found
    places = Site(found.scenario, positions).positions
    least = least_interval_ns(found.scenario, tuple(sorted(places.items())), heads_of(found.scenario, places))
    return found._replace(superframe=found.superframe._replace(least_interval_ns=least))
