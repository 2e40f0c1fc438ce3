"""Whether clusters are in one piece, and near their heads: roles and places by hand, reach 250 m."""

from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record, RoleChanged
from fanet_mw.units import S
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from tests.unit.results.test_reachability import poses


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(
        **{"nodes.count": 6, "duration_s": 10, "radio.range_m": 250, "radio.channel": "range", "warmup_s": 2}
    )
    return scenario


def clusters(scenario: Scenario, *roles: RoleChanged, line: tuple[float, ...]) -> dict[str, Any]:
    flown = [each for t in range(11) for each in poses(t, *line)]
    records: list[Record] = sorted([*roles, *flown], key=lambda record: record.t_ns)
    found: dict[str, Any] = summarize(Outcome(scenario, "virtual", 1.0, records, {}), trace_sha256="")["clusters"]
    return found


def joined(head: int, *nodes: int, t_s: float = 0.0) -> list[RoleChanged]:
    return [RoleChanged(round(t_s * S), node, "head" if node == head else "member", head, head) for node in nodes]


CHAIN = (0.0, 200.0, 400.0, 600.0, 800.0, 1000.0)


def test_without_clusters_there_are_no_figures(scenario: Scenario) -> None:
    assert clusters(scenario, line=CHAIN) == {}


def test_a_chain_in_two_halves_is_whole(scenario: Scenario) -> None:
    found = clusters(scenario, *joined(2, 1, 2, 3), *joined(5, 4, 5, 6), line=CHAIN)
    assert found["torn"] == 0
    assert found["hops_to_head"] == {"mean": 1.0, "p95": 1.0, "far": 0.0}
    assert found["sizes"] == {"least": 3, "p50": 3, "most": 3}
    assert found["role_changes"] == 0


def test_members_at_both_ends_tear_their_cluster_and_are_far_from_its_head(scenario: Scenario) -> None:
    found = clusters(scenario, *joined(1, 1, 2, 6), *joined(4, 3, 4, 5), line=CHAIN)
    assert found["torn"] == 0.5
    assert found["hops_to_head"]["p95"] == 5
    assert found["hops_to_head"]["far"] == 0.25


def test_a_member_without_a_way_is_far(scenario: Scenario) -> None:
    found = clusters(scenario, *joined(1, 1, 2, 6), line=(0.0, 200.0, 1000.0, 1200.0, 1400.0, 1600.0))
    assert found["torn"] == 1
    assert found["hops_to_head"] == {"mean": 1.0, "p95": 1.0, "far": 0.5}


def test_changes_are_counted_a_node_and_minute_and_only_after_the_warm_up(scenario: Scenario) -> None:
    roles = [*joined(2, 1, 2, 3), *joined(3, 3, t_s=1.0), *joined(2, 3, t_s=4.0), *joined(3, 3, t_s=6.0)]
    assert clusters(scenario, *roles, line=CHAIN)["role_changes"] == round(2 / (6 * 8 / 60), 3)
