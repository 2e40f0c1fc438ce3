"""What clocks did to a run, on samples written by hand."""

from collections.abc import Callable
from typing import Any

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import ClockSampled, Delivered, Generated, Record
from fanet_mw.units import MS, US, S
from sim.records.trace_log import TraceLog
from sim.results.clocks import clock_errors, true_delays
from sim.results.metrics import summarize
from sim.results.outcome import Outcome

MakeScenario = Callable[..., Scenario]


def errors(make_scenario: MakeScenario, *records: Record) -> dict[str, Any]:
    scenario = make_scenario(**{"nodes.count": 2, "clock.sync": "beacons", "clock.drift_ppm": 10})
    return clock_errors(Outcome(scenario, "virtual", 1.0, list(records), {}))


def sample(node: int, ahead_us: float, *, bound_us: float = 10, reference: int = 1, t_s: float = 5) -> ClockSampled:
    return ClockSampled(round(t_s * S), node, round(ahead_us * US), round(bound_us * US), reference, node - 1)


def test_an_error_is_against_the_clock_of_the_reference(make_scenario: MakeScenario) -> None:
    found = errors(make_scenario, sample(1, 500, bound_us=0), sample(2, 503))
    assert found["error_us"] == {"p50": 1.5, "p99": pytest.approx(2.97), "max": 3.0}
    assert found["beyond_bound"] == 0
    assert (found["bound_us"], found["samples"], found["synced_after_s"]) == (10, 2, 5)


def test_while_the_program_of_the_reference_does_not_run_its_clock_is_taken_to_go_on_as_before(
    make_scenario: MakeScenario,
) -> None:
    own = [sample(1, 900 + 5 * t_s, bound_us=0, t_s=t_s) for t_s in (1, 2, 3, 7)]
    found = errors(make_scenario, *own, *(sample(2, 903 + 5 * t_s, t_s=t_s) for t_s in (3, 4, 6)))
    assert found["error_us"]["max"] == 3.0
    jumped = [sample(1, 900, bound_us=0, t_s=1), sample(1, 300_900, bound_us=0, t_s=2)]
    assert errors(make_scenario, *jumped, sample(2, 300_903, t_s=6))["error_us"]["max"] == 3.0
    assert errors(make_scenario, sample(2, 7, t_s=6, reference=9))["error_us"]["max"] == 7.0, "nobody's clock"


@pytest.mark.parametrize(("error_us", "beyond"), [(10, 0), (10.001, 1), (-10.001, 1), (19, 1)])
def test_an_error_beyond_its_bound_is_counted_by_however_little(
    make_scenario: MakeScenario, error_us: float, beyond: int
) -> None:
    found = errors(make_scenario, sample(1, 0, bound_us=0), sample(2, error_us))
    assert found["beyond_bound"] == beyond


@pytest.mark.parametrize(("error_us", "valid"), [(10, True), (10.001, False)])
def test_a_run_in_which_a_clock_was_off_by_more_than_it_said_is_not_valid(
    make_scenario: MakeScenario, error_us: float, *, valid: bool
) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "clock.sync": "beacons", "clock.drift_ppm": 10})
    outcome = Outcome(scenario, "virtual", 1.0, [sample(1, 0, bound_us=0), sample(2, error_us)], {})
    reasons = summarize(outcome, trace_sha256="")["invalid_because"]
    assert reasons == (
        [] if valid else ["clocks that were off by more than their nodes stated: 1 of 2 samples, limit 0"]
    )


def test_delays_run_from_the_true_instant_of_generation() -> None:
    believed = Delivered(30 * MS, 2, 1, 7, 3 * MS, 1)
    log = TraceLog()
    log.extend([Generated(10 * MS, 1, 7, "traffic", 100), believed, believed._replace(seq=8)])
    found = true_delays(log)
    assert [record.delay_ns for record in found if isinstance(record, Delivered)] == [20 * MS, 3 * MS]
