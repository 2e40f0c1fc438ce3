"""The plan of rounds: the bound of urgent packets, what turns carry, and how full the slots of bulk are.

A relay has a share of one bulk slot in as many as there are relays within its two hops, and has to send the packets of
all; another node takes part in one slot of eight, with its own. Relays whose neighbors all have a packet leave it out,
so up to twice as much may fit (`fanet_mw/routing/rounds/bulk_slots.py`).
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from agents.applications.traffic import sources_of
from fanet_mw.graph.topology import Adjacency, dominates, levels, link_sets, two_hop, within_range
from fanet_mw.routing.rounds.bulk_slots import SELDOM
from fanet_mw.routing.rounds.delay_law import DelayLaw
from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.scenario import Scenario, Traffic
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire import PRIORITY_REPORT
from sim.planner.plan_text import describe_operator, item
from sim.planner.problems_and_notes import clocks_apart

_LEFT_OUT: Final = 2.0
"""Runs carried up to 1.6 times what slots carry if no relay leaves a packet out, and none carried twice that."""


class BulkLoad(NamedTuple):
    """What one node has to send, and what its slots carry, in packets a second."""

    node: NodeId
    needed: float
    carried: float


def judge_rounds(
    scenario: Scenario, at: Mapping[NodeId, Enu], *, deadline_ns: int | None
) -> tuple[str, dict[str, Any], bool]:
    """The verdict on rounds: the bound over the hops that the starting positions need, and the load of the turns."""
    timing = RoundTiming.of(scenario)
    law = DelayLaw(timing, scenario)
    near = within_range(at, range_m=scenario.radio.range_m, reaches=scenario.reaches)
    ways = [levels(near, node) for node in at]
    hops = max(max(hops_to.values()) for hops_to in ways)
    endless = [name for name, each in scenario.traffic_classes.items() if each.arrivals == "saturated"]
    counted = {name: each for name, each in scenario.traffic_classes.items() if name not in endless}
    urgent = {name: each for name, each in counted.items() if each.priority != "bulk" or not timing.slots}
    packets = [  # how many a second, and how long they are
        (len(sources_of(scenario, name)) * _most_hz(each), each.longest_bytes) for name, each in urgent.items()
    ]
    offered = sum(rate * size for rate, size in packets)
    used = sum(rate * law.turns_of(size) for rate, size in packets) * timing.period_ns / S
    longest = max((size for _, size in packets), default=0)
    bound_ns = None if law.loses_frames else law.over_ns(hops, longest_bytes=longest, used=used)
    carried = timing.turn_bytes / (timing.period_ns / S)
    bulk = {name: each for name, each in counted.items() if name not in urgent}
    flooded = [name for name, each in bulk.items() if each.destination == "all"]
    rates: dict[NodeId, float] = defaultdict(float)
    for name in flooded:
        for node in sources_of(scenario, name):
            rates[NodeId(node)] += _most_hz(bulk[name])
    load = None
    if flooded:
        longest_bulk = max(bulk[name].longest_bytes for name in flooded)
        load = greatest_load(near, rates, timing, longest_bytes=longest_bulk)
    problems = [f"{name}: saturated sources offer more than any turns or slots carry" for name in endless]
    if load is not None and load.needed > _LEFT_OUT * load.carried:
        problems.append(
            f"bulk: node {load.node} has {load.needed:.0f} packets a second to send, and its slots carry "
            f"{load.carried:.0f}, twice as much at best: the others wait, until they expire"
        )
    if longest > timing.turn_bytes:
        problems.append(f"urgent packets of {longest} B are longer than rounds.turn_bytes = {timing.turn_bytes}")
    problems += clocks_apart(scenario, slack="rounds.turn_slack_us")
    if any(len(hops_to) < len(at) for hops_to in ways):
        problems.append("the nodes are not all connected at their starting positions")
    if used > 1:
        problems.append(
            f"urgent packets of {offered:.0f} B/s need {used:.2f} turns of each node in a round, it has one"
        )
    if deadline_ns is not None and (bound_ns is None or bound_ns > deadline_ns):
        problems.append(f"the bound is not within the deadline of {deadline_ns / MS:.0f} ms")
    feasible = not problems
    bound = "none: the channel loses frames" if bound_ns is None else f"at most {bound_ns / MS:.0f} ms over {hops} hops"
    text = [
        f"{'FEASIBLE' if feasible else 'NOT FEASIBLE'}  {scenario.name}: {scenario.nodes.count} nodes, a round of "
        f"{timing.period_ns / MS:.1f} ms: turns of {timing.turn_ns / MS:.2f}, {timing.slots} slots of "
        f"{timing.slot_ns / MS:.2f} for bulk",
        *(item("problem", problem) for problem in problems),
        item(
            "urgent",
            f"{bound} at the starting positions, {law.hop_ns / MS:.1f} ms for each further hop, while at most "
            f"{scenario.rounds.burst_bytes} B are under way; from {law.found_ns / S:.1f} s on, when links are known",
        ),
        *_too_long(scenario, bound_ns),
        item("turns", f"carry {carried / 1000:.1f} kB/s of urgent packets, the traffic has {offered / 1000:.1f} kB/s"),
        item("bulk", _of_bulk(load) if timing.slots else "goes in turns, too"),
    ]
    content: dict[str, Any] = {
        "feasible": feasible, "problems": problems, "period_ms": timing.period_ns / MS, "turn_ms": timing.turn_ns / MS,
        "slots": timing.slots, "slot_ms": timing.slot_ns / MS, "hop_ms": law.hop_ns / MS, "hops": hops,
        "bound_ms": None if bound_ns is None else bound_ns / MS, "from_s": law.found_ns / S,
        "carried_bytes_per_s": carried, "offered_bytes_per_s": offered,
        "bulk": None if load is None else load._asdict(),
    }  # fmt: skip
    operator = describe_operator(scenario, [] if bound_ns is None else [bound_ns], known_gone_ns=law.silent_ns)
    if operator is not None:
        text.append(item("operator", operator))
        content["operator"] = operator
    return "\n".join(text), content, feasible


def _most_hz(traffic: Traffic) -> float:
    """Packets a second of one source while it is active."""
    return 1 / traffic.interval_s if traffic.arrivals == "on_off" else traffic.source_hz


def _too_long(scenario: Scenario, bound_ns: int | None) -> Iterator[str]:
    routing, lives_ns = scenario.routing, scenario.routing.lifetime_ns(PRIORITY_REPORT)
    if bound_ns is not None and bound_ns > lives_ns:
        key = "report_lifetime_s" if routing.report_lifetime_s else "lifetime_s"
        yield item("note", f"a node whose bound is longer than routing.{key} = {lives_ns / S:g} states none")


def _of_bulk(load: BulkLoad | None) -> str:
    shared = "goes in slots that nodes within two hops share, without a bound"
    if load is None:
        return shared
    full = f"{load.needed / load.carried:.0%}"
    return f"{shared}; those of node {load.node} are at most {full} full at the starting positions"


def greatest_load(
    adjacency: Adjacency, rates: Mapping[NodeId, float], timing: RoundTiming, *, longest_bytes: int
) -> BulkLoad:
    """The node whose slots are fullest. `rates`: packets for all, a second; `longest_bytes`: of a packet on the air."""
    links = link_sets(adjacency)
    relays = {node for node in adjacency if dominates(node, links)}
    slots = timing.slots * (timing.slot_bytes // longest_bytes) * S / timing.period_ns
    total = sum(rates.values())
    loads = []
    for node, around in two_hop(adjacency).items():
        share = slots / (1 + len(relays.intersection(around)))
        if node in relays:
            loads.append(BulkLoad(node, total, share))
        else:
            loads.append(BulkLoad(node, rates.get(node, 0.0), share / SELDOM))
    return max(loads, key=lambda load: (load.needed / load.carried, -load.node))
