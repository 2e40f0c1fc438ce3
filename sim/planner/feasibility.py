"""Judges one scenario: the load, delay and backlog of each cluster's slot, and for each traffic class a delay bound.

    source --access--> head's queue --slot--> flood --> last node
           uplink_ns          slot_delays        FloodCost.duration

It is feasible if each slot is stable, each packet arrives before its lifetime and any deadline end, no queue overflows,
and a flood reaches all nodes within the hop limit. Where the access has no bound, a second (or a period) is assumed.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw import wire
from fanet_mw.bounds import Bounded, DelayBound, Refused, paper
from fanet_mw.graph.topology import Adjacency, components, levels, within_range
from fanet_mw.routing.clustered.clustering import Cluster, Swarm
from fanet_mw.routing.clustered.clustering.division import Division
from fanet_mw.routing.clustered.tdma.turn_timing import receipt_ns
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable
from fanet_mw.routing.clustered.timetable.timetable import Turn
from fanet_mw.routing.clustered.timetable.turn_size import links, reserved, schedule_parts, superframe
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S
from sim.planner import flood_hops, problems_and_notes
from sim.planner.demand import ClassPlan, TrafficClass
from sim.planner.flood_cost import FloodCost
from sim.planner.goodput_bound import Goodput, any_protocol
from sim.planner.head_slot import ClassLoad, ClusterPlan, slot_delays, work_ns
from sim.planner.problems_and_notes import outdated
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site
from sim.planner.timetable_plan import Candidate, TimetablePlan, judge, table_for
from sim.planner.uplink_delay import Ways, access_outcome, ways

_NAMED: Final = 12
"""So many nodes that are cut off are named."""
_ASSUMED_UPLINK_NS: Final = 1 * S


class _Judged(NamedTuple):
    """The judgement of all heads, for any kind of relaying."""

    clusters: tuple[ClusterPlan, ...]
    cut_off: tuple[NodeId, ...]
    superframe: TimetablePlan | None = None
    unfit: tuple[str, ...] = ()


def members_of(scenario: Scenario, positions: Mapping[NodeId, Enu]) -> list[Cluster]:
    """The clusters that the leader will make once all have joined. It belongs to none; a timetable gives it turns."""
    range_m = scenario.clusters.link_m or scenario.radio.range_m
    others = {node: at for node, at in positions.items() if node != scenario.leader}
    swarm = Swarm(others or positions, within_range(others or positions, range_m=range_m, reaches=scenario.reaches))
    clusters = Division.of(scenario).divide(swarm)
    if scenario.clusters.relay == "scheduled" and others and scenario.leader in positions:
        clusters.append(Cluster(scenario.leader, (scenario.leader,)))
    return clusters


def evaluate(
    site: Site, classes: Sequence[TrafficClass], *, deadline_ns: int | None = None, quick: bool = False
) -> ScenarioPlan:
    """Judge one scenario. `quick`: compute no timetable that carries less than the load, or takes seconds."""
    scenario = site.scenario
    fitted = _fitted(site, quick=quick) if site.timetable else None
    clusters = members_of(scenario, site.positions)
    if (
        isinstance(fitted, FittedTimetable) and fitted.whole
    ):  # a node with turns of its own does not send its packets to a head
        clusters = [Cluster(node, (node,)) for node in sorted(site.positions)]
    head_of = {member: cluster.head for cluster in clusters for member in cluster.members}
    heads = [cluster.head for cluster in clusters]
    found = ways(site.adjacency, head_of, classes)
    loads = _loads(heads, head_of, found, classes)
    shares = [_shares(site, head, load, classes) for head, load in zip(heads, loads, strict=True)]
    access = _access(site, found, classes, shares)
    uplink_ns = access.delay_ns if isinstance(access, Bounded) else _assumed_ns(site)
    candidates = [
        Candidate(
            cluster.head, len(cluster.members), max((found.hops.get(n, 0) for n in cluster.members), default=0), row
        )
        for cluster, row in zip(clusters, shares, strict=True)
    ]
    judged = (
        _in_slots(site, candidates, uplink_ns) if fitted is None else _in_turns(site, fitted, candidates, uplink_ns)
    )
    summed = tuple(_class(index, c, judged, uplink_ns) for index, c in enumerate(classes))
    late = (
        ()
        if judged.unfit or judged.cut_off or deadline_ns is None
        else tuple(problems_and_notes.late(summed, deadline_ns))
    )
    cut_off = tuple(_in_parts(judged.cut_off))
    uplinks_ns = problems_and_notes.uplinks_ns(scenario, found.through, classes)
    crowded = tuple(problems_and_notes.too_short(scenario, site.adjacency, uplinks_ns)) if site.timetable else ()
    clocks = problems_and_notes.clocks_apart if site.timetable else problems_and_notes.refused_time
    apart = tuple(clocks(scenario))
    unheard = tuple(_unheard(scenario, fitted)) if isinstance(fitted, FittedTimetable) else ()
    out_of_hops = () if judged.unfit or judged.cut_off else tuple(_out_of_hops(site, fitted, judged.clusters))
    if out_of_hops:
        refused = Refused("floods end before all nodes have them")
        summed = tuple(c._replace(bound=refused, from_head=refused) for c in summed)
    return ScenarioPlan(
        scenario=scenario,
        clusters=judged.clusters,
        classes=summed,
        access=access,
        paper=_paper(judged.clusters, scenario),
        superframe=judged.superframe,
        cut_off=judged.cut_off,
        goodput=goodput(site, classes),
        deadline_ns=deadline_ns,
        problems=judged.unfit
        or (
            *cut_off,
            *out_of_hops,
            *outdated(scenario, site.positions, site.adjacency),
            *problems_and_notes.problems(scenario, judged.clusters, summed, (*cut_off, *out_of_hops)),
            *crowded,
            *apart,
            *unheard,
            *late,
            *problems_and_notes.refused_together(scenario, classes),
        ),
        notes=(
            *problems_and_notes.notes(access, judged.clusters, guard_ns=site.guard_ns, uplink_ns=uplink_ns),
            *problems_and_notes.left_out(scenario, site.adjacency),
        ),
    )


def _out_of_hops(
    site: Site, fitted: FittedTimetable | Refused | None, clusters: Sequence[ClusterPlan]
) -> Iterator[str]:
    scenario = site.scenario
    if not isinstance(fitted, FittedTimetable):
        hops = max((c.hops + max(levels(site.adjacency, NodeId(c.head)).values()) for c in clusters), default=0)
        yield from flood_hops.too_many(scenario, hops)
        return
    geometry = links(scenario, fitted.turns)
    by_range = scenario.radio.channel == "range"
    adjacency = site.adjacency if by_range else site.within(geometry.link_m)
    found = flood_hops.flood_hops(fitted.table, adjacency, geometry)
    yield from flood_hops.incomplete(scenario, geometry, found)
    most = max((c.hops + found[NodeId(c.head)].most for c in clusters if c.head in found), default=0)
    yield from flood_hops.too_many(scenario, most)


def _unheard(scenario: Scenario, fitted: FittedTimetable) -> Iterator[str]:
    """A sentence if the leader's announcements expire before its turns, so that nodes elect another."""
    roots = fitted.table.offsets_of(scenario.leader)
    if not roots:
        return
    done_ns = fitted.turns.done_ns(roots, span=fitted.table.spans[scenario.leader])
    worst_ns = scenario.radio.lead_ns + done_ns[min(schedule_parts(scenario), len(done_ns)) - 1]
    lifetime_ns = scenario.routing.lifetime_ns(wire.PRIORITY_BULK)
    if worst_ns > lifetime_ns:
        yield (
            f"the leader's announcements take up to {worst_ns / S:.1f} s, and expire after routing.lifetime_s = "
            f"{lifetime_ns / S:g}: nodes would elect another leader"
        )


