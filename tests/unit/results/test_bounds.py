"""Bounds that are broken are counted, one by one, by what comes too late and by what never comes: traces by hand."""

import io
from typing import Any

import pytest
from rich.console import Console

from fanet_mw.scenario import Scenario
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Generated, LikelyStated, RadioFault, Record
from fanet_mw.units import MS, S
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.results.printed_summary import show


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(**{"nodes.count": 3, "traffic.sources": "all", "traffic.interval_s": 1})
    return scenario


def packet(seq: int, *, bound_ms: float | None, delays_ms: dict[int, float], node: int = 1) -> list[Record]:
    """A packet of a node, promised `bound_ms`, and when the others had it."""
    stated = [] if bound_ms is None else [BoundStated(seq * S, node, seq, round(bound_ms * MS))]
    arrived = {at: round(delay_ms * MS) for at, delay_ms in delays_ms.items()}
    deliveries = [Delivered(seq * S + ns, at, node, seq, ns, 1) for at, ns in arrived.items()]
    return [Generated(seq * S, node, seq, "traffic", 100), *stated, *deliveries]


def bound_of(scenario: Scenario, *packets: list[Record]) -> dict[str, Any]:
    records = [record for records in packets for record in records]
    outcome = Outcome(scenario, "virtual", 1.0, records, {})
    found: dict[str, Any] = summarize(outcome, trace_sha256="")["bound"]
    return found


@pytest.mark.parametrize(
    ("delay_ms", "violations"), [(1, 0), (99.999999, 0), (100, 0), (100.000001, 1), (101, 1), (150, 1), (201, 1)]
)
def test_a_delivery_a_nanosecond_later_than_promised_breaks_its_bound(
    scenario: Scenario, delay_ms: float, violations: int
) -> None:
    bound = bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: delay_ms, 3: 50}))
    assert (bound["deliveries"], bound["violations"]) == (2, violations)
    assert bound["within_share"] == (2 - violations) / 2


def test_each_packet_is_held_against_its_own_promise(scenario: Scenario) -> None:
    bound = bound_of(
        scenario,
        packet(1, bound_ms=100, delays_ms={2: 90, 3: 110}),
        packet(2, bound_ms=200, delays_ms={2: 90, 3: 110}),
        packet(3, bound_ms=50, delays_ms={2: 90, 3: 110}),
    )
    assert bound["violations"] == 3
    assert bound["worst_ms"] == 200
    assert bound["observed_max_ms"] == 110
    assert bound["within_share"] == 0.5


def test_what_never_arrives_breaks_its_bound_at_each_target_as_what_arrives_too_late(scenario: Scenario) -> None:
    bound = bound_of(scenario, packet(1, bound_ms=100, delays_ms={}), packet(2, bound_ms=100, delays_ms={2: 10}))
    assert (bound["violations"], bound["deliveries"], bound["within_share"]) == (3, 1, 0.25)
    late = bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: 101}))
    assert (late["violations"], late["deliveries"]) == (2, 1), "one came too late, one never"


@pytest.mark.parametrize(
    ("delays_ms", "violations"), [({2: 90, 3: 9000}, 0), ({2: 90}, 0), ({3: 10}, 1), ({2: 101}, 1)]
)
def test_a_bound_counts_for_those_for_whom_it_was_stated(
    scenario: Scenario, delays_ms: dict[int, float], violations: int
) -> None:
    without = [BoundExcludes(1 * S, 1, 1, 3)]
    assert bound_of(scenario, packet(1, bound_ms=100, delays_ms=delays_ms), without)["violations"] == violations


@pytest.mark.parametrize("delays_ms", [{2: 101, 3: 10}, {2: 10}])
def test_a_run_in_which_a_bound_did_not_hold_is_not_valid(scenario: Scenario, delays_ms: dict[int, float]) -> None:
    outcome = Outcome(scenario, "virtual", 1.0, packet(1, bound_ms=100, delays_ms=delays_ms), {})
    (reason,) = summarize(outcome, trace_sha256="")["invalid_because"]
    assert reason == "delay bounds that did not hold: 1, limit 0"
    kept = Outcome(scenario, "virtual", 1.0, packet(1, bound_ms=100, delays_ms={2: 99, 3: 10}), {})
    assert summarize(kept, trace_sha256="")["valid"]


