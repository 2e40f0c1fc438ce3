"""Whole swarms whose clocks drift: agreed by beacons or GPS they keep in step, left alone they do not."""

from functools import lru_cache
from typing import Any

import pytest
from kit import MakeScenario

from agents.applications.traffic import sources_of
from agents.clock.clocked_uav import ClockedUav, make_uav
from agents.uav import Uav
from fanet_mw.bounds import Bounded
from fanet_mw.bounds.slot_service import slot_guard_ns
from fanet_mw.bus.messages import Reception
from fanet_mw.bus.topics import Topics
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import MS, US, Enu, NodeId
from sim.planner.answer import judge
from sim.planner.plan import plan
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.layout import positions

GRID = [
    "nodes.count=15", "traffic.sources=14", "clusters.count=14", "clusters.turn_slack_us=400", "duration_s=44",
    "warmup_s=34", "clock.drift_ppm=20",
]  # fmt: skip

SOON = ("duration_s=20", "warmup_s=14")
"""Where no beacon has to go round first."""
IN_STEP = ("clock.drift_ppm=0", "clock.offset_ms=1", "clusters.turn_slack_us=2020", "duration_s=18", "warmup_s=10")


@lru_cache
def outcome_of(*settings: str) -> Outcome:
    return simulate(catalog.find("clusters", [*GRID, *settings]))


def summary_of(*settings: str) -> dict[str, Any]:
    return finish(outcome_of(*settings), out=None)


@pytest.mark.parametrize("offset_ms", [pytest.param(50, marks=pytest.mark.slow), 1000])
def test_with_time_beacons_every_packet_arrives_within_the_bound(offset_ms: int) -> None:
    summary = summary_of("clock.sync=beacons", f"clock.offset_ms={offset_ms}")
    assert summary["pdr"] >= 0.999
    assert summary["bound"]["violations"] == 0
    assert summary["bound"]["classes"]["traffic"]["deliveries"] > 1000
    clock = summary["clock"]
    assert clock["synced_after_s"] < 16
    assert clock["error_us"]["p99"] < 20
    assert clock["beyond_bound"] == 0
    assert summary["valid"], "what a node does not look at before it has the time was received, too"


@pytest.mark.slow
def test_a_plan_says_how_long_time_beacons_take_and_before_that_packets_are_lost() -> None:
    """Six nodes in a line, five hops, a hello every second: the slack of turns is less than clocks differ."""
    line = ["nodes.layout=line", "nodes.count=6", "clusters.count=5", "traffic.sources=5", "clock.sync=beacons",
            "clock.offset_ms=20", "clusters.flooding_period_s=0.5", "drain_s=4", "clusters.resume=false"]  # fmt: skip
    for warmup_s, told in ((6, True), (19, False)):
        scenario = catalog.find("clusters", [*line, f"warmup_s={warmup_s}", f"duration_s={warmup_s + 8}"])
        _, plan, feasible = judge(scenario, change=False)
        assert feasible
        assert (
            any("time beacons take up to some 19 s to reach the node 5 hops" in note for note in plan["notes"]) == told
        )
        assert (finish(simulate(scenario), out=None)["pdr"] < 1) == told


@pytest.mark.slow
def test_with_gps_too() -> None:
    summary = summary_of(*SOON, "clock.sync=gps", "clock.offset_ms=50", "clock.gps_sigma_ns=1000")
    assert summary["pdr"] >= 0.999
    assert summary["bound"]["violations"] == 0
    assert summary["clock"]["error_us"]["max"] < 5
    assert summary["clock"]["beyond_bound"] == 0


def test_a_post_on_the_ground_has_the_time_of_gps_as_the_uavs_have_and_only_an_outage_takes_it() -> None:
    keys = ("clock.sync=gps", "ground.at_m=[0,-300]", "traffic.sources=3", "nodes.count=4", "clusters.count=2", *SOON)
    assert summary_of(*keys)["clock"]["without_time"] == 0
    worst_us = [outcome_of(*keys).reports[f"agent-{node}"]["clock"]["bound_us"] for node in (4, 5)]
    assert worst_us[1] == pytest.approx(worst_us[0], rel=0.5)
    without = summary_of(*keys, "sensors.gps_outages=[[0,-300,50,0,1000]]")
    assert without["clock"]["without_time"] == 1


def test_clocks_that_only_drift_soon_collide_and_the_summary_says_how_wrong_they_were() -> None:
    keys = ("clock.sync=none", "clusters.turn_slack_us=50", "clock.offset_ms=5", "clusters.resume=false")
    summary = summary_of(*SOON, *keys)
    assert summary["pdr"] < 0.7
    assert 1000 < summary["clock"]["error_us"]["max"] < 6000
    assert summary["clock"]["synced_after_s"] is None


