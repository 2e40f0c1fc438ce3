"""Plans one scenario with given positions: its traffic classes first (`demand.py`), then `feasibility.py`."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from fanet_mw.bounds import Bounded, DelayBound, Refused
from fanet_mw.routing.clustered.timetable.turn_allocation import least_interval_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId
from sim.planner.demand import demands
from sim.planner.feasibility import evaluate, heads_of
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site

_TURNS: Final = 50_000
"""The turns of all timetables for reported positions; a thousand take a tenth of a second."""
_LEAST_DRAWS: Final = 3


def worst_of(exact: ScenarioPlan, drawn: Sequence[ScenarioPlan], *, varying: int) -> ScenarioPlan:
    """The plan for the exact positions, with the greatest bounds of all `drawn` plans, and with what fails in them. The
    greatest bound of n draws is exceeded by that of another one with a probability of 1 / (n + 1) (Hahn and Meeker,
    Statistical Intervals, 1991). `varying`: the pairs of nodes that are linked in some draws only.
    """
    classes = tuple(
        c._replace(
            bound=_greatest([c.bound, *(plan.classes[index].bound for plan in drawn)]),
            from_head=_greatest([c.from_head, *(plan.classes[index].from_head for plan in drawn)]),
        )
        for index, c in enumerate(exact.classes)
    )
    problems = exact.problems or tuple(_problems(drawn))
    notes = [
        f"nodes compute their timetable from positions that GPS gives (world.gps_sigma_m = "
        f"{exact.scenario.world.gps_sigma_m:g}): the bounds are the greatest of {len(drawn)} draws; in flight nodes "
        "state their own"
    ]
    if varying:
        pairs = "pair of nodes is" if varying == 1 else "pairs of nodes are"
        link_m = exact.scenario.clusters.link_m or exact.scenario.radio.range_m
        notes.append(
            f"{varying} {pairs} about {link_m:g} m apart, and linked as GPS errs: timetables change in flight, and a "
            "packet that waits for the next one has no bound (clusters.link_m)"
        )
    return exact._replace(
        classes=classes, problems=problems, notes=(*exact.notes, *notes), draws=len(drawn), varying=varying
    )


def _greatest(bounds: Sequence[DelayBound]) -> DelayBound:
    """The greatest of some bounds; the first refusal if one is refused."""
    refused = next((bound for bound in bounds if not isinstance(bound, Bounded)), None)
    return refused or max((bound for bound in bounds if isinstance(bound, Bounded)), key=lambda bound: bound.delay_ns)


def _problems(drawn: Sequence[ScenarioPlan]) -> Iterator[str]:
    """A sentence about those draws that are not feasible, with the first problem of the first; nothing if all are."""
    failed = [plan for plan in drawn if not plan.feasible]
    if failed:
        yield f"in {len(failed)} of {len(drawn)} draws of the positions that GPS gives: {failed[0].problems[0]}"


def plan(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    reported: Sequence[Mapping[NodeId, Enu]] = (),
    sources: Sequence[NodeId] | None = None,
    deadline_ns: int | None = None,
) -> ScenarioPlan | Refused:
    """Judge the scenario as it stands; refused if its traffic cannot be planned at all. A timetable is judged for each
    draw of `reported` positions as well: the greatest bounds count, and what fails with one is a problem. `sources`
    send the application's traffic.
    """
    return judge(Site(scenario, positions, reported=reported), sources, deadline_ns)


def judge(
    site: Site, sources: Sequence[NodeId] | None, deadline_ns: int | None, *, quick: bool = False
) -> ScenarioPlan | Refused:
    """Judge a scenario at its site; `quick`: for the exact positions alone (`evaluate`)."""
    classes = demands(site.scenario, sources)
    if isinstance(classes, Refused):
        return classes
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