def goodput(site: Site, classes: Sequence[TrafficClass]) -> Goodput | None:
    everyone = site.scenario.traffic.destination == "all"
    sources = next((c.sources for c in classes if c.name == "application"), ())
    return any_protocol(site.scenario, site.adjacency, sources) if everyone else None


def _loads(
    heads: Sequence[NodeId], head_of: Mapping[NodeId, NodeId], found: Ways, classes: Sequence[TrafficClass]
) -> list[list[int]]:
    """The number of sources of each class at each head; a node without a head counts at the lowest one."""
    homeless = frozenset(found.homeless)
    rows = {head: [0] * len(classes) for head in heads}
    for index, c in enumerate(classes):
        for source in c.sources:
            if heads and source not in homeless:
                rows[head_of.get(source, min(heads))][index] += 1
    return [rows[head] for head in heads]


def _shares(site: Site, head: NodeId, load: Sequence[int], classes: Sequence[TrafficClass]) -> list[ClassLoad]:
    """The load of each class at a head. In a timetable, the longest packet determines the length of a turn."""
    if site.timetable:
        turn_ns = superframe(site.scenario).turn_ns
        turn = FloodCost(turn_ns, turn_ns, proven=True)
        return [
            ClassLoad(n, c.interval_ns, turn, c.priority, c.payload_bytes) for n, c in zip(load, classes, strict=True)
        ]
    return [ClassLoad(n, c.interval_ns, site.flood(head, c.payload_bytes)) for n, c in zip(load, classes, strict=True)]


