"""What the summary counts, on traces written by hand."""

from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import BoundStated, Delivered, Generated, Record
from fanet_mw.units import MS, S
from sim.results.metrics import summarize
from sim.results.outcome import Outcome

A_PACKET = 7


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(**{"nodes.count": 4, "traffic.sources": "all", "traffic.interval_s": 1})
    return scenario


def summary_of(scenario: Scenario, *records: Record) -> dict[str, Any]:
    return summarize(Outcome(scenario, "virtual", 1.0, list(records), {}), trace_sha256="")


def generated(app: str, *, node: int = 2, t_ns: int = 5 * S) -> Generated:
    return Generated(t_ns, node, A_PACKET, app, 100)


def delivered(node: int, *, origin: int = 2, after_ms: int = 10) -> Delivered:
    return Delivered(5 * S + after_ms * MS, node, origin, A_PACKET, after_ms * MS, 1)


@pytest.mark.parametrize(("app", "key"), [("traffic", None), ("report", "reports"), ("warning", "warnings")])
def test_a_delivery_that_a_restarted_node_repeats_counts_once_and_is_said(
    scenario: Scenario, app: str, key: str | None
) -> None:
    deliveries = [delivered(1), delivered(3, after_ms=20), delivered(4, after_ms=30), delivered(3, after_ms=2000)]
    summary = summary_of(scenario, generated(app), *deliveries)
    part = summary[key] if key else summary
    assert (part["generated"], part["delivered"], part["repeated"]) == (1, 3, 1)
    assert part["pdr"] == 1
    assert part["delay_ms"]["max"] == 30, "the second time says nothing of how long the packet took"


@pytest.mark.parametrize("app", ["traffic", "report", "warning"])
def test_a_restarted_origin_that_hears_its_own_packet_is_none_of_its_targets(scenario: Scenario, app: str) -> None:
    summary = summary_of(scenario, generated(app), delivered(1), delivered(2))
    part = summary if app == "traffic" else summary[f"{app}s"]
    assert (part["delivered"], part["repeated"]) == (1, 0)
    assert part["pdr"] == pytest.approx(1 / 3, abs=1e-6)


def test_a_repeated_delivery_does_not_make_a_node_look_better_than_it_is(scenario: Scenario) -> None:
    summary = summary_of(scenario, generated("traffic"), delivered(1), delivered(1, after_ms=500), delivered(3))
    assert summary["worst_nodes"][0] == {"node": 4, "pdr": 0.0}
    assert {item["pdr"] for item in summary["worst_nodes"][1:]} == {1.0}


def test_who_is_no_target_of_the_traffic_does_not_count(make_scenario: Any) -> None:
    chosen = make_scenario(**{"nodes.count": 4, "traffic.sources": "all", "traffic.targets": [1]})
    summary = summary_of(chosen, generated("traffic"), delivered(3), delivered(4))
    assert (summary["delivered"], summary["pdr"]) == (0, 0.0)


def test_a_bound_counts_whether_its_record_comes_before_or_after_the_packets_own(scenario: Scenario) -> None:
    """In real time, records of one instant are in the order of their kinds' names."""
    stated = BoundStated(5 * S, 2, A_PACKET, 15 * MS)
    deliveries = [delivered(1), delivered(3, after_ms=20), delivered(4)]
    before = summary_of(scenario, stated, generated("traffic"), *deliveries)["bound"]
    after = summary_of(scenario, generated("traffic"), stated, *deliveries)["bound"]
    assert before == after
    assert (after["deliveries"], after["violations"]) == (3, 1)


def test_the_paces_of_the_clock_say_for_how_many_wall_seconds_it_ran_at_each() -> None:
    scenario = Scenario(duration_s=20)
    changes = [(5 * S, 0.5), (6 * S, 0.6), (9 * S, 0.5), (10 * S, 0.1 + 0.2 + 0.3), (13 * S, 1.0)]
    found = summarize(Outcome(scenario, "realtime", 32.0, [], {}, slowed=changes), trace_sha256="")
    assert found["paces"] == [
        {"time_scale": 1.0, "wall_s": 12.0}, {"time_scale": 0.6, "wall_s": 10.0}, {"time_scale": 0.5, "wall_s": 4.0},
    ]  # fmt: skip
    assert summarize(Outcome(scenario, "virtual", 1.0, [], {}), trace_sha256="")["paces"] == []