def test_a_bound_that_was_not_over_by_the_end_is_not_broken_yet(scenario: Scenario) -> None:
    last_s = int(scenario.duration_s) - 1
    records = packet(last_s, bound_ms=1500, delays_ms={2: 10})
    assert bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: 10, 3: 10}), records)["violations"] == 0
    records = packet(last_s, bound_ms=500, delays_ms={2: 10})
    assert bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: 10, 3: 10}), records)["violations"] == 1


def fault(at_s: float, *, kind: str = "cut", active: bool = True, label: str = "one") -> RadioFault:
    return RadioFault(round(at_s * S), 3, 0, kind, label, active)


@pytest.mark.parametrize(
    ("faults", "overtaken"),
    [
        ([fault(2.101)], 0),
        ([fault(2.1)], 2),
        ([fault(-2.0)], 2),
        ([fault(-2.001)], 0),
        ([fault(-9), fault(2.05, active=False)], 0),
        ([fault(-9), fault(-3, label="two")], 0),
        ([fault(-9), fault(1, label="two")], 2),
        ([fault(-9, kind="partition")], 2),
        ([fault(-9, kind="jam"), fault(1.9, kind="jam", active=False)], 0),
        ([fault(-9, kind="jam"), fault(2.0, kind="jam", active=False)], 2),
        ([fault(-9, kind="jam"), fault(1.9, kind="jam", active=False, label="two")], 2),
        ([fault(1, kind="jam"), fault(1.1, kind="jam", active=False)], 2),
        ([fault(3, kind="jam")], 0),
    ],
)
def test_a_fault_overtakes_bounds_that_are_not_over_and_those_of_who_need_not_know_of_it(
    scenario: Scenario, faults: list[Record], overtaken: int
) -> None:
    """A packet born at 2 s with a bound of 100 ms, which one other receives too late and one never."""
    kept = packet(5, bound_ms=100, delays_ms={2: 10, 3: 10})
    bound = bound_of(scenario, packet(2, bound_ms=100, delays_ms={2: 101}), kept, faults)
    assert (bound["violations"], bound["overtaken"]) == (2, overtaken)
    assert bound["classes"]["traffic"]["overtaken"] == overtaken


def test_a_run_with_a_fault_is_valid_if_all_bounds_hold_that_it_did_not_overtake(scenario: Scenario) -> None:
    late = packet(2, bound_ms=100, delays_ms={2: 101, 3: 10})
    again = packet(7, bound_ms=100, delays_ms={2: 101, 3: 10})
    for records, valid in (([*late], False), ([*late, fault(1)], True), ([*late, *again, fault(1)], False)):
        outcome = Outcome(scenario, "virtual", 1.0, records, {})
        assert summarize(outcome, trace_sha256="")["valid"] is valid


def test_a_packet_without_a_promise_counts_for_the_share_and_not_as_broken(scenario: Scenario) -> None:
    bound = bound_of(
        scenario,
        packet(1, bound_ms=100, delays_ms={2: 10, 3: 10}),
        packet(2, bound_ms=None, delays_ms={2: 10, 3: 9000}),
    )
    assert (bound["deliveries"], bound["violations"]) == (2, 0)
    assert (bound["within_share"], bound["stated_share"]) == (0.5, 0.5)
    assert bound_of(scenario, packet(1, bound_ms=None, delays_ms={2: 10})) == {}


def test_a_delivery_at_a_node_that_is_no_target_neither_keeps_nor_breaks_a_bound(make_scenario: Any) -> None:
    chosen = make_scenario(**{"nodes.count": 3, "traffic.sources": "all", "traffic.targets": [2]})
    bound = bound_of(chosen, packet(1, bound_ms=100, delays_ms={2: 50, 3: 500}))
    assert (bound["deliveries"], bound["violations"], bound["within_share"]) == (1, 0, 1.0)


