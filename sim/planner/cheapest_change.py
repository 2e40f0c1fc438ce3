"""Finds the cheapest change that makes a scenario feasible: the fewest keys, then the least change of values.

The search varies the number of clusters and the flooding period. With a timetable it also varies the backoff that a
turn must allow for (`radio.cw_min`), makes every node a head, and at last combines everything that makes turns short.
If relays contend, it tries a timetable. Its last resort is less application traffic.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Final, NamedTuple

from fanet_mw.bounds import Refused
from fanet_mw.routing.clustered.tdma.hello_room import crowd, hellos_ns, least_ms
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.routing.clustered.timetable.turn_size import distance_error_m, most_together, superframe
from fanet_mw.scenario import Scenario
from fanet_mw.units import US, Enu, NodeId
from sim.planner import problems_and_notes
from sim.planner.demand import demands
from sim.planner.goodput_bound import in_turns
from sim.planner.plan import judge
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site
from sim.planner.variant import Value, Variant, vary

_COUNTS: Final = (1, 2, 3, 4, 5, 6, 8, 11, 15, 22, 30, 44, 64)
_PERIODS: Final = (0.1, 0.2, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0, 10.0)
"""Periods to try, as multiples of the scenario's own period."""
_TURN_PERIODS_S: Final = (0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 1.0, 2.0, 5.0)
_TIGHT_PERIOD_S: Final = 4.0
_WINDOWS: Final = (31, 15, 7, 3, 1)
_SLOWER: Final = (1.1, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 20.0, 50.0, 100.0)


class ScenarioChange(NamedTuple):
    """The cheapest change that makes a plan feasible, and the plan with that change."""

    variant: Variant
    plan: ScenarioPlan


def cheapest_change(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    reported: Sequence[Mapping[NodeId, Enu]] = (),
    sources: Sequence[NodeId] | None = None,
    deadline_ns: int | None = None,
    delivers_m: float | None = None,
    delivers: Callable[[ScenarioPlan], bool] = lambda _: True,
) -> ScenarioChange | None:
    """The least change that makes `plan` feasible, if any searched does; nothing is searched for a separated swarm.
    `delivers_m`: up to which distance the channel delivers; `delivers`: whether floods lose few enough packets.
    """
    site = Site(scenario, positions, reported=reported)
    found = judge(site, sources, deadline_ns)
    if isinstance(found, ScenarioPlan) and found.cut_off:
        return None
    for group, quick in ((_changes(site, delivers_m), True), (_tightest(scenario), False), (_lighter(scenario), True)):
        for variant in sorted(group, key=lambda v: v.size):
            if variant.scenario.measures_links or _hopeless(site.of(variant.scenario), sources):
                continue  # a timetable over lossy links is planned otherwise (`lossy_plan.py`)
            found = judge(site.of(variant.scenario), sources, deadline_ns, quick=quick)
            if quick and isinstance(found, ScenarioPlan) and found.feasible:
                found = judge(site.of(variant.scenario), sources, deadline_ns)
            if isinstance(found, ScenarioPlan) and found.feasible and delivers(found):
                return ScenarioChange(variant, found)
    return None


def _hopeless(site: Site, sources: Sequence[NodeId] | None) -> bool:
    """True if no timetable at all can carry the load in this scenario's turns, so that none need be computed."""
    classes = demands(site.scenario, sources)
    if not site.timetable or isinstance(classes, Refused) or site.scenario.traffic.destination != "all":
        return False
    together = most_together(site.scenario)
    turns = superframe(site.scenario, together=together)
    limits = ((c.interval_ns, in_turns(turns, site.adjacency, c.sources, together=together)) for c in classes)
    return any(most is not None and interval_ns < most.least_interval_ns for interval_ns, most in limits)


def _changes(site: Site, delivers_m: float | None) -> Iterator[Variant]:
    options = _turn_options if site.timetable else _slot_options
    for settings in options(site, delivers_m):
        variant = vary(site.scenario, settings)
        if variant is not None:
            yield variant


