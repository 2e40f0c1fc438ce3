"""What `fanet plan` answers: is a scenario feasible, before take-off?

Exit codes: 0 feasible, 1 not feasible, 2 the scenario or a flag is wrong (as with every command).
"""

import json
import math
from collections.abc import Mapping
from itertools import combinations
from random import Random
from typing import Any, Final

from agents.applications.traffic import sources_of
from agents.positioning import error_m
from fanet_mw.bounds import Bounded, DelayBound, Refused
from fanet_mw.errors import ConfigError
from fanet_mw.graph.topology import within_range
from fanet_mw.rng import stream
from fanet_mw.routing.clustered.timetable.turn_size import links
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.tables.sections import MOST_S
from fanet_mw.trace import LIKELY_SHARE
from fanet_mw.units import MS, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.places import rounded
from sim.planner import flood_loss
from sim.planner.cheapest_change import cheapest_change
from sim.planner.demand import ClassPlan, demands
from sim.planner.expected_links import chance_of, expected_links
from sim.planner.lossy_plan import LossyPlan, plan_lossy
from sim.planner.plan import plan, with_capacity
from sim.planner.plan_text import (
    describe,
    describe_change,
    describe_loss,
    describe_lossy,
    describe_not_counted,
    describe_operator,
    item,
)
from sim.planner.problems_and_notes import not_counted, outdated
from sim.planner.rounds_plan import judge_rounds
from sim.planner.scenario_plan import ScenarioPlan
from sim.world.environment.layout import positions

_DRAWS: Final = 3
"""The number of draws of shadowing for which a plan is made; each takes up to some seconds."""
_GPS_DRAWS: Final = 20
"""The number of draws of reported positions; each takes up to some tenths of a second."""


def judge(
    scenario: Scenario, *, deadline_s: float | None = None, change: bool = True
) -> tuple[str, dict[str, Any], bool]:
    """(text, JSON, feasible) at the starting positions; `change`: look for a change if it is not feasible."""
    if scenario.routing.protocol not in ("clustered", "rounds"):
        raise ConfigError(
            f'routing.protocol = {scenario.routing.protocol}: only "clustered" and "rounds" can be planned'
        )
    deadline_ns = _deadline_ns(scenario, deadline_s)
    at = dict(zip(map(NodeId, scenario.node_ids), positions(scenario), strict=True))
    if scenario.routing.protocol == "rounds":
        return judge_rounds(scenario, at, deadline_ns=deadline_ns)
    sources = [NodeId(node) for node in sources_of(scenario)]
    if scenario.measures_links:
        announced = {node: rounded(place) for node, place in at.items()}
        return _judge_lossy(scenario, announced, sources, deadline_ns=deadline_ns)
    reported = _reported(scenario, at)
    found = plan(scenario, at, reported=reported, sources=sources, deadline_ns=deadline_ns)
    if isinstance(found, Refused):
        return describe(found), {"feasible": False, "problems": [found.reason]}, False
    found, missed = _with_loss(with_capacity(found, at), at)
    left = tuple(not_counted(scenario))
    operator = describe_operator(scenario, [c.bound.delay_ns for c in found.classes if isinstance(c.bound, Bounded)])
    text, content = [describe(found)], {**_json(found), "not_counted": list(left)}
    if operator is not None:
        text.append(item("operator", operator))
        content["operator"] = operator
    if left:
        text.append(describe_not_counted(left))
    if _has_floods(found, at):
        text.append(describe_loss(missed, everyone=found.feasible and not left and not found.varying))
        content["loss"] = None if missed is None else missed._asdict()

    def delivers(other: ScenarioPlan) -> bool:
        return _with_loss(other, at)[0].feasible

    moves = any(outdated(scenario, at, within_range(at, range_m=scenario.radio.range_m)))
    if change and not found.feasible and not moves:  # nothing that is searched makes a timetable last
        lossy = missed is not None and missed.mean > flood_loss.MOST
        delivers_m = _delivers_m(scenario, at) if lossy else None
        cheapest = None  # for links that nodes nearest to each other do not have
        if not lossy or delivers_m is not None:
            cheapest = cheapest_change(
                scenario,
                at,
                reported=reported,
                sources=sources,
                deadline_ns=deadline_ns,
                delivers_m=delivers_m,
                delivers=delivers,
            )
        text.append(describe_change(cheapest, found))
        content["change"] = None if cheapest is None else {
            "set": list(cheapest.variant.arguments),
            "classes": [_class_json(c, cheapest.plan.deadline_ns) for c in cheapest.plan.classes],
        }  # fmt: skip
    return "\n".join(text), content, found.feasible


