"""One design judged: per cluster its slot's load, delay and backlog; per class a bound from source to last node.

    source --access--> head's queue --slot--> flood --> last node
           uplink_ns          slot_delays        FloodCost.duration

A head's slot holds floods one spacing apart; under a timetable each of its turns holds one. Packets reach the head late
by up to the uplink: its bound where there is one, else one second (or period) is assumed, and said so.

Feasible: each slot is stable, every packet is through before its lifetime ends, and no queue overflows.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.protocol.clustering import Cluster, balanced
from fanet_mw.protocol.delay import Bounded, Outcome, Refused, paper
from fanet_mw.protocol.planner.access import Ways, access_outcome, ways
from fanet_mw.protocol.planner.demand import TrafficClass
from fanet_mw.protocol.planner.design import Design
from fanet_mw.protocol.planner.flood import FloodCost, flood_cost
from fanet_mw.protocol.planner.head import ClusterPlan, Share, slot_delays, work_ns
from fanet_mw.protocol.planner.turns import Candidate, judge, superframe_of, table_for
from fanet_mw.protocol.topology import Adjacency, within_range
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S, seconds_to_ns

_ASSUMED_UPLINK_NS: Final = 1 * S


class ClassPlan(NamedTuple):
    """A traffic class: its bound from the source to the last node it can reach, and from the head on."""

    name: str
    sources: int
    bound: Outcome
    from_head: Outcome


class Change(NamedTuple):
    """The cheapest change that makes a plan feasible: keys for people, and what the plan then promises."""

    keys: tuple[str, ...]
    design: Design
    classes: tuple[ClassPlan, ...]


class Plan(NamedTuple):
    """The verdict on a design."""

    design: Design
    clusters: tuple[ClusterPlan, ...]
    classes: tuple[ClassPlan, ...]
    access: Outcome
    uplink_ns: int
    paper: Outcome
    """What equations (1)-(4) say of the fullest cluster: to compare with, not to rely on."""
    problems: tuple[str, ...]
    """Why it is not feasible; none when it is."""
    notes: tuple[str, ...]
    """What the bounds assume or cannot promise."""
    change: Change | None = None

    @property
    def feasible(self) -> bool:
        return not self.problems

    @property
    def bottleneck(self) -> ClusterPlan | None:
        """The cluster whose slot is fullest."""
        return max(self.clusters, key=lambda c: (c.utilization, -c.head), default=None)


class Site:
    """Where the nodes are; what depends on that alone is computed once and shared by all designs of a search."""

    def __init__(self, scenario: Scenario, positions: Mapping[NodeId, Enu], adjacency: Adjacency | None = None) -> None:
        self.scenario = scenario
        self.positions = positions
        self.adjacency = within_range(positions, range_m=scenario.radio.range_m) if adjacency is None else adjacency
        self._floods: dict[tuple[NodeId, int], FloodCost] = {}

    def flood(self, head: NodeId, payload_bytes: int) -> FloodCost:
        key = head, payload_bytes
        if key not in self._floods:
            self._floods[key] = flood_cost(self.scenario, self.adjacency, head, payload_bytes=payload_bytes)
        return self._floods[key]


def evaluate(site: Site, classes: Sequence[TrafficClass], design: Design) -> Plan:
    """Judge one design. The leader is in no cluster, unless it is alone."""
    scenario = site.scenario
    others = {node: at for node, at in site.positions.items() if node != scenario.leader}
    clusters = balanced(others or site.positions, count=design.clusters)
    if design.relays == "timetable" and others and scenario.leader in site.positions:
        clusters.append(Cluster(scenario.leader, (scenario.leader,)))  # it has turns of its own
    head_of = {member: cluster.head for cluster in clusters for member in cluster.members}
    heads = [cluster.head for cluster in clusters]
    found = ways(site.adjacency, head_of, classes)
    loads = _loads(heads, head_of, found, classes)
    shares = [_shares(site, head, load, classes, design) for head, load in zip(heads, loads, strict=True)]
    access = _access(site, found, classes, design, shares)
    uplink_ns = access.delay_ns if isinstance(access, Bounded) else _assumed_ns(design)
    candidates = [
        Candidate(
            cluster.head, len(cluster.members), max((found.hops.get(n, 0) for n in cluster.members), default=0), row
        )
        for cluster, row in zip(clusters, shares, strict=True)
    ]
    unfit: tuple[str, ...] = ()
    if design.relays == "timetable":
        judged, unfit = _turned(site, candidates, design, uplink_ns)
    else:
        judged = tuple(
            _cluster(candidate, slot_ns=slot_ns, design=design, jitter_ns=uplink_ns)
            for candidate, slot_ns in zip(candidates, _slots(design, shares), strict=True)
        )
    summed = tuple(_class(index, c, judged, uplink_ns) for index, c in enumerate(classes))
    return Plan(
        design=design,
        clusters=judged,
        classes=summed,
        access=access,
        uplink_ns=uplink_ns,
        paper=_paper(judged, design),
        problems=unfit or tuple(_problems(scenario, judged, summed)),
        notes=(*_notes(access, judged, found, design, uplink_ns), *_repairs(scenario)),
    )


def _loads(
    heads: Sequence[NodeId], head_of: Mapping[NodeId, NodeId], found: Ways, classes: Sequence[TrafficClass]
) -> list[list[int]]:
    """Sources per class of each head. A node without a head counts with the lowest: some head gets its packets."""
    homeless = frozenset(found.homeless)
    rows = {head: [0] * len(classes) for head in heads}
    for index, c in enumerate(classes):
        for source in c.sources:
            if heads and source not in homeless:
                rows[head_of.get(source, min(heads))][index] += 1
    return [rows[head] for head in heads]


def _shares(
    site: Site, head: NodeId, load: Sequence[int], classes: Sequence[TrafficClass], design: Design
) -> list[Share]:
    """A turn is as long as the longest packet needs, whatever flies in it."""
    if design.relays == "timetable":
        turn_ns = superframe_of(site.scenario, period_ns=design.period_ns).turn_ns
        turn = FloodCost(turn_ns, turn_ns, 1, proven=True)
        return [Share(n, c.interval_ns, turn) for n, c in zip(load, classes, strict=True)]
    return [Share(n, c.interval_ns, site.flood(head, c.payload_bytes)) for n, c in zip(load, classes, strict=True)]


def _longest(shares: Sequence[Share]) -> FloodCost:
    return max((s.flood for s in shares), key=lambda f: f.duration_ns, default=FloodCost(0, 1, 0, proven=True))


def _slots(design: Design, shares: Sequence[Sequence[Share]]) -> list[int]:
    """Slot lengths, guard included. By load: what each needs, and the rest of the period in equal parts."""
    if not shares:
        return []
    equal = design.period_ns // len(shares)
    if design.slots == "equal":
        return [equal] * len(shares)
    needed = [
        design.guard_ns + work_ns(row, period_ns=design.period_ns) + max((s.flood.spacing_ns for s in row), default=0)
        for row in shares
    ]
    rest = (design.period_ns - sum(needed)) // len(shares)
    return [need + rest for need in needed] if rest >= 0 else [equal] * len(shares)


def _assumed_ns(design: Design) -> int:
    """The way to the head where nothing bounds it; a timetable lets members contend only once per period."""
    return max(_ASSUMED_UPLINK_NS, design.period_ns) if design.relays == "timetable" else _ASSUMED_UPLINK_NS


def _access(
    site: Site, found: Ways, classes: Sequence[TrafficClass], design: Design, shares: Sequence[Sequence[Share]]
) -> Outcome:
    """The way to the head. Under a timetable it shares no air with floods, but has to fit its window."""
    if design.relays != "timetable":
        spacing_ns = min((s.flood.spacing_ns for row in shares for s in row), default=S)
        return access_outcome(site.scenario, site.adjacency, found, classes, spacing_ns=spacing_ns)
    outcome = access_outcome(site.scenario, site.adjacency, found, classes, spacing_ns=None)
    if isinstance(outcome, Refused) or not any(found.hops.values()):
        return outcome
    contention_ns = superframe_of(site.scenario, period_ns=design.period_ns).contention_ns
    if outcome.delay_ns > contention_ns:
        return Refused(
            f"{outcome.delay_ns / 1e6:.0f} ms in the worst case, more than the contention window of "
            f"{contention_ns / 1e6:g} ms"
        )
    return Bounded(outcome.delay_ns + design.period_ns - contention_ns)


def _turned(
    site: Site, candidates: Sequence[Candidate], design: Design, jitter_ns: int
) -> tuple[tuple[ClusterPlan, ...], tuple[str, ...]]:
    """All heads under one timetable; when the turns do not suffice, each is refused with that, and it is said."""
    superframe = superframe_of(site.scenario, period_ns=design.period_ns)
    places = tuple((node, site.positions[node]) for node in sorted(site.positions))
    leader = site.scenario.leader
    members = {c.head: 0 if c.head == leader else c.members for c in candidates}
    table = table_for(site.scenario, places, members, superframe)
    if not isinstance(table, Refused):
        lead_ns = site.scenario.radio.lead_ns
        judged = (judge(table, c, superframe, lead_ns=lead_ns, jitter_ns=jitter_ns) for c in candidates)
        return tuple(judged), ()
    return tuple(_refused(candidate, table, design) for candidate in candidates), (table.reason,)


def _refused(candidate: Candidate, why: Refused, design: Design) -> ClusterPlan:
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=0,
        usable_ns=0,
        work_ns=work_ns(candidate.shares, period_ns=design.period_ns),
        packets=_packets(candidate.shares, design),
        flood=_longest(candidate.shares),
        delays=tuple(why if s.sources else Bounded(0) for s in candidate.shares),
        backlog=None,
    )


def _cluster(candidate: Candidate, *, slot_ns: int, design: Design, jitter_ns: int) -> ClusterPlan:
    shares = candidate.shares
    usable_ns = max(0, slot_ns - design.guard_ns)
    delays, waiting = slot_delays(shares, usable_ns=usable_ns, period_ns=design.period_ns, jitter_ns=jitter_ns)
    return ClusterPlan(
        head=candidate.head,
        members=candidate.members,
        hops=candidate.hops,
        slot_ns=slot_ns,
        usable_ns=usable_ns,
        work_ns=work_ns(shares, period_ns=design.period_ns),
        packets=_packets(shares, design),
        flood=_longest(shares),
        delays=tuple(delays),
        backlog=waiting,
    )


def _packets(shares: Sequence[Share], design: Design) -> float:
    return sum(s.sources * design.period_ns / s.interval_ns for s in shares)


def _class(index: int, c: TrafficClass, clusters: Sequence[ClusterPlan], uplink_ns: int) -> ClassPlan:
    worst_ns = 0
    for cluster in clusters:
        outcome = cluster.delays[index]
        if isinstance(outcome, Refused):
            refused = Refused(f"head {cluster.head}: {outcome.reason}")
            return ClassPlan(c.name, len(c.sources), refused, refused)
        worst_ns = max(worst_ns, outcome.delay_ns)
    return ClassPlan(c.name, len(c.sources), Bounded(worst_ns + uplink_ns), Bounded(worst_ns))


def _paper(clusters: Sequence[ClusterPlan], design: Design) -> Outcome:
    """Equations (3) and (4) of each cluster, its packets taken as evenly spaced; the greatest."""
    worst_ns = 0
    for cluster in clusters:
        if not cluster.packets:
            continue
        if not cluster.usable_ns:
            return Refused(f"head {cluster.head} has no slot")
        found = paper.cluster_estimate(
            airtime_ns=max(1, round(cluster.work_ns / cluster.packets)),
            slot_ns=cluster.usable_ns,
            period_ns=design.period_ns,
            interval_ns=max(1, round(design.period_ns / cluster.packets)),
        )
        if isinstance(found, Refused):
            return found
        worst_ns = max(worst_ns, found.delay_ns)
    return Bounded(worst_ns)


def _problems(scenario: Scenario, clusters: Sequence[ClusterPlan], classes: Sequence[ClassPlan]) -> Iterator[str]:
    full = False
    for cluster in clusters:
        if cluster.utilization > 1:
            full = True
            yield (
                f"head {cluster.head}: the {cluster.packets:.1f} packets of a flooding period take "
                f"{cluster.work_ns / 1e6:.0f} ms, its slot of {cluster.slot_ns / 1e6:.0f} ms has "
                f"{cluster.usable_ns / 1e6:.0f} ms for them"
            )
        if cluster.backlog is not None and cluster.backlog > scenario.routing.queue_frames:
            yield (
                f"head {cluster.head}: up to {cluster.backlog} packets wait, "
                f"routing.queue_frames = {scenario.routing.queue_frames}"
            )
    lifetime_ns = seconds_to_ns(scenario.routing.lifetime_s)
    for c in classes:
        if isinstance(c.bound, Refused):
            if not full:
                yield f"{c.name}: {c.bound.reason}"
        elif c.bound.delay_ns > lifetime_ns:
            yield (
                f"{c.name}: takes up to {c.bound.delay_ns / S:.1f} s, "
                f"routing.lifetime_s = {scenario.routing.lifetime_s:g}"
            )


def _repairs(scenario: Scenario) -> Iterator[str]:
    if scenario.clusters.repair_s > 0:
        yield "repairs of lost packets come later than any bound here, and their load is not counted"


def _notes(
    access: Outcome, clusters: Sequence[ClusterPlan], found: Ways, design: Design, uplink_ns: int
) -> Iterator[str]:
    if isinstance(access, Refused):
        yield f"the way to the head is assumed to take at most {uplink_ns / S:g} s, not proven: {access.reason}"
    if any(not cluster.flood.proven for cluster in clusters):
        yield "floods are relayed by CSMA/CA: their duration and spacing are estimates, and losses are not counted"
        tail_ns = max(cluster.flood.duration_ns - cluster.flood.spacing_ns for cluster in clusters)
        if tail_ns > design.guard_ns:
            yield (
                f"a slot's last flood runs about {tail_ns / 1e6:.0f} ms into the next slot, the guard time is "
                f"{design.guard_ns / 1e6:g} ms: floods of neighboring slots meet"
            )
    else:
        yield "floods hold their bound while no frame is lost and the nodes are where the timetable has them"
    if found.homeless:
        yield f"{len(found.homeless)} nodes can reach no head: {', '.join(map(str, found.homeless[:8]))}"
