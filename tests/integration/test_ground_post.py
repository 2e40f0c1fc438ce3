"""A post on the ground learns what the swarm finds, over hops or when UAVs come back: whole runs in virtual time."""

from collections.abc import Callable

import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, KnownOnGround, MissionModeChanged, Planned, Posed
from fanet_mw.units import S
from sim.planner.answer import judge
from sim.results.files import finish
from sim.results.packets import packets_of
from sim.run.virtual import simulate

KEYS = {
    "nodes.count": 4, "nodes.spacing_m": 40, "nodes.altitude_m": 40, "duration_s": 130, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.survivor_positions_m": ((60.0, 60.0),), "mission.search": "lines",
    "mission.sweeps": 1, "mobility.model": "onboard", "mobility.speed_m_s": 7.5, "world.area_m": 240,
    "radio.range_m": 250, "nodes.telemetry_hz": 0, "sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0,
    "traffic.arrivals": "cbr", "traffic.interval_s": 5, "traffic.payload_bytes": 100,
}  # fmt: skip
POST = 5


@pytest.mark.parametrize(("place_m", "gain_dbi"), [((0.0, -450.0), 12.0), *slow(((0.0, -130.0), 0.0))])
def test_within_reach_the_post_knows_of_a_find_at_once_and_gets_all_load(
    make_scenario: Callable[..., Scenario], place_m: tuple[float, float], gain_dbi: float
) -> None:
    outcome = simulate(make_scenario(**{**KEYS, "duration_s": 40, "ground.at_m": place_m, "ground.gain_dbi": gain_dbi}))
    found = next(r for r in outcome.records if isinstance(r, Confirmed))
    known = [r for r in outcome.records if isinstance(r, KnownOnGround)]
    assert [(r.node, r.survivor, r.east_m, r.north_m) for r in known] == [(POST, 1, found.east_m, found.north_m)]
    assert 0 < known[0].t_ns - found.t_ns < 3 * S
    load = packets_of(outcome)["traffic"]
    assert {origin for origin, _ in load.sent} == {1, 2, 3, 4}, "the post sends no load of its own"
    at_post = sum(node == POST for node in load.deliveries.node.tolist())
    assert at_post >= 0.9 * len(load.sent)
    plans = [r for r in outcome.records if isinstance(r, Planned)]
    assert all(r.node != POST for r in outcome.records if isinstance(r, MissionModeChanged | Posed))
    assert {r.place for r in plans if r.t_ns < 10 * S} == {0, 1, 2, 3}, "it takes no place in the formation"


def test_bounds_of_a_timetable_hold_beside_a_post_whose_antenna_is_heard_twice_as_far_and_its_plan_is_feasible(
    make_scenario: Callable[..., Scenario],
) -> None:
    scenario = make_scenario(**{
        "nodes.count": 8, "nodes.spacing_m": 150, "nodes.columns": 4, "ground.at_m": (-420.0, 0.0),
        "ground.gain_dbi": 6.0, "traffic.interval_s": 1.5, "traffic.payload_bytes": 400, "clusters.count": 3,
        "clusters.flooding_period_s": 1, "clusters.relay": "scheduled", "clusters.turn_slack_us": 400,
        "duration_s": 40, "warmup_s": 15, "drain_s": 3,
    })  # fmt: skip
    _, plan, feasible = judge(scenario, change=False)
    assert feasible, plan["problems"]
    summary = finish(simulate(scenario), out=None)
    assert summary["bound"]["violations"] == 0
    assert summary["bound"]["stated_share"] > 0.8
    assert summary["pdr"] == 1


@pytest.mark.slow
def test_a_post_out_of_reach_learns_of_a_find_from_the_uavs_that_come_home(
    make_scenario: Callable[..., Scenario],
) -> None:
    keys = {**KEYS, "ground.at_m": (0.0, -560.0), "world.base_m": (0.0, -430.0), "duration_s": 100}
    records = simulate(make_scenario(**keys)).records
    found = next(r for r in records if isinstance(r, Confirmed))
    known = [r for r in records if isinstance(r, KnownOnGround)]
    homeward_ns = min(r.t_ns for r in records if isinstance(r, MissionModeChanged) and r.mode == "done")
    assert [r.survivor for r in known] == [1]
    assert found.t_ns < homeward_ns < known[0].t_ns
    nearest_m = {
        r.node: r.north_m + 560.0 for r in records if isinstance(r, Posed) and r.t_ns == known[0].t_ns // S * S
    }
    assert 200 < min(nearest_m.values()) < 250, "as soon as the first of them is within reach"