def _turn_options(site: Site, delivers_m: float | None) -> Iterator[dict[str, Value]]:
    scenario = site.scenario
    clusters, radio = scenario.clusters, scenario.radio
    counts = dict.fromkeys((clusters.count, scenario.node_count - 1))
    windows = dict.fromkeys((radio.cw_min, *(w for w in _WINDOWS if w < radio.cw_min)))
    periods = dict.fromkeys((clusters.flooding_period_s, *_TURN_PERIODS_S))
    others = product(_clock_options(scenario), _hello_options(site), _link_options(site, delivers_m))
    for count, window, period_s, (clocks, hellos, links) in product(counts, windows, periods, [*others]):
        yield {
            "clusters.count": count,
            "radio.cw_min": window,
            "clusters.flooding_period_s": period_s,
            **clocks,
            **hellos,
            **links,
        }


def _hello_options(site: Site) -> list[dict[str, Value]]:
    """Changes that help when the contention window is too short for hellos: a longer one, also for a longer period."""
    if not any(problems_and_notes.too_short(site.scenario, site.adjacency)):
        return [{}]
    least = least_ms(hellos_ns(site.scenario, crowd(site.adjacency)))
    return [{"clusters.contention_ms": float(ms)} for ms in (least, 2 * least)]


def _link_options(site: Site, delivers_m: float | None) -> list[dict[str, Value]]:
    """Changes that help when timetables count on links that are not there: a greatest distance of links up to which the
    channel delivers, or, if reports leave open who hears whom, one that no two nodes are near by twice the error of
    GPS.
    """
    range_m, clear_m = delivers_m or site.scenario.radio.range_m, distance_error_m(site.scenario)
    if delivers_m is None and (not any(site.reported) or site.scenario.radio.channel != "range"):
        return [{}]
    apart = sorted({math.dist(a, b) for a, b in combinations(site.positions.values(), 2)})
    gaps = [(a, b) for a, b in zip(apart, [*apart[1:], math.inf], strict=True) if a <= range_m and b - a > 2 * clear_m]
    if not gaps:
        return [{}]
    near, far = gaps[-1]
    shorter: dict[str, Value] = {"clusters.link_m": float(round(min((near + far) / 2, near + 2 * clear_m)))}
    if delivers_m is not None:
        return [shorter]
    return [{}] if near <= range_m - clear_m < range_m + clear_m <= far else [{}, shorter]


def _clock_options(scenario: Scenario) -> list[dict[str, Value]]:
    """Changes that help when clocks differ by more than the slack of turns: time beacons in hellos, or more slack."""
    needed_ns = problems_and_notes.unsynchronized_slack_ns(scenario)
    if needed_ns <= turn_slack_ns(scenario):
        return [{}]
    return [{"clock.sync": "beacons"}, {"clusters.turn_slack_us": needed_ns / US}]


def _tightest(scenario: Scenario) -> Iterator[Variant]:
    """The settings with which turns carry the most: short turns, long superframes, and few hellos in a short window."""
    if scenario.clusters.relay != "scheduled" or scenario.clock.modelled:
        return  # clocks that drift need slack
    settings: dict[str, Value] = {
        "radio.cw_min": 1,
        "clusters.turn_slack_us": 20.0,
        "clusters.contention_ms": 20.0,
        "clusters.flooding_period_s": _TIGHT_PERIOD_S,
        "routing.hello_interval_s": max(2.0, scenario.routing.hello_interval_s),
    }
    variant = vary(scenario, settings)
    if variant is not None:
        yield variant


def _slot_options(site: Site, _: float | None) -> Iterator[dict[str, Value]]:
    scenario = site.scenario
    clusters, nodes = scenario.clusters, scenario.node_count
    counts = dict.fromkeys((clusters.count, *(n for n in _COUNTS if n < max(2, nodes))))
    periods = dict.fromkeys(round(clusters.flooding_period_s * factor, 6) for factor in _PERIODS)
    for count, period_s in product(counts, periods):
        yield {"clusters.count": count, "clusters.flooding_period_s": period_s}
    turned: dict[str, Value] = {"clusters.relay": "scheduled"}
    yield turned
    turned["clusters.count"] = nodes - 1
    for period_s in dict.fromkeys((clusters.flooding_period_s, *_TURN_PERIODS_S)):
        yield {**turned, "clusters.flooding_period_s": period_s}
        yield {**turned, "clusters.flooding_period_s": period_s, "clusters.guard_ms": 0.5}


def _lighter(scenario: Scenario) -> Iterator[Variant]:
    for factor in _SLOWER:
        variant = vary(scenario, {"traffic.interval_s": float(f"{scenario.traffic.interval_s * factor:.6g}")})
        if variant is not None and scenario.traffic.arrivals == "cbr":
            yield variant
