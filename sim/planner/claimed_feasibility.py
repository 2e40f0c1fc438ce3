"""Judges a scenario with claimed slots. Rates are judged; the only delay that is stated is that without queues."""

import math
from collections.abc import Iterator, Sequence

from fanet_mw.bounds import Bounded, Refused
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS
from sim.planner import contention_window, flood_hops, problems_and_notes, reachability
from sim.planner.claimed_turns import ClaimedPlan, NodeTurns
from sim.planner.demand import ClassPlan, TrafficClass
from sim.planner.feasibility import goodput
from sim.planner.flood_cost import FloodCost
from sim.planner.head_slot import ClusterPlan
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site

_NO_BOUND = Refused("nothing bounds how many packets queue at a relay")


def evaluate_claims(site: Site, classes: Sequence[TrafficClass], *, deadline_ns: int | None = None) -> ScenarioPlan:
    """Judge a scenario with `clusters.relay = "claimed"`."""
    scenario = site.scenario
    claimants = site.claimants()
    claims = claimants.judge(scenario, classes)
    claims = claims._replace(least_interval_ns=claimants.least_interval_ns(scenario, classes))
    cut_off = reachability.split(site.adjacency, leader=scenario.leader)
    refused = Refused(f"{len(cut_off)} nodes are out of reach") if cut_off else _NO_BOUND
    planned = tuple(ClassPlan(c.name, len(c.sources), c.interval_ns, refused, refused, c.priority) for c in classes)
    return ScenarioPlan(
        scenario=scenario,
        clusters=tuple(_row(node, claims) for node in claims.nodes),
        classes=planned,
        access=Bounded(0),
        uplink_ns=0,
        paper=Refused("there are no heads"),
        superframe=None,
        claims=claims,
        cut_off=cut_off,
        goodput=goodput(site, classes),
        deadline_ns=deadline_ns,
        problems=(
            *reachability.problems(cut_off),
            *flood_hops.too_many(scenario, claims.hops),
            *contention_window.too_short_for_claims(scenario, site.adjacency),
            *_problems(scenario, claims, planned, deadline_ns),
            *problems_and_notes.clocks_apart(scenario),
        ),
        notes=(*_notes(claims), *problems_and_notes.left_out(scenario, site.adjacency)),
    )


def _row(node: NodeTurns, claims: ClaimedPlan) -> ClusterPlan:
    """A node as an entry of the plan: the head of a cluster of its own."""
    turn_ns = claims.turns.turn_ns
    usable_ns = round((node.claimed + node.won) * turn_ns)
    hop_ns = node.hop_ns or 0
    return ClusterPlan(
        head=node.node,
        members=1,
        hops=0,
        slot_ns=node.claimed * turn_ns,
        usable_ns=usable_ns,
        work_ns=round(node.load * turn_ns),
        packets=node.load,
        flood=FloodCost(hop_ns, turn_ns, 1, proven=False),
        delays=(),
        backlog=None,
    )


def _problems(
    scenario: Scenario, claims: ClaimedPlan, classes: Sequence[ClassPlan], deadline_ns: int | None
) -> Iterator[str]:
    without = [node for node in claims.nodes if not node.claimed]
    if without:
        longest = max(node.superframe for node in claims.nodes) or scenario.clusters.slots
        yield (
            f"{len(without)} nodes have no turn, the first is node {without[0].node}: superframes of up to {longest} "
            f"slots, a period has {claims.turns.per_superframe} turns"
        )
        return
    full = [node for node in claims.nodes if node.utilization > 1]
    if full:
        worst = claims.fullest
        others = "" if len(full) == 1 else f"; {len(full) - 1} other nodes have too few as well"
        yield (
            f"node {worst.node}: its packets need {worst.load:.1f} turns a period, it has {worst.claimed} and wins "
            f"{worst.won:.1f} by lot{others}"
        )
    yield from _overflowing(scenario, claims)
    lone_ns = claims.lone_ns
    for c in classes:
        problem = None if lone_ns is None else problems_and_notes.expired(scenario, c, lone_ns)
        if problem is not None:
            yield f"{problem}, even without queues"
        if deadline_ns is not None:
            yield f"{c.name}: no bound in claimed slots, so the deadline of {deadline_ns / MS:g} ms cannot be promised"


def _overflowing(scenario: Scenario, claims: ClaimedPlan) -> Iterator[str]:
    """A sentence about queues that are too short for the packets that come while a node waits for a turn; nothing if
    they are long enough. Packets of many sources come at random, so five standard deviations are added to their mean.
    """
    waiting = {node.node: node.load * (node.hop_ns or 0) / claims.turns.period_ns for node in claims.nodes}
    node = max(waiting, key=lambda one: (waiting[one], -one), default=None)
    if node is None:
        return
    least = math.ceil(waiting[node] + 5 * math.sqrt(waiting[node]))
    if scenario.routing.queue_frames < least:
        yield (
            f"node {node}: {waiting[node]:.1f} packets come on average while it waits for a turn, "
            f"routing.queue_frames = {scenario.routing.queue_frames} has to be at least {least}"
        )


def _notes(claims: ClaimedPlan) -> Iterator[str]:
    lone_ns, hop_ns = claims.lone_ns, claims.hop_ns
    if lone_ns is not None and hop_ns is not None:
        yield (
            f"a packet that finds no queue is with everyone within {claims.hops} hops x {hop_ns / MS:.1f} ms = "
            f"{lone_ns / MS:.0f} ms; when packets queue nothing bounds the delay: urgent ones go first at each node"
        )
    yield (
        "turns won by lot are an average, and claims made in flight may differ; what interference from beyond two hops "
        "costs is not counted"
    )
