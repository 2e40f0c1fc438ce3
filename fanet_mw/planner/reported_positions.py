"""What errors of GPS make of a plan: nodes compute their timetable from reported positions, not from the true ones.

A plan is made for the true positions and for some draws of reported ones. Reported positions may give another timetable
even where all links are the same, because floods begin in the order in which nodes lie. The greatest bound of n draws
is exceeded by that of another draw, as in flight, with a probability of 1 / (n + 1) (a prediction limit of order
statistics; Hahn and Meeker, Statistical Intervals, 1991). The bound that a node states in flight always holds: it is
that of the timetable in force.
"""

from collections.abc import Iterator, Sequence

from fanet_mw.bounds import Bounded, DelayBound
from fanet_mw.planner.scenario_plan import ScenarioPlan


def worst_of(exact: ScenarioPlan, drawn: Sequence[ScenarioPlan], *, varying: int) -> ScenarioPlan:
    """The plan for the exact positions, with the greatest bounds of all `drawn` plans, and with what fails in them.

    `varying`: the number of pairs of nodes that are linked in some draws only. Reports then change the links in flight,
    and the leader makes another timetable now and then.
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
