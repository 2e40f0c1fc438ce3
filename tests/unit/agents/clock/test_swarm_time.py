"""Swarm time by GPS, and what is known of clocks that nothing synchronizes, or that have a data sheet."""

from collections.abc import Callable

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from agents.clock.swarm_time import GpsTime, oscillator, swarm_time
from fanet_mw.routing.clustered.tdma.turn_timing import turn_slack_ns
from fanet_mw.scenario import Clock, Scenario
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.units import MS, US, NodeId, S
from sim.planner.problems_and_notes import clocks_apart
from sim.scenarios import catalog

MakeScenario = Callable[..., Scenario]
OFFSET_NS = 3 * MS


@pytest.fixture
def clock(make_scenario: MakeScenario) -> Clock:
    keys = {"clock.sync": "gps", "clock.drift_ppm": 20, "clock.gps_sigma_ns": 1000, "clock.offset_ms": 10}
    return make_scenario(**{"nodes.count": 2, **keys}).clock


def test_swarm_time_follows_the_fixes_within_the_stated_bound(clock: Clock) -> None:
    time = GpsTime(clock, seed=1, node=NodeId(2))
    assert time.error_ns(0) is None
    for second in range(20):
        time.fix(second * S, second * S + OFFSET_NS)
    error_ns = time.error_ns(20 * S)
    assert error_ns is not None
    assert 4 * clock.gps_sigma_ns <= error_ns < 50 * US, "a single fix may be four sigmas off"
    assert abs(time.line.swarm_ns(20 * S) - 20 * S - OFFSET_NS) <= error_ns


def test_a_single_fix_may_be_four_sigmas_off(make_scenario: MakeScenario) -> None:
    keys = {"clock.sync": "gps", "clock.drift_ppm": 20, "clock.gps_sigma_ns": 50_000}
    time = GpsTime(make_scenario(**{"nodes.count": 2, **keys}).clock, seed=1, node=NodeId(2))
    time.fix(1 * S, 1 * S)
    error_ns = time.error_ns(1 * S)
    assert error_ns is not None
    assert 200 * US <= error_ns < 220 * US


def test_a_fix_far_from_the_own_clock_is_not_believed(clock: Clock) -> None:
    time = GpsTime(clock, seed=1, node=NodeId(2))
    time.fix(1 * S, 1 * S + clock.limit_ns + 1)
    assert not time.synced
    assert time.report()["implausible"] == 1
    time.fix(1 * S, 1 * S + clock.limit_ns)
    assert time.synced


def test_two_clocks_that_both_drift_run_apart_twice_as_fast(clock: Clock) -> None:
    assert oscillator(clock, others=1).rate == pytest.approx(40e-6)
    assert oscillator(clock, others=0).rate == pytest.approx(20e-6)


@pytest.mark.parametrize("sync", ["none", "gps", "beacons"])
def test_each_way_is_what_the_scenario_says(make_scenario: MakeScenario, sync: str) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "clock.sync": sync, "clock.drift_ppm": 10})
    assert swarm_time(scenario, NodeId(2)).synced == (sync == "none")


@given(
    offset_us=st.integers(1, 5000),
    drift_ppm=st.integers(0, 100),
    at_s=st.integers(0, 60),
    more_ns=st.integers(-20_000, 20_000),
)
@example(offset_us=1000, drift_ppm=20, at_s=0, more_ns=0)
@example(offset_us=1000, drift_ppm=20, at_s=60, more_ns=-1)
def test_without_a_common_time_nodes_believe_in_their_turns_exactly_when_the_plan_does(
    offset_us: int, drift_ppm: int, at_s: int, more_ns: int
) -> None:
    """Two clocks of 60 s, each off by as much as it may, and 20 us of flight."""
    needed_us = 2 * (offset_us + 60 * drift_ppm) + 20
    keys = [f"clock.offset_ms={offset_us / 1000}", f"clock.drift_ppm={drift_ppm}", "duration_s=60"]
    scenario = catalog.find("clusters", [*keys, f"clusters.turn_slack_us={needed_us + more_ns / 1000}"])
    known_ns = swarm_time(scenario, NodeId(1)).worst_ns(at_s * S)
    assert clocks_fit(scenario.clock, slack_ns=turn_slack_ns(scenario), clock_error_ns=known_ns) == (more_ns >= 0)
    assert (not list(clocks_apart(scenario))) == (more_ns >= 0)
