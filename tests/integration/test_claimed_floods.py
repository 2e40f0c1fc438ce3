"""Whole swarms in slots claimed over the air, and with chosen relays: everything arrives, by fewer frames."""

from typing import Any

import pytest
from kit import slow

from sim.planner.answer import judge
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

SHORT = ["duration_s=15", "warmup_s=12", "drain_s=1"]

RELAYED = [
    "clusters.relay=claimed",
    "nodes.count=12",
    "nodes.layout=line",
    "clusters.count=11",
    "traffic.sources=11",
    "traffic.interval_s=0.5",
    "duration_s=18",
]

DENSE = ["nodes.layout=disc", "nodes.radius_m=210", "nodes.count=30", "traffic.sources=29", "clusters.count=29"]


def summary_of(*settings: str) -> dict[str, Any]:
    return finish(simulate(catalog.find("clusters", [*SHORT, "clusters.flooding_period_s=1", *settings])), out=None)


def test_on_the_grid_every_packet_reaches_everyone_within_a_fraction_of_a_period() -> None:
    outcome = simulate(catalog.find("clusters", [*SHORT, "clusters.relay=claimed"]))
    summary = finish(outcome, out=None)
    assert summary["pdr"] >= 0.999
    assert summary["delay_ms"]["p95"] < 300
    assert summary["frames"]["closes"]
    nodes = [report for report in outcome.reports.values() if report.get("kind") == "agent"]
    assert all(report["superframe"] == 16 for report in nodes)
    assert len({report["slot"] for report in nodes}) <= 12, "45 nodes share them"


@pytest.mark.parametrize(("frames", "fits"), [(2, False), (40, True)])
def test_queues_that_overflow_at_relays_are_a_problem_of_the_plan(frames: int, *, fits: bool) -> None:
    settings = [*RELAYED, f"routing.queue_frames={frames}"]
    _, plan, feasible = judge(catalog.find("clusters", settings), change=False)
    assert feasible == fits
    assert fits or f"routing.queue_frames = {frames} has to be at least" in plan["problems"][0]
    assert (summary_of(*settings)["pdr"] == 1.0) == fits


def test_a_dense_swarm_needs_few_relays_and_they_win_the_turns_they_need() -> None:
    summary = summary_of("clusters.relay=claimed", *DENSE)
    assert summary["pdr"] >= 0.999
    assert summary["frames"]["sent"] / summary["generated"] < 10
    assert summary["frames"]["closes"]


@pytest.mark.parametrize("rule", ["mpr", *slow("heads", "cds")])
def test_chosen_relays_reach_nearly_all_of_a_dense_swarm_by_half_the_frames(rule: str) -> None:
    heads = ["clusters.count=5"] if rule == "heads" else []
    few = summary_of(f"clusters.relay={rule}", "traffic.interval_s=0.5", "duration_s=17", *DENSE, *heads)
    assert few["pdr"] >= 0.93
    assert few["frames"]["sent"] / few["generated"] < 20, "30 and more with `all`"
    assert few["frames"]["closes"]


def test_small_packets_share_frames_and_ten_times_as_many_arrive() -> None:
    """440 packets of 64 B a second, each to 44 nodes; one by one half of them would not."""
    small = ["traffic.payload_bytes=64", "traffic.interval_s=0.1", "radio.max_frame_bytes=1024", "duration_s=14"]
    summary = summary_of("clusters.relay=claimed", "routing.aggregate=true", *small)
    assert summary["pdr"] >= 0.999
    assert summary["delay_ms"]["p95"] < 200
    assert summary["frames"]["sent"] / summary["generated"] < 22
    assert summary["frames"]["closes"]


def test_heads_that_release_small_packets_together_need_half_the_frames() -> None:
    small = ["traffic.payload_bytes=64", "traffic.interval_s=0.2", "clusters.count=8", "duration_s=14"]
    one_by_one, together = (summary_of("clusters.relay=all", f"routing.aggregate={on}", *small) for on in (False, True))
    assert together["frames"]["sent"] < one_by_one["frames"]["sent"] / 2
    assert together["delay_ms"]["p50"] < one_by_one["delay_ms"]["p50"]
    assert together["frames"]["closes"]


@pytest.mark.parametrize(("warmup_s", "told"), [(0, True), (8, False)])
def test_traffic_that_begins_before_slots_are_held_is_lost_and_told_so(warmup_s: float, *, told: bool) -> None:
    """A hello is sent every second."""
    settings = [*SHORT, "clusters.relay=claimed", f"warmup_s={warmup_s}", f"duration_s={warmup_s + 9}", "drain_s=5"]
    scenario = catalog.find("clusters", settings)
    _, plan, feasible = judge(scenario, change=False)
    assert feasible
    assert any("nodes hold their slots some 8 s after the start" in note for note in plan["notes"]) == told
    assert (finish(simulate(scenario), out=None)["pdr"] < 0.9) == told
