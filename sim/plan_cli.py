"""`fanet plan`: is a scenario feasible, before take-off? The planner is `fanet_mw.protocol.planner`."""

import json

from agents.traffic import sources_of
from fanet_mw.errors import ConfigError
from fanet_mw.protocol.delay import Bounded, Refused
from fanet_mw.protocol.planner import Plan, describe, plan
from fanet_mw.protocol.planner.turns_plan import describe_turns, plan_turns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, seconds_to_ns
from sim.layout import positions


def judge(scenario: Scenario, *, deadline_s: float | None, search: bool) -> tuple[str, dict[str, object], bool]:
    """(text, JSON, feasible) of a scenario where its nodes start."""
    if scenario.routing.protocol != "clustered":
        raise ConfigError(f'routing.protocol = {scenario.routing.protocol}: only "clustered" can be planned')
    at = {NodeId(node): place for node, place in zip(scenario.node_ids, positions(scenario), strict=True)}
    deadline_ns = None if deadline_s is None else seconds_to_ns(deadline_s)
    if scenario.clusters.relay == "scheduled":
        turns = plan_turns(scenario, at, deadline_ns=deadline_ns, search=search)
        return describe_turns(turns), turns._asdict() | {"feasible": turns.feasible}, turns.feasible
    found = plan(scenario, at, sources=[NodeId(node) for node in sources_of(scenario)], search=search)
    if isinstance(found, Refused):
        return describe(found), {"feasible": False, "reason": found.reason}, False
    return _with_deadline(found, deadline_ns)


def _with_deadline(found: Plan, deadline_ns: int | None) -> tuple[str, dict[str, object], bool]:
    bounds = {c.name: c.bound.delay_ns / MS if isinstance(c.bound, Bounded) else None for c in found.classes}
    text, feasible = describe(found), found.feasible
    if deadline_ns is not None:
        late = [name for name, bound_ms in sorted(bounds.items()) if bound_ms is None or bound_ms * MS > deadline_ns]
        if late:
            feasible = False
            text += f"\n  deadline of {deadline_ns / MS:g} ms: not met by {', '.join(late)}"
    return text, {"feasible": feasible, "bounds_ms": bounds, "problems": list(found.problems)}, feasible


def show(
    scenario: Scenario,
    *,
    deadline: float | None,
    search: bool,
    as_json: bool,
) -> int:
    """Print the plan; 0: feasible, 1: not."""
    text, content, feasible = judge(scenario, deadline_s=deadline, search=search)
    print(json.dumps(content, indent=2) if as_json else text)
    return 0 if feasible else 1