def test_a_stated_share_is_held_against_the_copies_of_the_packets_it_is_about(scenario: Scenario) -> None:
    """Four copies of packets with a statement: one in time to the nanosecond, one late, one lost, one in time."""
    records = [
        *packet(1, bound_ms=None, delays_ms={2: 100, 3: 100.000001}),
        *packet(2, bound_ms=None, delays_ms={2: 10}),
        *packet(3, bound_ms=None, delays_ms={2: 1, 3: 1}),
        LikelyStated(1 * S, 1, 1, 100 * MS, 0.99),
        LikelyStated(2 * S, 1, 2, 50 * MS, 0.95),
    ]
    summary = summarize(Outcome(scenario, "virtual", 1.0, records, {}), trace_sha256="")
    assert summary["likely"] == {"share": 0.95, "within_share": 0.5, "stated_share": 0.666667, "worst_ms": 100}


def test_a_likely_delay_is_not_held_against_nodes_that_are_gone(scenario: Scenario) -> None:
    records = [
        *packet(1, bound_ms=None, delays_ms={2: 100, 3: 1}),
        LikelyStated(1 * S, 1, 1, 100 * MS, 0.99),
        BoundExcludes(1 * S, 1, 1, 3),
    ]
    summary = summarize(Outcome(scenario, "virtual", 1.0, records, {}), trace_sha256="")
    assert summary["likely"]["within_share"] == 1.0


def test_that_others_are_gone_excuses_no_packet_for_one_receiver(make_scenario: Any) -> None:
    chosen = make_scenario(**{"nodes.count": 3, "traffic.sources": "all", "traffic.targets": [2]})
    bound = bound_of(chosen, packet(1, bound_ms=100, delays_ms={}), [BoundExcludes(1 * S, 1, 1, 3)])
    assert (bound["never"], bound["violations"]) == (1, 1)


def test_without_a_statement_there_is_nothing_to_hold(scenario: Scenario) -> None:
    outcome = Outcome(scenario, "virtual", 1.0, packet(1, bound_ms=100, delays_ms={2: 1}), {})
    assert summarize(outcome, trace_sha256="")["likely"] == {}


def test_packets_of_users_whose_targets_nobody_knows_are_in_no_share(scenario: Scenario) -> None:
    """Their delays are judged, but they fill no share: without targets there is nothing to divide by."""
    of_user = [Generated(5 * S, 1, 5, "mine", 100), Delivered(5 * S + 200 * MS, 2, 1, 5, 200 * MS, 1)]
    promised = [*of_user, BoundStated(5 * S, 1, 5, 100 * MS)]
    bound = bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: 50, 3: 50}), promised)
    assert (bound["within_share"], bound["violations"], bound["deliveries"]) == (1.0, 1, 3)
    in_time = [*of_user, BoundStated(5 * S, 1, 5, 300 * MS)]
    bound = bound_of(scenario, packet(1, bound_ms=100, delays_ms={2: 50}), in_time)
    assert bound["within_share"] == 0.5
    assert bound["classes"]["mine"]["within_share"] is None


def test_a_likely_delay_of_users_packets_alone_has_no_share(scenario: Scenario) -> None:
    stated = [
        Generated(5 * S, 1, 5, "mine", 100),
        LikelyStated(5 * S, 1, 5, 300 * MS, 0.99),
        Delivered(5 * S + 200 * MS, 2, 1, 5, 200 * MS, 1),
    ]
    summary = summarize(Outcome(scenario, "virtual", 1.0, stated, {}), trace_sha256="")
    assert summary["likely"] == {"share": 0.99, "within_share": None, "stated_share": 1.0, "worst_ms": 300}
    console = Console(width=200, record=True, file=io.StringIO())
    show(summary, console)
    assert "- of the copies within what was stated" in console.export_text()
    both = [*stated, *packet(1, bound_ms=None, delays_ms={2: 10}), LikelyStated(1 * S, 1, 1, 100 * MS, 0.99)]
    summary = summarize(Outcome(scenario, "virtual", 1.0, both, {}), trace_sha256="")
    assert summary["likely"]["within_share"] == 0.5
