"""What the summary says of conflicts: who foresaw them, how long ahead, and whom the warnings reached."""

from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import ConflictForeseen, Delivered, Record, Warned
from fanet_mw.units import MS, US, S
from sim.results.metrics import separation
from sim.results.outcome import Outcome


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(**{"nodes.count": 4})
    return scenario


def said_of(scenario: Scenario, *records: Record, watched: bool = True) -> dict[str, Any]:
    reports = {"world": {"separation": {"losses": 2, "least_m": 9.5}}} if watched else {}
    return separation(Outcome(scenario, "virtual", 1.0, list(records), reports))


def foreseen(closest_ms: int, *, told: bool = False) -> ConflictForeseen:
    return ConflictForeseen(S, 1, 2, closest_ms, 5.0, told)


def delivered(node: int, seq: int, delay_ns: int, *, origin: int = 1) -> Delivered:
    return Delivered(2 * S, node, origin, seq, delay_ns, 1)


def test_conflicts_are_counted_with_the_shortest_and_the_middle_time_ahead(scenario: Scenario) -> None:
    records = [foreseen(4000), foreseen(1500, told=True), foreseen(9000), foreseen(2000, told=True)]
    found = said_of(scenario, *records)
    assert (found["losses"], found["least_m"], found["foreseen"], found["told"]) == (2, 9.5, 4, 2)
    assert found["ahead_s"] == {"least": 1.5, "p50": 4.0}
    assert said_of(scenario, *records[:3])["ahead_s"] == {"least": 1.5, "p50": 4.0}
    assert (found["warnings"], found["reached_the_other"], found["to_the_other_ms"]) == (0, None, {})


def test_a_warning_counts_as_received_by_the_one_it_is_about_and_by_nobody_else(scenario: Scenario) -> None:
    warned = [Warned(S, 1, 3, 7), Warned(S, 1, 4, 8), Warned(S, 2, 3, 7)]
    received = [
        delivered(3, 7, 10 * MS), delivered(4, 7, 99 * MS), delivered(3, 8, 99 * MS), delivered(4, 8, 20 * MS + 4 * US),
        delivered(4, 7, 99 * MS, origin=2), delivered(3, 9, 99 * MS),
    ]  # fmt: skip
    found = said_of(scenario, *warned, *received)
    assert (found["warnings"], found["reached_the_other"]) == (3, 0.666667)
    assert found["to_the_other_ms"] == {"p50": 15.002, "p95": 19.504, "max": 20.004}
    assert said_of(scenario, *warned)["reached_the_other"] == 0.0
    assert said_of(scenario, foreseen(1))["ahead_s"] == {"least": 0.001, "p50": 0.001}


def test_nothing_is_said_of_a_separation_that_nobody_watched(scenario: Scenario) -> None:
    assert said_of(scenario, foreseen(4000), watched=False) == {}
