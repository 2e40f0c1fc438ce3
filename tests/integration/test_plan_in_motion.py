"""Plans of rounds and of timetables, held against runs: bulk in slots, and UAVs that move among each other."""

from typing import Any

import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from sim.planner.answer import judge
from sim.results.result import Result
from sim.run.virtual import simulate
from sim.scenarios import catalog

TWELVE = (
    "nodes.count=12", "clusters.count=11", "traffic.sources=11", "routing.protocol=rounds", "routing.lifetime_s=3",
    "duration_s=8", "drain_s=3", "warmup_s=2",
)  # fmt: skip


def planned(*settings: str) -> tuple[Scenario, dict[str, Any], bool]:
    scenario = catalog.find("clusters", settings)
    _, content, feasible = judge(scenario)
    return scenario, content, feasible


@pytest.mark.parametrize(("interval_s", "fits"), [(0.1, True), *slow((0.05, False))])
def test_bulk_that_the_slots_of_rounds_carry_arrives_and_more_does_not(interval_s: float, *, fits: bool) -> None:
    scenario, content, feasible = planned(*TWELVE, f"traffic.interval_s={interval_s}")
    load = content["bulk"]
    assert isinstance(load, dict)
    assert feasible == fits == (load["needed"] <= 2 * load["carried"])
    pdr = Result(simulate(scenario)).summary["pdr"]
    assert (pdr > 0.999) == fits, (pdr, load)


@pytest.mark.parametrize(("interval_s", "fits"), [(0.15, True), *slow((0.09, False))])
def test_urgent_packets_that_overfill_the_turns_though_their_bytes_do_not_are_no_plan(
    interval_s: float, *, fits: bool
) -> None:
    """A turn of 700 bytes has room for one packet of 400 bytes."""
    urgent = ("traffic.priority=report", "traffic.payload_bytes=400", "rounds.turn_bytes=700", "traffic.arrivals=cbr",
              "duration_s=14")  # fmt: skip
    scenario, content, feasible = planned(*TWELVE, *urgent, f"traffic.interval_s={interval_s}", "rounds.bulk_share=0")
    assert content["offered_bytes_per_s"] < content["carried_bytes_per_s"]
    _, idle, _ = planned(*TWELVE, *urgent, "traffic.interval_s=100", "rounds.bulk_share=0")
    assert content["bound_ms"] > 1.1 * idle["bound_ms"], "packets alike make it longer by the share of turns they use"
    assert feasible == fits
    assert (Result(simulate(scenario)).summary["pdr"] > 0.999) == fits


@pytest.mark.parametrize(
    "motion", [("mobility.model=random_waypoint",), ("mission.survivors=1", "mission.approach_speed_m_s=5")]
)
def test_a_timetable_is_no_plan_for_uavs_that_move_among_each_other(motion: tuple[str, ...]) -> None:
    walking = ("nodes.count=12", "clusters.count=11", "traffic.sources=11", "mobility.speed_m_s=5", "world.area_m=900")
    _, content, feasible = planned(*walking, *motion)
    assert not feasible
    (problem,) = content["problems"]
    assert "two that are linked over 200 m may be out of range after 5.0 s" in problem
    assert 'routing.protocol = "rounds"' in problem
    assert "change" not in content, "nothing that is searched makes it feasible"


@pytest.mark.slow
def test_for_relays_that_contend_a_change_is_sought_though_they_move() -> None:
    moving = ("nodes.count=12", "clusters.count=4", "mobility.model=random_waypoint", "mobility.speed_m_s=5")
    _, content, feasible = planned(*moving, "clusters.relay=counter", "traffic.sources=11", "traffic.interval_s=0.1")
    assert not feasible
    assert content["change"] is not None


@pytest.mark.parametrize(
    "settings", [("mobility.model=formation",), ("mobility.model=random_waypoint", "duration_s=4")]
)
def test_a_timetable_is_a_plan_while_no_link_can_end(settings: tuple[str, ...]) -> None:
    few = ("nodes.count=12", "clusters.count=11", "traffic.sources=11", "warmup_s=0", "drain_s=1")
    assert planned(*few, "mobility.speed_m_s=5", *settings)[2]