def _assumed_ns(site: Site) -> int:
    """The assumed delay to the head if it has no bound; with a timetable members can contend only once per period."""
    return max(_ASSUMED_UPLINK_NS, site.scenario.clusters.period_ns) if site.timetable else _ASSUMED_UPLINK_NS


def _access(
    site: Site, found: Ways, classes: Sequence[TrafficClass], shares: Sequence[Sequence[ClassLoad]]
) -> DelayBound:
    """The delay to the head; with a timetable it must fit the contention window, where no floods are."""
    if not site.timetable:
        spacing_ns = min((s.flood.spacing_ns for row in shares for s in row), default=S)
        return access_outcome(site.scenario, site.adjacency, found, classes, spacing_ns=spacing_ns)
    outcome = access_outcome(site.scenario, site.adjacency, found, classes, spacing_ns=None)
    if isinstance(outcome, Refused) or not any(found.hops.values()):
        return outcome
    turns = superframe(site.scenario)
    if outcome.delay_ns > turns.contention_ns:
        return Refused(
            f"{outcome.delay_ns / 1e6:.0f} ms in the worst case, more than the contention window of "
            f"{turns.contention_ns / 1e6:g} ms"
        )
    return Bounded(outcome.delay_ns + turns.period_ns - turns.contention_ns)


def heads_of(scenario: Scenario, positions: Mapping[NodeId, Enu]) -> dict[NodeId, NodeId]:
    """The head of each node except the leader, as the leader will assign it."""
    clusters = members_of(scenario, positions)
    found = {member: cluster.head for cluster in clusters for member in cluster.members}
    return {node: head for node, head in found.items() if node != scenario.leader}


def _fitted(site: Site, *, quick: bool) -> FittedTimetable | Refused:
    places = tuple(sorted(site.positions.items()))
    return table_for(site.scenario, places, heads_of(site.scenario, site.positions), quick=quick)


def _in_turns(site: Site, found: FittedTimetable | Refused, candidates: Sequence[Candidate], jitter_ns: int) -> _Judged:
    """Judge all roots of one timetable; if the turns do not suffice, each root is refused for that reason."""
    scenario = site.scenario
    if isinstance(found, Refused):
        refused = tuple(_refused(candidate, found, scenario.clusters.period_ns) for candidate in candidates)
        return _Judged(refused, (), TimetablePlan(superframe(scenario), 0, 0, None), (found.reason,))
    lead_ns, control = scenario.radio.lead_ns, {scenario.leader: schedule_parts(scenario)}
    bulk_bytes = found.frame_bytes - sum(reserved(scenario).values())
    of_root: dict[NodeId, list[Turn]] = {}
    for turn in found.table.turns:
        of_root.setdefault(turn.root, []).append(turn)
    judged = tuple(
        judge(
            found,
            of_root.get(NodeId(c.head), []),
            c,
            lead_ns=lead_ns,
            receipt_ns=receipt_ns(scenario),
            jitter_ns=jitter_ns,
            control=control.get(c.head, 0),
            bulk_bytes=bulk_bytes,
        )
        for c in candidates
    )
    turns = TimetablePlan(found.turns, found.table.used, len(found.table.roots()), found.table, found.together)
    return _Judged(judged, _missed(found.table.uncovered, leader=scenario.leader), turns)


def _in_slots(site: Site, candidates: Sequence[Candidate], jitter_ns: int) -> _Judged:
    """Judge equal slots, one for each head, as the leader divides the period."""
    period_ns = site.scenario.clusters.period_ns
    slot_ns = period_ns // max(1, len(candidates))
    judged = tuple(
        _cluster(candidate, slot_ns=slot_ns, period_ns=period_ns, guard_ns=site.guard_ns, jitter_ns=jitter_ns)
        for candidate in candidates
    )
    return _Judged(judged, _split(site.adjacency, leader=site.scenario.leader))