def _deadline_ns(scenario: Scenario, deadline_s: float | None) -> int | None:
    if deadline_s is not None and not 0 < deadline_s <= MOST_S:
        raise ConfigError(f"--deadline {deadline_s:g}: must be > 0 and <= {MOST_S:g} [s]")
    wanted_s = scenario.traffic.deadline_s if deadline_s is None else deadline_s
    return None if wanted_s is None else seconds_to_ns(wanted_s)


def _judge_lossy(
    scenario: Scenario, at: dict[NodeId, Enu], sources: list[NodeId], *, deadline_ns: int | None
) -> tuple[str, dict[str, Any], bool]:
    """Judge a scenario with lossy links. Nothing better is searched for, because one such plan takes seconds."""
    classes = demands(scenario, sources)
    if isinstance(classes, Refused):
        return describe(classes), {"feasible": False, "problems": [classes.reason]}, False
    application = next((c for c in classes if c.name == "application"), None)
    if application is None:
        reason = "nobody sends the application's traffic, of which alone a delay is stated over links that lose frames"
        return describe(Refused(reason)), {"feasible": False, "problems": [reason]}, False
    count = _DRAWS if scenario.radio.shadowing_db else 1
    draws = [expected_links(scenario, at, draw=draw) for draw in range(count)]
    found = plan_lossy(scenario, at, draws, application, deadline_ns=deadline_ns)
    left = tuple(not_counted(scenario))
    text = "\n".join([describe_lossy(found), describe_not_counted(left)]) if left else describe_lossy(found)
    return text, {**_lossy_json(found), "not_counted": list(left)}, found.feasible


def _lossy_json(found: LossyPlan) -> dict[str, Any]:
    return {
        "scenario": found.scenario.name,
        "feasible": found.feasible,
        "proven": False,
        "deadline_ms": None if found.deadline_ns is None else found.deadline_ns / MS,
        "likely_share": LIKELY_SHARE,
        "likely_ms": None if found.worst_ns is None else found.worst_ns / MS,
        "draws": [
            {
                "links": drawn.links,
                "fits": drawn.fitted is not None,
                "likely_ms": {node: None if ns is None else ns / MS for node, ns in drawn.likely_ns.items()},
            }
            for drawn in found.draws
        ],
        "problems": list(found.problems),
        "notes": list(found.notes),
    }


def _reported(scenario: Scenario, at: dict[NodeId, Enu]) -> list[dict[NodeId, Enu]]:
    """Draws of the starting positions as UAVs report them, with errors of GPS; none if GPS is exact."""
    noise_m = error_m(sigma_m=scenario.world.gps_sigma_m, range_m=scenario.radio.range_m)
    sigma_m = math.hypot(noise_m, scenario.sensors.gps_bias_m)

    def displaced(place: Enu, random: Random) -> Enu:
        return rounded(Enu(*(axis + random.gauss(0.0, sigma_m) for axis in place)))

    draws = range(_GPS_DRAWS) if sigma_m else ()
    return [{node: displaced(place, stream(draw, "plan/gps", node)) for node, place in at.items()} for draw in draws]


def _has_floods(found: ScenarioPlan, at: Mapping[NodeId, Enu]) -> bool:
    """True if the plan has a timetable whose floods are to reach other nodes."""
    return found.superframe is not None and found.superframe.table is not None and len(at) > 1 and not found.cut_off


