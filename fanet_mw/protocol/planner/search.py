"""The cheapest change that makes a scenario feasible: fewest keys first, then the least change of their values.

Searched: the cluster count, the flooding period, slots by load, a timetable. When none of them helps, the least
traffic interval (in steps) at which the design as it stands is feasible is named: load that does not fit has to go.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Final

from fanet_mw.protocol.delay import Refused
from fanet_mw.protocol.planner.demand import TrafficClass, demands
from fanet_mw.protocol.planner.design import Design, Slots
from fanet_mw.protocol.planner.feasibility import Change, Plan, Site, evaluate
from fanet_mw.protocol.topology import Adjacency
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S

_COUNTS: Final = (1, 2, 3, 4, 5, 6, 8, 11, 15, 22, 30, 44, 64)
_PERIODS: Final = (0.1, 0.2, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0, 10.0)
_COARSE: Final = (0.2, 0.5, 1.0, 2.0)
"""For a timetable, which takes a second to make: periods, and cluster counts."""
_SLOWER: Final = (1.1, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 20.0, 50.0, 100.0)


def plan(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    adjacency: Adjacency | None = None,
    sources: Sequence[NodeId] | None = None,
    search: bool = True,
) -> Plan | Refused:
    """Judge the scenario as it stands, and look for the cheapest change when it is not feasible.

    `adjacency` is who hears whom, by default everyone within `radio.range_m` (a timetable looks at positions only);
    `sources` are the nodes that send the application's traffic. Refused when the traffic cannot be planned at all.
    """
    classes = demands(scenario, sources)
    if isinstance(classes, Refused):
        return classes
    site = Site(scenario, positions, adjacency)
    design = Design.of(scenario)
    found = evaluate(site, classes, design)
    if found.feasible or not search:
        return found
    return found._replace(change=_cheapest(site, classes, design) or _lighter(site, classes, design))


def _cheapest(site: Site, classes: Sequence[TrafficClass], design: Design) -> Change | None:
    for candidate in sorted(_candidates(design, len(site.positions)), key=lambda c: (design.distance(c), c)):
        found = evaluate(site, classes, candidate)
        if found.feasible:
            return Change(tuple(_differences(design, candidate)), candidate, found.classes)
    return None


def _candidates(design: Design, nodes: int) -> Iterator[Design]:
    coarse = design.relays == "timetable"
    several = [round(design.clusters * factor) for factor in _COARSE] if coarse else _COUNTS
    counts = sorted({design.clusters, *(n for n in several if 1 <= n < max(2, nodes))})
    periods = sorted({round(design.period_ns * factor) for factor in (_COARSE if coarse else _PERIODS)})
    slots: tuple[Slots, ...] = ("equal",) if coarse else ("equal", "by_load")
    for clusters, period_ns, divided in product(counts, periods, slots):
        candidate = Design(clusters, period_ns, design.guard_ns, divided, design.relays)
        if candidate != design and design.guard_ns < period_ns // clusters:
            yield candidate
    if not coarse:
        yield design._replace(relays="timetable")


def _differences(old: Design, new: Design) -> Iterator[str]:
    if new.clusters != old.clusters:
        yield f"clusters.count = {new.clusters} (was {old.clusters})"
    if new.period_ns != old.period_ns:
        yield f"clusters.flooding_period_s = {new.period_ns / S:g} (was {old.period_ns / S:g})"
    if new.slots != old.slots:
        yield "slots divided by load instead of equally"
    if new.relays != old.relays:
        yield 'clusters.relay = "scheduled"'


def _lighter(site: Site, classes: Sequence[TrafficClass], design: Design) -> Change | None:
    """Less application traffic."""
    for factor in _SLOWER:
        lighter = [
            c._replace(interval_ns=round(c.interval_ns * factor)) if c.name == "application" else c for c in classes
        ]
        found = evaluate(site, lighter, design)
        if found.feasible:
            was = next(c.interval_ns for c in classes if c.name == "application")
            key = f"traffic.interval_s = {was * factor / S:g} (was {was / S:g})"
            return Change((key,), design, found.classes)
    return None
