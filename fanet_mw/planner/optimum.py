"""Searches for the configuration that meets a deadline with the least airtime: clusters, heads and relays, slots,
period.

    airtime per packet = way to the head + relays of its flood x its frame
                       + hellos and the leader's schedules in the same time

Only timetables are searched, because only their bounds are proven. Turns hold what the load of each head needs, so the
lengths of slots follow from the number of heads, the period and `radio.cw_min`. Schedules are sent once per flooding
period. Of two periods that meet the deadline the longer one therefore takes less airtime, so each search begins with
the longest period.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.airtime import Timing
from fanet_mw.bounds import Refused
from fanet_mw.planner.cheapest_change import WINDOWS, hopeless
from fanet_mw.planner.demand import TrafficClass, demands
from fanet_mw.planner.feasibility import evaluate, members_of
from fanet_mw.planner.flood_cost import frame_ns
from fanet_mw.planner.scenario_plan import ScenarioPlan
from fanet_mw.planner.site import Site
from fanet_mw.planner.uplink_delay import ways
from fanet_mw.planner.variant import Variant, vary
from fanet_mw.routing.clustered.timetable.turn_size import schedule_bytes
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S, seconds_to_ns

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
    deadline_ns: int | None,
    sources: Sequence[NodeId] | None = None,
) -> Optimum | None:
    """The configuration of least airtime whose bounds are proven and within the deadline; None if none was found."""
    site = Site(scenario, positions)
    best: Optimum | None = None
    tried = 0
    for settings in _families(scenario):
        for period_s in _periods(scenario, deadline_ns):
            variant = vary(scenario, {**settings, "clusters.flooding_period_s": period_s})
            if variant is None or hopeless(site.of(variant.scenario), sources):
                continue
            tried += 1
            found = _judge(site.of(variant.scenario), sources, deadline_ns)
            if found is None:
                continue
            plan, classes = found
            if not plan.proven:
                break  # no period gives the way to the head a bound
            if not plan.feasible:
                continue
            cost = _airtime_ns(plan, classes, site)
            if best is None or (cost[0], variant.size) < (best.airtime_ns, best.variant.size):
                best = Optimum(variant, plan, *cost, tried)
            break  # a shorter period only takes more airtime
    return best._replace(tried=tried) if best else None


def _judge(
    site: Site, sources: Sequence[NodeId] | None, deadline_ns: int | None
) -> tuple[ScenarioPlan, list[TrafficClass]] | None:
    classes = demands(site.scenario, sources)
    if isinstance(classes, Refused):
        return None
    return evaluate(site, classes, deadline_ns=deadline_ns, quick=True), classes


def _families(scenario: Scenario) -> Iterator[dict[str, float | int | str]]:
    """All combinations of settings except the period. With fewer heads fewer turns are needed, but members send to
    heads.
    """
    most = scenario.nodes.count - 1
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
