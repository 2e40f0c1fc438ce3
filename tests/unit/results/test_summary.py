"""The parts of a summary that are about the mission, admission and delays, on traces written by hand."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Arrived, Collided, DeadlineLost, DeadlineMet, Detected, Dropped, Record
from fanet_mw.units import MS, S
from sim.results.metrics import summarize, summed_up
from sim.results.outcome import Outcome
from sim.results.printed_summary import show
from sim.world.environment.survivors import place

MakeScenario = Callable[..., Scenario]


def summary_of(scenario: Scenario, *records: Record) -> dict[str, Any]:
    return summarize(Outcome(scenario, "virtual", 1.0, list(records), {}), trace_sha256="")


def test_the_error_of_a_localization_is_its_distance_from_the_truth(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 3, "mission.survivors": 2})
    at = place(scenario)[1]
    mission = summary_of(
        scenario,
        Detected(1 * S, 2, 2, -70.0),
        Approaching(2 * S, 2, 2, 3, at.east + 30, at.north + 40),
        Approaching(4 * S, 2, 2, 3, at.east + 3, at.north - 4),
        Arrived(9 * S, 2, 2),
    )["mission"]
    assert mission["localization_error_m"] == pytest.approx((50 + 5) / 2)
    assert (mission["detected"], mission["approached"], mission["reached"]) == (1, 1, 1)
    assert mission["time_to_approach_s"] == [2.0]


def test_delays_are_summed_up_in_milliseconds() -> None:
    """1 ms to 101 ms: half of them up to 51 ms."""
    figures = summed_up(np.arange(1, 102) * MS)
    assert figures == {"mean": 51.0, "p50": 51.0, "p95": 96.0, "p99": 100.0, "max": 101.0}


def test_what_was_refused_and_who_has_no_deadline_is_counted(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 4, "traffic.deadline_s": 0.5, "clusters.relay": "scheduled"}
    admission = summary_of(
        make_scenario(**keys),
        DeadlineMet(1 * S, 2, 300 * MS, 500 * MS, 100 * MS),
        DeadlineMet(1 * S, 3, 300 * MS, 500 * MS, 100 * MS),
        DeadlineLost(5 * S, 3, 600 * MS, 500 * MS, 100 * MS),
        Dropped(6 * S, 2, DropReason.ADMISSION, 2, 1),
        Dropped(6 * S, 2, DropReason.EXPIRED, 2, 2),
    )["admission"]
    assert admission == {"deadline_ms": 500, "refused": 1, "lost": 1, "met": 2, "nodes_without": 1}


def test_contacts_and_entries_into_no_fly_areas_are_printed_without_survivors_too(make_scenario: MakeScenario) -> None:
    outcome = Outcome(
        make_scenario(**{"nodes.count": 4}), "virtual", 1.0, [Collided(1 * S, 1, 2), Collided(2 * S, 3, 0)],
        {"world": {"no_fly_entries": 7}},
    )  # fmt: skip
    summary = summarize(outcome, trace_sha256="")
    assert summary["no_fly_entries"] == 7
    show(summary, console := Console(width=200, record=True, file=io.StringIO()))
    printed = console.export_text()
    assert "collisions    2" in printed
    assert "entered 7 times" in printed
