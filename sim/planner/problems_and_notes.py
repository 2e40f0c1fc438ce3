"""The sentences of a plan: its problems say why it is not feasible, its notes what its bounds assume and leave out.

A plan is for nodes that stay where they start, and for frames that arrive wherever links are taken to be; what a
scenario has beyond that is not counted. A bound that a node states in flight is another one: it follows from the
timetable that is in force then. Whether hellos, and packets of members to their heads if only heads have turns, fit the
contention window is an estimate (`fanet_mw/routing/clustered/tdma/hello_room.py`).
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import ceil
from operator import attrgetter
from types import MappingProxyType
from typing import Final

from fanet_mw import wire
from fanet_mw.airtime import mean_access_ns
from fanet_mw.bounds import Bounded, DelayBound, Refused
from fanet_mw.graph.topology import Adjacency, levels, two_hop
from fanet_mw.routing.clustered.tdma.hello_room import crowd, hellos_ns, least_ms, room_ns
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.ftsp import MOST_STATED_NS
from fanet_mw.timesync.turn_slack import least_slack_ns
from fanet_mw.units import MS, US, Enu, NodeId, S
from sim.planner.demand import ClassPlan, TrafficClass
from sim.planner.head_slot import ClusterPlan

_JOINED_S: Final = 6.0
_JOINED_HELLOS: Final = 4
"""The time, or if that is longer the hello intervals, until all have joined and heard a schedule."""
_LISTENED_HELLOS: Final = 4
_PASSED_ON_HELLOS: Final = 3
"""Hello intervals until clocks agree by time beacons: at the leader, and for each hop from it. 15 of 16 swarms of 2 to
45 nodes took at least two less; a line with too short a window took two more."""
_MOST_SLACK_US: Final = 1_000_000
_LIFETIMES: Final = {wire.PRIORITY_SAFETY: "safety_lifetime_s", wire.PRIORITY_REPORT: "report_lifetime_s"}


def late(classes: Sequence[ClassPlan], deadline_ns: int) -> Iterator[str]:
    for c in classes:
        if isinstance(c.bound, Bounded) and not c.meets(deadline_ns):
            yield (f"{c.name}: takes up to {c.bound.delay_ns / MS:.1f} ms, the deadline is {deadline_ns / MS:g} ms")


def refused_together(scenario: Scenario, classes: Sequence[TrafficClass]) -> Iterator[str]:
    """A sentence about a node with two bulk classes, of which `traffic.deadline_s` lets it accept one only."""
    if scenario.traffic.deadline_s is None:
        return
    bulk = [c for c in classes if c.priority == wire.PRIORITY_BULK]
    for first, second in combinations(bulk, 2):
        both = set(first.sources) & set(second.sources)
        if both:
            yield (
                f"node {min(both)} sends both {first.name} and {second.name}, and with traffic.deadline_s = "
                f"{scenario.traffic.deadline_s:g} a node refuses a bulk packet that comes soon after another: one "
                "class at most may be bulk at a node (traffic.sources, traffic.priority, traffic.deadline_s)"
            )


def expired(scenario: Scenario, c: ClassPlan, delay_ns: int) -> str | None:
    """A sentence about a class whose packets may exceed their lifetime on the way; None if they cannot."""
    lifetime_ns = scenario.routing.lifetime_ns(c.priority)
    if delay_ns <= lifetime_ns:
        return None
    own = _LIFETIMES.get(c.priority, "")
    key = own if own and getattr(scenario.routing, own) else "lifetime_s"
    return f"{c.name}: takes up to {delay_ns / S:.1f} s, and expires after routing.{key} = {lifetime_ns / S:g}"


def problems(
    scenario: Scenario, clusters: Sequence[ClusterPlan], classes: Sequence[ClassPlan], cut_off: Sequence[str]
) -> Iterator[str]:
    full = sorted((c for c in clusters if c.utilization > 1), key=lambda c: (-c.utilization, c.head))
    if full:
        worst = full[0]
        others = "" if len(full) == 1 else f"; {len(full) - 1} other slots are too full as well"
        yield (
            f"head {worst.head}: the {worst.packets:.1f} packets of a flooding period take "
            f"{worst.work_ns / 1e6:.1f} ms, its slot of {worst.slot_ns / 1e6:.1f} ms has "
            f"{worst.usable_ns / 1e6:.1f} ms for them{others}"
        )
    for cluster in clusters:
        if cluster.backlog is not None and cluster.backlog > scenario.routing.queue_frames:
            yield (
                f"head {cluster.head}: up to {cluster.backlog} packets wait, "
                f"routing.queue_frames = {scenario.routing.queue_frames}"
            )
    for c in classes:
        if isinstance(c.bound, Refused):
            if not full and not cut_off:
                yield f"{c.name}: {c.bound.reason}"
            continue
        problem = expired(scenario, c, c.bound.delay_ns)
        if problem is not None:
            yield problem


def clocks_apart(scenario: Scenario, *, slack: str = "clusters.turn_slack_us") -> Iterator[str]:
    """Sentences about clocks that differ by more than the slack of a turn, the key `slack`, and that nothing
    synchronizes, or by more than nodes accept.
    """
    yield from refused_time(scenario)
    clock, slack_us = scenario.clock, attrgetter(slack)(scenario)
    needed_ns = unsynchronized_slack_ns(scenario)
    if needed_ns > slack_us * US:
        most_us, needed_us = (needed_ns - least_slack_ns(0)) / 2 / US, ceil(needed_ns / US)
        off = f"{most_us:g} us" if most_us < _MOST_SLACK_US else f"{most_us / 1e6:g} s"
        short = (
            f"has to be at least {needed_us}" if needed_us <= _MOST_SLACK_US else "cannot be so much (at most 1000000)"
        )
        yield (
            f"clocks may be {off} off by the end, and {slack} = {slack_us:g} {short}: "
            f'with clock.sync = "{clock.sync}" nothing brings them together '
            f"(clock.offset_ms = {clock.offset_ms:g}, clock.drift_ppm = {clock.drift_ppm:g})"
        )


def refused_time(scenario: Scenario) -> Iterator[str]:
    """A sentence about clocks that may be further apart than the time that nodes accept."""
    clock = scenario.clock
    if clock.sync == "none":
        return
    # a node compares the time with its own clock: that of another node, or the true one
    apart_ns = (2 if clock.sync == "beacons" else 1) * clock.unsynchronized_error_ns(scenario.duration_ns)
    if apart_ns > clock.limit_ns:
        yield (
            f"clocks may be {apart_ns / S:g} s apart, and a node accepts no time that differs by more than "
            f"clock.limit_s = {clock.limit_s:g} from its own clock: it would have no turns, and while one has none "
            f"no node states a bound (clock.offset_ms = {clock.offset_ms:g}, clock.drift_ppm = {clock.drift_ppm:g})"
        )


def unsynchronized_slack_ns(scenario: Scenario) -> int:
    """The slack that turns need at the end of the run if nothing synchronizes the clocks; else 0."""
    clock = scenario.clock
    if clock.sync != "none" or not clock.modelled:
        return 0
    return least_slack_ns(clock.unsynchronized_error_ns(scenario.duration_ns))


def left_out(scenario: Scenario, adjacency: Adjacency) -> Iterator[str]:
    if scenario.radio.channel != "range":
        yield "who hears whom is taken by distance, up to radio.range_m, whatever the channel does"
    most_ns = (turn_slack_ns(scenario) - least_slack_ns(0)) // 2
    if scenario.clock.sync == "beacons":
        most_ns = min(most_ns, MOST_STATED_NS)
    if scenario.clock.sync != "none" and scenario.clusters.relay == "scheduled":
        yield (
            f"in flight a bound is stated while clocks are known within {max(0, most_ns) / US:g} us "
            f"(clusters.turn_slack_us = {scenario.clusters.turn_slack_us:g}), and not before"
        )
    if scenario.repair_ns > 0:
        bounded = scenario.clusters.relay == "scheduled" and not scenario.measures_links
        yield "repairs of lost packets come later than any bound here, and their load is not counted" + (
            ", and may reach into turns; nodes state no bound in flight" if bounded else ""
        )
    joined_s = max(_JOINED_S, _JOINED_HELLOS * scenario.routing.hello_interval_s)
    ready_s = joined_s + 2 * scenario.clusters.flooding_period_s
    hops = max(levels(adjacency, NodeId(scenario.leader)).values())
    agreed_s = (_LISTENED_HELLOS + _PASSED_ON_HELLOS * hops) * scenario.routing.hello_interval_s
    if scenario.clock.sync == "beacons" and scenario.clock.modelled and scenario.warmup_s < agreed_s:
        yield (
            f"time beacons take up to some {agreed_s:.0f} s to reach the node {hops} hops from the leader; before that "
            f"nodes miss their turns, and packets are lost (warmup_s = {scenario.warmup_s:g})"
        )
    if scenario.clusters.relay == "scheduled" and scenario.warmup_s < ready_s:
        yield (
            f"nodes have their timetable some {ready_s:.0f} s after the start; packets before that, and those that "
            f"wait behind them, have no bound, and some are lost (warmup_s = {scenario.warmup_s:g})"
        )


def notes(access: DelayBound, clusters: Sequence[ClusterPlan], *, guard_ns: int, uplink_ns: int) -> Iterator[str]:
    if isinstance(access, Refused):
        yield f"the way to the head is assumed to take at most {uplink_ns / S:g} s, not proven: {access.reason}"
    if any(not cluster.flood.proven for cluster in clusters):
        yield "floods are relayed by CSMA/CA: their duration and spacing are estimates, and losses are not counted"
        tail_ns = max(cluster.flood.duration_ns - cluster.flood.spacing_ns for cluster in clusters)
        if tail_ns > guard_ns:
            yield (
                f"a slot's last flood runs about {tail_ns / 1e6:.0f} ms into the next slot, the guard time is "
                f"{guard_ns / 1e6:g} ms: floods of neighboring slots meet"
            )
    else:
        yield "floods hold their bound while no frame is lost and the nodes are where the timetable has them"


_NONE: Final[Mapping[NodeId, int]] = MappingProxyType({})


def too_short(scenario: Scenario, adjacency: Adjacency, uplinks_ns: Mapping[NodeId, int] = _NONE) -> Iterator[str]:
    """A sentence if hellos and packets to heads (`uplinks_ns`: their airtime by sender) do not fit the window."""
    needed_ns = hellos_ns(scenario, crowd(adjacency)) + _densest_ns(adjacency, uplinks_ns)
    window_ns = round(scenario.clusters.contention_ms * MS)
    what = "hellos and packets to heads" if any(uplinks_ns.values()) else "hellos"
    if needed_ns > room_ns(window_ns):
        yield (
            f"the {what} of a superframe take {needed_ns / MS:.1f} ms where nodes are densest, its contention window "
            f"of {window_ns / MS:g} ms has {room_ns(window_ns) / MS:g} ms for them: neighbors are missed, taken for "
            f"dead (clusters.contention_ms, which has to be at least {least_ms(needed_ns)}, routing.hello_interval_s, "
            "clusters.flooding_period_s)"
        )


def uplinks_ns(
    scenario: Scenario, through: Mapping[NodeId, Sequence[int]], classes: Sequence[TrafficClass]
) -> dict[NodeId, int]:
    """The airtime in a superframe of what each node sends towards a head; `through`: its sources by class."""
    return {
        node: sum(
            n * scenario.clusters.period_ns * mean_access_ns(c.payload_bytes, scenario.radio) // c.interval_ns
            for n, c in zip(counts, classes, strict=True)
        )
        for node, counts in through.items()
    }


def _densest_ns(adjacency: Adjacency, airtime_ns: Mapping[NodeId, int]) -> int:
    """The greatest sum of the airtimes of a node and of all nodes within two hops of it."""
    if not airtime_ns:
        return 0
    near = two_hop(adjacency).items()
    return max(airtime_ns.get(node, 0) + sum(airtime_ns.get(other, 0) for other in others) for node, others in near)


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