def test_a_slack_of_twice_the_error_and_20_us_keeps_every_packet_in_its_turn() -> None:
    """1 ms either way, and so up to 2 ms between neighbors, with frames of 1.1 ms."""
    summary = summary_of(*IN_STEP)
    assert summary["clock"]["error_us"]["max"] > 800
    assert summary["pdr"] == 1


def test_a_plan_and_the_nodes_state_the_same_bound_for_clocks_that_nothing_synchronizes_and_the_slack_holds() -> None:
    bound = summary_of(*IN_STEP)["bound"]
    assert bound["stated_share"] == 1
    assert bound["violations"] == 0
    scenario = catalog.find("clusters", [*GRID, *IN_STEP])
    placed = dict(zip(scenario.node_ids, positions(scenario), strict=True))
    found = plan(scenario, placed, sources=sources_of(scenario))
    assert found.feasible
    (planned,) = found.classes
    assert isinstance(planned.bound, Bounded)
    assert planned.bound.delay_ns / MS == pytest.approx(bound["worst_ms"], abs=0.001)


@pytest.mark.slow
def test_delays_in_the_trace_are_true_although_no_two_clocks_agree() -> None:
    """Offsets of up to a second would make delays negative, or seconds long, if nodes measured them."""
    outcome = outcome_of(*SOON, "clock.sync=none", "clusters.turn_slack_us=50", "clock.offset_ms=1000")
    born = {(r.node, r.seq): r.t_ns for r in outcome.records if isinstance(r, Generated)}
    delays = [r.delay_ns for r in outcome.records if isinstance(r, Delivered)]
    assert len(delays) > 300
    assert min(delays) > 0
    assert all(r.delay_ns == r.t_ns - born[r.origin, r.seq] for r in outcome.records if isinstance(r, Delivered))


def test_exact_clocks_put_nothing_between_a_uav_and_its_host(make_scenario: MakeScenario) -> None:
    assert type(make_uav(make_scenario(), NodeId(1), "x", position=Enu(0, 0, 0))) is Uav
    drifting = make_scenario(**{"clock.drift_ppm": 1})
    assert type(make_uav(drifting, NodeId(1), "x", position=Enu(0, 0, 0))) is ClockedUav


def test_before_it_has_swarm_time_no_schedule_reaches_a_node(make_scenario: MakeScenario) -> None:
    """Every schedule that leaves a leader is handed to a node that has heard no beacon, as from the air."""
    scenario = make_scenario(**{"nodes.count": 3, "clock.sync": "beacons", "clock.offset_ms": 50})
    outcome = simulate(scenario)
    assert outcome.reports["agent-3"]["role"] in ("head", "member")
    deaf = make_uav(scenario, NodeId(3), "x", position=Enu(0, 0, 50))
    deaf.start(0)
    told = [m for m in heard_schedules(scenario) if m]
    assert told
    for reception in told:
        deaf.receive(Topics("x").radio_rx(3), reception, reception.end_ns)
    report = deaf.report()
    assert report["role"] == "isolated"
    assert report["clock"]["withheld"] == len(told)


def heard_schedules(scenario: Any) -> list[Reception]:
    """The schedules that node 3 hears in a run."""
    from fanet_mw import wire
    from fanet_mw.hosts.virtual import VirtualHost
    from sim.run.virtual import actors_of

    found: list[Reception] = []

    def listen(_: str, message: object) -> None:
        if isinstance(message, Reception) and wire.peek_kind(message.frame) == wire.Kind.SCHEDULE:
            found.append(message)

    host = VirtualHost(actors_of(scenario, "x"), listeners=[(Topics("x").radio_rx(3), listen)])
    host.start()
    host.run(scenario.duration_ns)
    return found


def test_a_guard_of_its_own_making_follows_the_worst_clock(make_scenario: MakeScenario) -> None:
    given = make_scenario(**{"clusters.guard_ms": 3})
    assert slot_guard_ns(given, clock_error_ns=9 * MS) == 3 * MS
    auto = make_scenario(**{"clusters.guard_ms": "auto"})
    exact_ns = slot_guard_ns(auto, clock_error_ns=0)
    assert 900 * US < exact_ns < 1200 * US, "the last frame of 1024 bytes at 11 Mb/s"
    assert slot_guard_ns(auto, clock_error_ns=100 * US) == exact_ns + 200 * US


def test_the_slack_of_a_turn_holds_two_clock_errors_and_the_flight(make_scenario: MakeScenario) -> None:
    clock = make_scenario().clock
    assert clocks_fit(clock, slack_ns=200 * US, clock_error_ns=90 * US)
    assert not clocks_fit(clock, slack_ns=200 * US, clock_error_ns=91 * US)
    assert clocks_fit(clock, slack_ns=0, clock_error_ns=0)


def test_no_bound_is_stated_while_the_slack_does_not_hold_the_clocks() -> None:
    summary = summary_of(*SOON, "clock.sync=beacons", "clock.offset_ms=50", "clusters.turn_slack_us=20")
    assert summary["bound"] == {}
