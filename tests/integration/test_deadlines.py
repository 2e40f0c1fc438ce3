"""Whole swarms with a deadline: packets that are admitted meet it, and a node that can no longer meet it says so."""

from typing import Any

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.config import build
from fanet_mw.trace import DeadlineLost, DeadlineMet, Dropped
from sim.planner.answer import judge
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog

LINE = ['nodes.layout="line"', "nodes.count=9", "clusters.count=8", "traffic.sources=8"]


def bound_s(nodes: int) -> float:
    settings = ['nodes.layout="line"', f"nodes.count={nodes}", f"clusters.count={nodes - 1}"]
    plan = judge(catalog.find("clusters", [*settings, f"traffic.sources={nodes - 1}"]))[1]
    found: float = plan["classes"][0]["bound_ms"] / 1000
    return found


def flown(*settings: str, faults: tuple[dict[str, Any], ...] = ()) -> tuple[Outcome, dict[str, Any]]:
    scenario = catalog.find("clusters", [*LINE, *settings])
    tree = scenario.model_dump(exclude_none=True) | {"faults": faults}
    outcome = simulate(build(tree))
    return outcome, finish(outcome, out=None)


def test_load_beyond_the_admissible_rate_is_refused_and_the_rest_meets_the_deadline() -> None:
    times = ["duration_s=15", "warmup_s=11", "drain_s=1", "clusters.flooding_period_s=0.2"]
    fast = [*times, "traffic.interval_s=0.02", "radio.cw_min=1"]
    outcome, free = flown(*fast)
    assert free["delay_ms"]["max"] > 1000, "without a deadline the queues grow"
    outcome, held = flown(*fast, "traffic.deadline_s=0.25")
    assert held["delay_ms"]["max"] <= 250
    assert held["bound"]["violations"] == 0
    admission = held["admission"]
    assert admission["refused"] == sum(r.reason == "admission" for r in outcome.records if isinstance(r, Dropped)) > 0
    admitted = held["generated"] - admission["refused"]
    assert held["delivered"] >= 0.98 * 8 * admitted
    assert admission["met"] >= 8
    assert admission["nodes_without"] <= 1, "the leader at most: its schedules go before its packets"


@pytest.mark.parametrize(("sources", "apart"), [([3], True), ([2], False)])
def test_two_bulk_classes_at_one_node_are_a_problem_because_packets_that_come_together_are_refused(
    sources: list[int], *, apart: bool
) -> None:
    tree = catalog.find("clusters", [*LINE, "duration_s=24", "warmup_s=14"]).model_dump(exclude_none=True)
    first = {"payload_bytes": 300, "interval_s": 0.4, "sources": [2], "deadline_s": 2}
    scenario = build(
        tree | {"traffic": [first, {"name": "second", "payload_bytes": 64, "interval_s": 0.5, "sources": sources}]}
    )
    _, plan, feasible = judge(scenario, change=False)
    assert feasible == apart
    assert apart == (not any("sends both application and second" in problem for problem in plan["problems"]))
    refused = finish(simulate(scenario), out=None)["admission"]["refused"]
    assert (refused == 0) == apart


@pytest.mark.slow
def test_nodes_that_join_later_make_the_way_too_long_for_the_deadline() -> None:
    """Of nine in a line two come late: a packet of node 2 then has to go as far as one did in a line of eight."""
    few, many = bound_s(7), bound_s(8)
    assert few < many
    cuts = tuple({"at_s": 0, "for_s": 9, "kind": "cut", "node": node} for node in (8, 9))
    times = ["duration_s=26", "warmup_s=5", f"traffic.deadline_s={(few + many) / 2:.6f}"]
    outcome, summary = flown(*times, faults=cuts)
    said = [r for r in outcome.records if isinstance(r, DeadlineMet | DeadlineLost)]
    last = {r.node: r for r in said}
    met = {r.node for r in said if isinstance(r, DeadlineMet) and r.t_ns < 9e9}
    lost = [node for node in sorted(met) if isinstance(last[node], DeadlineLost)]
    assert len(met) >= 5
    assert lost
    for node in lost:
        assert last[node].t_ns > 9e9
        bound_ns = last[node].bound_ns  # 0 while only the farther one of the two has joined: there is none
        assert bound_ns == 0 or bound_ns + 1000 > last[node].deadline_ns
    assert summary["admission"]["nodes_without"] > 0
    assert summary["admission"]["deadline_ms"] == pytest.approx(500 * (few + many), abs=0.01)


def test_a_deadline_needs_a_protocol_that_refuses_what_would_be_late() -> None:
    with pytest.raises(ConfigError, match="needs a protocol that refuses what would be late"):
        catalog.find("clusters", ["traffic.deadline_s=1", "clusters.relay=all"])
