"""Searches for the configuration that meets a deadline with the least airtime: clusters, heads and relays, slots,
period.

    airtime per packet = way to the head + relays of its flood x its frame
                       + hellos and the leader's schedules in the same time

Only timetables are searched, because only their bounds are proven. Turns hold what the load of each head needs, so the
lengths of slots follow from the number of heads, the period and `radio.cw_min`. Schedules are sent once per flooding
period. Of two periods that meet the deadline the longer one therefore takes less airtime, so each search begins with
the longest period.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import Final, NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.bounds import Refused
from fanet_mw.routing.clustered.timetable.turn_size import schedule_bytes
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S, seconds_to_ns
from sim.planner.cheapest_change import WINDOWS, hopeless
from sim.planner.demand import TrafficClass, demands
from sim.planner.feasibility import members_of
from sim.planner.flood_cost import frame_ns
from sim.planner.plan import judge
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site
from sim.planner.uplink_delay import ways
from sim.planner.variant import Value, Variant, vary

_HELLO_BYTES: Final = 140
"""The length of a hello without digests."""
_PERIOD_STEPS: Final = (1.0, 0.98, 0.95, 0.92, 0.88, 0.84, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""Periods to try, as shares of the deadline: a packet waits up to one period, and then crosses the swarm."""
_LONGEST_S: Final = 10.0
"""The longest period to try if there is no deadline."""


class Optimum(NamedTuple):
    """The best configuration found: its settings, its plan, and its airtime."""

    variant: Variant
    plan: ScenarioPlan
    airtime_ns: int
    """The airtime per application packet: all frames of all nodes, including control."""
    floods_ns: int
    """The part of it that goes to relays of the packet."""
    tried: int


def optimum(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    *,
    reported: Sequence[Mapping[NodeId, Enu]] = (),
    deadline_ns: int | None,
    sources: Sequence[NodeId] | None = None,
    delivers: Callable[[ScenarioPlan], bool] = lambda _: True,
) -> Optimum | None:
    """The configuration of least airtime whose bounds are proven and within the deadline, and whose floods lose few
    enough packets (`delivers`); None if none was found.
    """
    site = Site(scenario, positions, reported=reported)
    families = [_candidates(site, settings, sources, deadline_ns) for settings in _families(scenario)]
    tried = 0
    cheapest: list[tuple[int, tuple[int, float, tuple[str, ...]], int, Optimum]] = []
    waiting = list(range(len(families)))
    while waiting or cheapest:
        for index in waiting:
            for candidate in families[index]:
                tried += 1
                if candidate is not None:
                    heappush(cheapest, (candidate.airtime_ns, candidate.variant.size, index, candidate))
                    break  # a shorter period only takes more airtime
        if not cheapest:
            break
        *_, index, best = heappop(cheapest)
        whole = judge(site.of(best.variant.scenario), sources, deadline_ns)
        if not isinstance(whole, Refused) and whole.feasible and whole.proven and delivers(whole):
            return best._replace(plan=whole, tried=tried)
        waiting = [index]  # not for all reported positions: try the next period
    return None


def _candidates(
    site: Site, settings: Mapping[str, Value], sources: Sequence[NodeId] | None, deadline_ns: int | None
) -> Iterator[Optimum | None]:
    """One family's configurations, the longest period first, judged for the exact positions; None for one that is not
    feasible.
    """
    scenario = site.scenario
    for period_s in _periods(scenario, deadline_ns):
        variant = vary(scenario, {**settings, "clusters.flooding_period_s": period_s})
        if variant is None or hopeless(site.of(variant.scenario), sources):
            continue
        found = _judge(site.of(variant.scenario), sources, deadline_ns)
        if found is not None and not found[0].proven:
            yield None
            return  # no period gives the way to the head a bound
        if found is None or not found[0].feasible:
            yield None
        else:
            yield Optimum(variant, found[0], *_airtime_ns(*found, site), 0)


def _judge(
    site: Site, sources: Sequence[NodeId] | None, deadline_ns: int | None
) -> tuple[ScenarioPlan, list[TrafficClass]] | None:
    classes, found = demands(site.scenario, sources), judge(site, sources, deadline_ns, quick=True)
    return None if isinstance(classes, Refused) or isinstance(found, Refused) else (found, classes)


def _families(scenario: Scenario) -> Iterator[dict[str, Value]]:
    """All combinations of settings except the period. With fewer heads fewer turns are needed, but members send to
    heads.
    """
    most = scenario.node_count - 1
    windows = dict.fromkeys((scenario.radio.cw_min, *(w for w in WINDOWS if w < scenario.radio.cw_min)))
    for count in dict.fromkeys(max(1, round(most / share)) for share in (1, 2, 4, 10)):
        for window in windows:
            yield {"clusters.relay": "scheduled", "clusters.count": count, "radio.cw_min": window}


def _periods(scenario: Scenario, deadline_ns: int | None) -> Iterator[float]:
    longest_s = _LONGEST_S if deadline_ns is None else deadline_ns / S
    longest_s = min(longest_s, scenario.routing.lifetime_s)
    yield from dict.fromkeys(round(longest_s * step, 3) for step in _PERIOD_STEPS if round(longest_s * step, 3) > 0)


def _airtime_ns(plan: ScenarioPlan, classes: Sequence[TrafficClass], site: Site) -> tuple[int, int]:
    """The mean airtime per packet over one second, in all and for floods."""
    scenario = plan.scenario
    radio, timing = scenario.radio, Timing.of(scenario.radio)
    relays = {c.head: c.flood.transmissions for c in plan.clusters}
    head_of = {m: cluster.head for cluster in members_of(scenario, site.positions) for m in cluster.members}
    # a node with turns of its own does not send to a head
    head_of |= {node: node for node in head_of if node in relays}
    hops = ways(site.adjacency, head_of, classes).hops
    floods = uplinks = 0.0
    for c in classes:
        frame = frame_ns(radio, c.payload_bytes)
        for source in c.sources:
            floods += relays[head_of[source]] * frame * S / c.interval_ns
            uplinks += hops.get(source, 0) * (frame + timing.sifs_ns + timing.ack_ns) * S / c.interval_ns
    schedule = frame_ns(radio, schedule_bytes(scenario))
    control = relays.get(scenario.leader, 1) * schedule * S / scenario.clusters.period_ns
    hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
    if hello_ns:
        control += len(site.positions) * frame_ns(radio, _HELLO_BYTES) * S / hello_ns
    per_second = sum(c.per_second for c in classes)
    if not per_second:
        return round(control), 0
    return round((floods + uplinks + control) / per_second), round(floods / per_second)
