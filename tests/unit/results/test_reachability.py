"""Deliveries are held against an ideal flood over the links as they were: traces by hand, reach 250 m."""

import io
from typing import Any

import pytest
from rich.console import Console

from fanet_mw.scenario import Scenario
from fanet_mw.trace import BoundStated, Delivered, Generated, Posed, RadioFault, Record
from fanet_mw.units import MS, S
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.results.printed_summary import show

NEAR, FAR = 200.0, 2000.0


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(
        **{
            "nodes.count": 3, "traffic.sources": "all", "traffic.interval_s": 1, "duration_s": 10, "radio.range_m": 250,
            "radio.channel": "range", "routing.lifetime_s": 3,
        }
    )  # fmt: skip
    return scenario


def poses(second: int, *east_m: float) -> list[Record]:
    return [Posed(second * S, node, east, 0.0, 50.0) for node, east in enumerate(east_m, start=1)]


def flight(away_until_s: int) -> list[Record]:
    """Nodes 1 and 2 are neighbors; node 3 is far away until an instant, then a neighbor of node 2."""
    return [each for t in range(11) for each in poses(t, 0.0, NEAR, FAR if t < away_until_s else 2 * NEAR)]


def packet(t_s: float, *arrived: tuple[int, float], seq: int = 1, bound_ms: float | None = None) -> list[Record]:
    """A packet of node 1, and who had it after which time [s]."""
    t_ns = round(t_s * S)
    stated = [] if bound_ms is None else [BoundStated(t_ns, 1, seq, round(bound_ms * MS))]
    came = [Delivered(t_ns + round(s * S), node, 1, seq, round(s * S), 1) for node, s in arrived]
    return [Generated(t_ns, 1, seq, "traffic", 100), *stated, *came]


def reachable(scenario: Scenario, *parts: list[Record]) -> dict[str, Any]:
    records = sorted((record for part in parts for record in part), key=lambda record: record.t_ns)
    summary = summarize(Outcome(scenario, "virtual", 1.0, records, {}), trace_sha256="")
    found: dict[str, Any] = summary["reachable"]["traffic"]
    return found


def test_who_is_never_in_reach_counts_against_nobody(scenario: Scenario) -> None:
    found = reachable(scenario, flight(99), packet(2, (2, 0.1)))
    assert (found["share"], found["pdr"]) == (0.5, 1.0)


def test_a_run_in_which_nobody_was_ever_in_reach_is_printed(scenario: Scenario) -> None:
    lonely = [each for t in range(11) for each in poses(t, 0.0, FAR, 2 * FAR)]
    summary = summarize(Outcome(scenario, "virtual", 1.0, [*lonely, *packet(2)], {}), trace_sha256="")
    assert summary["reachable"]["traffic"]["pdr"] is None
    show(summary, console := Console(width=200, record=True, file=io.StringIO()))
    assert "nobody (traffic)" in console.export_text()


def test_who_was_in_reach_and_got_nothing_counts(scenario: Scenario) -> None:
    found = reachable(scenario, flight(0), packet(2, (2, 0.1)))
    assert (found["share"], found["pdr"]) == (1.0, 0.5)


@pytest.mark.parametrize(("comes_s", "share"), [(4, 1.0), (5, 1.0), (7, 0.5)])
def test_a_neighbor_carries_a_packet_to_who_comes_within_its_lifetime(
    scenario: Scenario, comes_s: int, share: float
) -> None:
    assert reachable(scenario, flight(comes_s), packet(2, (2, 0.1)))["share"] == share


def test_nobody_brings_back_a_packet_through_a_link_that_was_before_it(scenario: Scenario) -> None:
    gone = [each for t in range(11) for each in poses(t, 0.0, NEAR, 2 * NEAR if t < 3 else FAR)]
    assert reachable(scenario, gone, packet(4.5, (2, 0.1)))["share"] == 0.5


def test_what_arrived_was_reachable_whatever_distance_says(scenario: Scenario) -> None:
    found = reachable(scenario, flight(99), packet(2, (2, 0.1), (3, 0.2)))
    assert (found["share"], found["pdr"]) == (1.0, 1.0)


def test_a_packet_whose_lifetime_is_not_over_is_left_out(scenario: Scenario) -> None:
    found = reachable(scenario, flight(0), packet(2, (2, 0.1), (3, 0.1)), packet(8, (2, 0.1), seq=2))
    assert (found["packets"], found["left_out"], found["pdr"]) == (1, 1, 1.0)


def test_a_cut_radio_reaches_nobody(scenario: Scenario) -> None:
    cut: list[Record] = [RadioFault(0, 2, 0, "cut", "a", active=True)]
    assert reachable(scenario, cut, flight(0), packet(2, (2, 0.1)))["share"] == 0.5


def test_over_a_partition_nobody_is_reached_until_it_ends(scenario: Scenario) -> None:
    begins = RadioFault(0, 0, 0, "partition", "a", active=True, extent="nodes 3")
    cut: list[Record] = [begins, begins._replace(t_ns=4 * S, active=False)]
    assert reachable(scenario, cut[:1], flight(0), packet(2, (2, 0.1)))["share"] == 0.5
    assert reachable(scenario, cut, flight(0), packet(2, (2, 0.1)))["share"] == 1.0


def test_the_bound_is_asked_of_those_that_were_in_reach_within_it(scenario: Scenario) -> None:
    found = reachable(scenario, flight(4), packet(2, (2, 0.1), (3, 2.5), bound_ms=500))
    assert (found["pdr"], found["within_share"]) == (1.0, 1.0)
    late = reachable(scenario, flight(0), packet(2, (2, 0.1), (3, 2.5), bound_ms=500))
    assert (late["pdr"], late["within_share"]) == (1.0, 0.5)


def test_a_report_is_not_meant_for_the_node_that_made_it(scenario: Scenario) -> None:
    came = [Delivered(2 * S + 9, node, 1, 1, 9, 1) for node in (2, 3)]
    records = sorted([*flight(0), Generated(2 * S, 1, 1, "report", 100), *came], key=lambda record: record.t_ns)
    summary = summarize(Outcome(scenario, "virtual", 1.0, records, {}), trace_sha256="")
    assert (summary["reachable"]["report"]["share"], summary["reachable"]["report"]["pdr"]) == (1.0, 1.0)