def _refused(candidate: Candidate, why: Refused, period_ns: int) -> ClusterPlan:
    delays = [why if s.sources else Bounded(0) for s in candidate.shares]
    return _in_slot(candidate, delays, None, slot_ns=0, usable_ns=0, period_ns=period_ns)


def _cluster(candidate: Candidate, *, slot_ns: int, period_ns: int, guard_ns: int, jitter_ns: int) -> ClusterPlan:
    usable_ns = max(0, slot_ns - guard_ns)
    delays, waiting = slot_delays(candidate.shares, usable_ns=usable_ns, period_ns=period_ns, jitter_ns=jitter_ns)
    return _in_slot(candidate, delays, waiting, slot_ns=slot_ns, usable_ns=usable_ns, period_ns=period_ns)


def _in_slot(
    candidate: Candidate,
    delays: Sequence[DelayBound],
    backlog: int | None,
    *,
    slot_ns: int,
    usable_ns: int,
    period_ns: int,
) -> ClusterPlan:
    shares = candidate.shares
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=slot_ns,
        usable_ns=usable_ns,
        work_ns=work_ns(shares, period_ns=period_ns),
        packets=sum(s.sources * period_ns / s.interval_ns for s in shares),
        flood=max((s.flood for s in shares), key=lambda f: f.duration_ns, default=FloodCost(0, 1, proven=True)),
        delays=tuple(delays),
        backlog=backlog,
    )


def _planned(c: TrafficClass, bound: DelayBound, from_head: DelayBound) -> ClassPlan:
    return ClassPlan(c.name, len(c.sources), c.interval_ns, bound, from_head, c.priority)


def _class(index: int, c: TrafficClass, judged: _Judged, uplink_ns: int) -> ClassPlan:
    if judged.cut_off:
        refused = Refused(f"{len(judged.cut_off)} nodes are out of reach")
        return _planned(c, refused, refused)
    worst_ns = 0
    for cluster in judged.clusters:
        outcome = cluster.delays[index]
        if isinstance(outcome, Refused):
            refused = outcome if judged.unfit else Refused(f"head {cluster.head}: {outcome.reason}")
            return _planned(c, refused, refused)
        worst_ns = max(worst_ns, outcome.delay_ns)
    return _planned(c, Bounded(worst_ns + uplink_ns), Bounded(worst_ns))


def _paper(clusters: Sequence[ClusterPlan], scenario: Scenario) -> DelayBound:
    """The greatest estimate of any cluster by equations (3) and (4), whose packets are taken to be evenly spaced."""
    worst_ns, period_ns = 0, scenario.clusters.period_ns
    for cluster in clusters:
        if not cluster.packets:
            continue
        if not cluster.usable_ns:
            return Refused(f"head {cluster.head} has no slot")
        found = paper.cluster_estimate(
            airtime_ns=max(1, round(cluster.work_ns / cluster.packets)),
            slot_ns=cluster.usable_ns,
            period_ns=period_ns,
            interval_ns=max(1, round(period_ns / cluster.packets)),
        )
        if isinstance(found, Refused):
            return found
        worst_ns = max(worst_ns, found.delay_ns)
    return Bounded(worst_ns)


def _split(adjacency: Adjacency, *, leader: NodeId) -> tuple[NodeId, ...]:
    """The nodes that have no connection with the leader over any number of hops."""
    return tuple(sorted(node for part in components(adjacency) if leader not in part for node in part))


def _missed(uncovered: Mapping[NodeId, Sequence[NodeId]], *, leader: NodeId) -> tuple[NodeId, ...]:
    """The nodes that the leader's floods miss, or else those of some other root."""
    found = uncovered.get(leader) or next((nodes for _, nodes in sorted(uncovered.items()) if nodes), ())
    return tuple(found)


def _in_parts(cut_off: Sequence[NodeId]) -> Iterator[str]:
    """A sentence about the nodes that are cut off; nothing if there are none."""
    if cut_off:
        named = ", ".join(map(str, cut_off[:_NAMED]))
        rest = f" and {len(cut_off) - _NAMED} more" if len(cut_off) > _NAMED else ""
        noun = "node" if len(cut_off) == 1 else "nodes"
        yield f"the swarm is in parts: no flood of the leader's part reaches {noun} {named}{rest}"
