"""What one node with its own station can do to the others over the air: each attack that once worked, by name.

Of nine nodes, the one in the middle attacks; all others hear it, or hear one that does. Promised: nothing raises,
nobody computes without end, the books close, packets that nobody sent are no deliveries, and the others still reach
each other.
"""

import time
from collections.abc import Mapping
from typing import Any

import pytest
import scenario_draws
from air_attacks import (
    CLOCKS,
    EVIL,
    HONEST,
    digests_far_ahead,
    earlier_sequences,
    false_time,
    far_sequences,
    ghost_links,
    ghosts,
    hellos_of_others,
    joins_from_afar,
    next_schedules,
    reports_of_others,
    scenario,
    schedules_that_leap,
    survivors,
)
from attacker import Attacker, Plan

from fanet_mw.scenario import Scenario


def attacked(found: Scenario, plan: Plan) -> tuple[Mapping[str, Any], dict[str, Any]]:
    """Summary and reports of a run under attack."""
    reports: dict[str, Any] = {}
    summary = scenario_draws.run(found, limit_s=60, instead=[Attacker(EVIL, found.name, plan)], reports=reports)
    assert summary["frames"]["closes"], summary["frames"]
    return summary, reports


def dropped(reports: Mapping[str, Any], reason: str) -> int:
    """By all honest nodes."""
    return sum(reports[f"agent-{node}"]["dropped"].get(reason, 0) for node in HONEST)


# --- what is bounded where it is decoded ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rssi_dbm", "far_m"),
    [
        (1e10, 0.0),
        (1e38, 3e38),
        (-300.0, 9.9e6),
        *(pytest.param(*some, marks=pytest.mark.slow) for some in ((-1e10, 0.0), (300.0, 0.0), (-60.0, 3e38))),
    ],
)
def test_survivors_of_any_power_at_any_place_end_no_process(rssi_dbm: float, far_m: float) -> None:
    summary, reports = attacked(scenario(), survivors(rssi_dbm, far_m))
    assert summary["pdr"] > 0.97
    if abs(rssi_dbm) > 300 or far_m > 1e7:
        assert dropped(reports, "malformed") > 0


def test_a_report_in_another_s_name_than_its_packet_s_is_malformed() -> None:
    summary, reports = attacked(scenario("mission.survivors=1"), reports_of_others())
    assert dropped(reports, "malformed") >= 8
    assert summary["mission"]["uavs_approaching"] == 0


def test_a_digest_that_is_ahead_by_half_of_all_numbers_costs_nothing() -> None:
    began = time.process_time()
    summary, _ = attacked(scenario("clusters.repair_s=20"), digests_far_ahead())
    assert summary["pdr"] > 0.97
    assert time.process_time() - began < 30


def test_sequence_numbers_of_the_far_future_are_refused_and_cost_nothing() -> None:
    began = time.process_time()
    summary, reports = attacked(scenario("clusters.repair_s=20"), far_sequences())
    assert dropped(reports, "forged") > 100
    assert summary["pdr"] > 0.97
    assert time.process_time() - began < 30


def test_a_join_of_a_head_from_255_hops_away_ends_nobody() -> None:
    summary, _ = attacked(scenario(), joins_from_afar())
    assert summary["pdr"] > 0.9


# --- who is not there ----------------------------------------------------------------------------------------------


def test_ghosts_do_not_join() -> None:
    began = time.process_time()
    summary, reports = attacked(scenario(), ghosts())
    assert dropped(reports, "unknown_node") > 5000
    assert reports["agent-1"]["epoch"] <= 5
    assert summary["pdr"] > 0.9
    assert time.process_time() - began < 45


def test_a_leader_s_links_of_nodes_that_are_not_there_are_refused() -> None:
    summary, reports = attacked(scenario("clusters.relay=scheduled", "clusters.links=measured"), ghost_links())
    assert dropped(reports, "malformed") > 50
    assert summary["pdr"] > 0.9


# --- in another's name ---------------------------------------------------------------------------------------------


def test_schedules_in_the_leader_s_name_that_leap_in_epoch_are_refused() -> None:
    summary, reports = attacked(scenario(), schedules_that_leap())
    assert dropped(reports, "malformed") >= 20
    assert summary["pdr"] > 0.97


def test_a_leader_answers_a_schedule_in_its_name_by_a_later_one() -> None:
    summary, reports = attacked(scenario("duration_s=30"), next_schedules())
    assert dropped(reports, "own") > 0
    assert reports["agent-1"]["epoch"] > 9
    assert [reports[f"agent-{node}"]["epoch"] for node in HONEST] == [reports["agent-1"]["epoch"]] * len(HONEST)
    assert summary["pdr"] > 0.8, "for three of twenty seconds nodes obeyed another"


@pytest.mark.parametrize("protocol", ["clustered", "flooding", "counter", "gossip"])
def test_sequences_played_before_their_owner_mute_nobody_and_are_no_deliveries(protocol: str) -> None:
    keys = (f"routing.protocol={protocol}", "traffic.sources=[9]", "clock.sync=none", "traffic.interval_s=0.5")
    calm = attacked(scenario(*keys), [])[0]
    summary, _ = attacked(scenario(*keys), earlier_sequences(clustered=protocol == "clustered"))
    assert summary["unknown"] > 200
    assert summary["delivered"] <= summary["generated"] * 7
    worst = 0.1 if protocol == "gossip" else 0.05  # by lot, a relay more or less is one of a few
    assert summary["pdr"] > calm["pdr"] - worst


def test_who_transmits_in_another_s_name_is_refused() -> None:
    summary, reports = attacked(scenario(), hellos_of_others())
    assert dropped(reports, "forged") + dropped(reports, "own") > 400
    assert summary["pdr"] > 0.97


# --- time ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3, 5))])
def test_time_beacons_from_the_start_do_not_pull_the_swarm_s_time_apart(seed: int) -> None:
    summary, _ = attacked(scenario(*CLOCKS, f"seed={seed}"), false_time())
    assert summary["clock"]["error_us"]["max"] < 40
    assert summary["clock"]["beyond_bound"] <= 0.4 * summary["clock"]["samples"]
    assert summary["pdr"] > 0.97
