"""`fanet plan` before take-off against what the same swarm then does."""

import json
import subprocess
import sys
from typing import Any

import pytest

from sim import catalog
from sim.plan_cli import judge
from sim.results import finish
from sim.run import simulate


def planned(*settings: str, deadline_s: float | None = None, search: bool = False) -> tuple[str, dict[str, Any], bool]:
    return judge(catalog.find("clusters", settings), deadline_s=deadline_s, search=search)


@pytest.mark.parametrize("settings", [(), ("radio.lead_ms=10", "clusters.flooding_period_s=1")])
def test_the_bound_that_is_planned_is_the_one_that_the_nodes_compute_in_flight(settings: tuple[str, ...]) -> None:
    scenario = catalog.find("clusters", ["duration_s=20", "warmup_s=12", *settings])
    bound = finish(simulate(scenario), out=None)["bound"]
    _, plan, feasible = judge(scenario, deadline_s=None, search=False)
    assert feasible
    assert plan["bound_ns"] / 1e6 == pytest.approx(bound["worst_ms"], abs=1e-3)


def test_a_load_that_does_not_fit_is_told_with_the_one_that_does() -> None:
    text, plan, feasible = planned("traffic.interval_s=0.1")
    assert not feasible
    assert "at most one every 0.5" in text
    least_s = plan["least_interval_ns"] / 1e9
    assert planned(f"traffic.interval_s={least_s + 0.001}")[2]


def test_the_change_that_it_proposes_makes_it_feasible() -> None:
    _, plan, feasible = planned("radio.channel=log_distance", search=True)
    assert not feasible
    assert planned("radio.channel=log_distance", *plan["change"])[2]


def test_a_deadline_that_cannot_be_met_is_no_plan() -> None:
    assert planned(deadline_s=0.6)[2]
    text, _, feasible = planned(deadline_s=0.3)
    assert not feasible
    assert "worst delay is 528.2 ms, the deadline 300 ms" in text


def test_a_swarm_in_parts_is_told() -> None:
    text, _, feasible = planned("nodes.spacing_m=300")
    assert not feasible
    assert "the swarm is in parts" in text


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("clusters", "--json"), 0, '"feasible": true'),
        (("clusters", "--deadline", "0.3"), 1, "not feasible"),
        (("rescue",), 0, "equations (1)-(4)"),
        (("flooding",), 2, 'only "clustered" can be planned'),
    ],
)
def test_the_command_prints_its_verdict_and_ends_with_it(arguments: tuple[str, ...], code: int, said: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sim.cli", "plan", *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == code, done.stderr
    assert said in done.stdout + done.stderr
    if "--json" in arguments:
        assert json.loads(done.stdout)["turns"] == 375