def _with_loss(found: ScenarioPlan, at: Mapping[NodeId, Enu]) -> tuple[ScenarioPlan, flood_loss.Loss | None]:
    """The plan, with a problem more if its floods lose too much, and their loss; None without a timetable, and if the
    probability is not known. Ways to a head in contention are not included.
    """
    scenario, superframe = found.scenario, found.superframe
    chance = chance_of(scenario, at)
    if chance is None or superframe is None or superframe.table is None or not _has_floods(found, at):
        return found, None
    turns = superframe.turns
    geometry = links(scenario, turns)
    adjacency = within_range(
        {node: rounded(place) for node, place in at.items()}, range_m=geometry.link_m, reaches=scenario.reaches
    )
    missed = flood_loss.loss(
        superframe.table, adjacency, per_superframe=turns.per_superframe, hop_turns=geometry.hop_turns, chance=chance
    )
    lossy = flood_loss.problems(missed, link_m=geometry.link_m, delivers_m=_delivers_m(scenario, at))
    return found._replace(problems=(*found.problems, *lossy)), missed


def _delivers_m(scenario: Scenario, at: Mapping[NodeId, Enu]) -> float | None:
    """The distance up to which the channel delivers frames; None if to nobody, or if all are in `radio.range_m`."""
    chance = chance_of(scenario, at)
    if chance is None or scenario.radio.channel == "range":
        return None
    delivers_m = None
    for apart_m, a, b in sorted((at[a].minus(at[b]).norm(), a, b) for a, b in combinations(at, 2)):
        if min(chance(a, b, ()), chance(b, a, ())) < flood_loss.DELIVERS:
            break
        delivers_m = apart_m
    return delivers_m


def _json(found: ScenarioPlan) -> dict[str, Any]:
    superframe, bottleneck = found.superframe, found.bottleneck
    return {
        "scenario": found.scenario.name,
        "feasible": found.feasible,
        "proven": found.proven,
        "confidence": found.confidence,
        "varying_links": found.varying,
        "deadline_ms": None if found.deadline_ns is None else found.deadline_ns / MS,
        "classes": [_class_json(c, found.deadline_ns) for c in found.classes],
        "to_head_ms": _ms(found.access),
        "superframe": None if superframe is None else {
            "period_ms": superframe.turns.period_ns / MS,
            "contention_ms": superframe.turns.contention_ns / MS,
            "turn_ms": superframe.turns.turn_ns / MS,
            "turns": superframe.turns.per_superframe,
            "used": superframe.used,
            "packets": superframe.packets,
            "together": superframe.together,
            "least_interval_s": None if superframe.least_interval_ns is None else superframe.least_interval_ns / S,
        },
        "slots": [
            {
                "head": c.head,
                "members": c.members,
                "hops": c.hops,
                "slot_ms": c.slot_ns / MS,
                "flood_ms": c.flood.duration_ns / MS,
                "packets_per_period": c.packets,
                "used": c.utilization if c.usable_ns else None,
                "waiting": c.backlog,
            }
            for c in found.clusters
        ],
        "carried_per_s": found.carried_per_second,
        "any_protocol_per_s": None if found.goodput is None else found.goodput.per_second,
        "bottleneck": None if bottleneck is None else bottleneck.head,
        "equation_4_ms": _ms(found.paper),
        "cut_off": list(found.cut_off),
        "problems": list(found.problems),
        "notes": list(found.notes),
    }  # fmt: skip


def _class_json(c: ClassPlan, deadline_ns: int | None) -> dict[str, Any]:
    return {
        "name": c.name,
        "sources": c.sources,
        "interval_s": c.interval_ns / S,
        "bound_ms": _ms(c.bound),
        "from_head_ms": _ms(c.from_head),
        "refused": c.bound.reason if isinstance(c.bound, Refused) else None,
        "deadline_met": None if deadline_ns is None else c.meets(deadline_ns),
    }


def _ms(outcome: DelayBound) -> float | None:
    return outcome.delay_ns / MS if isinstance(outcome, Bounded) else None


def show(scenario: Scenario, *, deadline: float | None, as_json: bool) -> int:
    """Print the plan; returns 0 if it is feasible, otherwise 1."""
    text, content, feasible = judge(scenario, deadline_s=deadline)
    print(json.dumps(content, indent=2) if as_json else text)
    return 0 if feasible else 1
