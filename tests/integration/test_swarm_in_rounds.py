"""Swarms in rounds: the same delays at rest and in motion, bounds that hold beside any bulk, and nobody left out."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import pytest
from kit import slow

from agents.uav import Uav
from fanet_mw.bus.messages import Message
from fanet_mw.scenario import config
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Generated, LikelyStated
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.virtual import simulate

BASE: dict[str, Any] = {
    "name": "rounds", "duration_s": 12, "warmup_s": 4, "drain_s": 2,
    "nodes": {"count": 15, "layout": "grid", "columns": 5, "spacing_m": 200, "telemetry_hz": 0},
    "traffic": {"payload_bytes": 100, "interval_s": 1, "arrivals": "cbr", "sources": 14, "priority": "report"},
    "routing": {"protocol": "rounds"},
    "rounds": {"turn_bytes": 500},
    "radio": {"channel": "range", "range_m": 250, "cw_min": 7, "lead_ms": 0},
}  # fmt: skip


def flown(**tables: Any) -> Mapping[str, Any]:
    tree = {key: {**value, **tables.pop(key, {})} if isinstance(value, dict) else value for key, value in BASE.items()}
    return finish(simulate(config.build({**tree, **tables})), out=None)


@lru_cache
def formation(speed_m_s: float) -> Mapping[str, Any]:
    return flown(mobility={"model": "formation", "speed_m_s": speed_m_s})


@pytest.mark.parametrize("speed_m_s", [20.0, *slow(0.0, 10.0)])
def test_a_formation_keeps_its_bound_at_any_speed(speed_m_s: float) -> None:
    summary = formation(speed_m_s)
    assert summary["pdr"] == 1.0
    bound = summary["bound"]
    assert bound["stated_share"] == bound["within_share"] == 1.0
    assert bound["violations"] == 0
    assert bound["worst_ms"] <= 1.3 * formation(0.0)["bound"]["worst_ms"]


def test_no_frame_collides_where_all_is_urgent() -> None:
    summary = formation(20.0)
    assert summary["frames"]["closes"]
    assert not summary["copies"]["lost"]


@lru_cache
def overloaded() -> Mapping[str, Any]:
    """Urgent packets beside more bulk than the air can carry."""
    bulk = {"name": "bulk", "payload_bytes": 1024, "interval_s": 0.03, "arrivals": "cbr", "sources": 14}
    return flown(further_traffic=[bulk], traffic={"name": "finds"}, warmup_s=2.5, drain_s=3, duration_s=8.5)


def test_bulk_beyond_what_the_air_carries_leaves_the_bounds_alone() -> None:
    summary = overloaded()
    assert summary["classes"]["bulk"]["pdr"] < 0.9, "it was to be more than the air carries"
    finds = summary["bound"]["classes"]["finds"]
    assert finds["stated_share"] == 1.0
    assert finds["violations"] == 0
    assert finds["within_share"] == 1.0
    assert summary["frames"]["closes"]


@pytest.mark.slow
def test_bulk_with_a_deadline_is_refused_at_its_origin_or_arrives_in_time() -> None:
    traffic = {"payload_bytes": 1000, "priority": "bulk", "interval_s": 0.12, "deadline_s": 2}
    tables = {"mobility": {"model": "formation", "speed_m_s": 10}, "rounds": {"turn_bytes": 600}, "duration_s": 12}
    summary = flown(traffic=traffic, **tables)
    refused, packets = summary["admission"]["refused"], summary["generated"]
    assert 0.1 * packets < refused < 0.8 * packets, "it was to be more than the air carries"
    assert summary["delay_ms"]["p99"] < 2000
    assert summary["pdr"] * packets > 0.99 * (packets - refused)


def test_a_likely_delay_of_bulk_is_stated_and_kept_in_motion() -> None:
    traffic = {"payload_bytes": 1000, "priority": "bulk", "interval_s": 0.4}
    tables = {"mobility": {"model": "formation", "speed_m_s": 10}, "rounds": {"turn_bytes": 600}, "duration_s": 20}
    likely = flown(traffic=traffic, **tables)["likely"]
    assert likely["stated_share"] > 0.3
    assert likely["within_share"] >= likely["share"]


def test_bulk_within_what_the_air_carries_reaches_everybody() -> None:
    summary = flown(traffic={"payload_bytes": 1024, "priority": "bulk", "interval_s": 0.2}, duration_s=9)
    assert summary["pdr"] == 1.0
    assert summary["air"]["pdr"] > 0.98, "bulk slots keep apart who could collide"


@pytest.mark.parametrize("loss", [0.3, *slow(0.1)])
def test_who_missed_a_packet_gets_it_from_a_neighbor(loss: float) -> None:
    summary = flown(faults=[{"kind": "degrade", "at_s": 1, "loss_share": loss}])
    assert summary["pdr"] >= 0.999


def test_a_partition_that_ends_leaves_nobody_without_a_packet() -> None:
    """The middle column is cut off for three seconds; packets live for 30."""
    cuts = [{"kind": "cut", "at_s": 6, "for_s": 3, "node": node} for node in (3, 8, 13)]
    summary = flown(faults=cuts, drain_s=6, duration_s=18)
    assert summary["pdr"] >= 0.999


@pytest.mark.slow
def test_receivers_tell_soon_enough_what_they_hold_where_many_hear_each_other() -> None:
    """Who is not told in time sends again: 16 nodes in reach of each other, 400 packets of bulk a second."""
    tree = {
        **BASE, "nodes": {**BASE["nodes"], "count": 16, "columns": 4, "spacing_m": 40}, "duration_s": 7, "drain_s": 2,
        "traffic": {**BASE["traffic"], "interval_s": 0.04, "priority": "bulk", "sources": 16},
    }  # fmt: skip
    outcome = simulate(config.build(tree))
    summary = finish(outcome, out=None)
    assert summary["pdr"] == 1.0
    repeated = sum(report.get("repeated", 0) for report in outcome.reports.values())
    assert repeated < 0.1 * summary["generated"]


def test_bounds_are_whole_again_a_second_after_the_air_is() -> None:
    """Two halves of the swarm do not hear each other for 4 s: meanwhile bounds exclude the other half."""
    cut = {"kind": "partition", "at_s": 6, "for_s": 5, "nodes": [1, 2, 6, 7, 11, 12]}
    outcome = simulate(config.build({**BASE, "duration_s": 18, "faults": [cut], "rounds": {"bulk_share": 0}}))
    stated = {(each.node, each.seq): each.t_ns / S for each in outcome.records if isinstance(each, BoundStated)}
    excludes = {(each.node, each.seq) for each in outcome.records if isinstance(each, BoundExcludes)}
    assert {name for name, at_s in stated.items() if 9 < at_s < 11} <= excludes
    whole = {name for name, at_s in stated.items() if at_s > 12}
    assert len(whole) > 50
    assert not whole & excludes


@pytest.mark.parametrize(
    ("clock", "slack_us"),
    [({"offset_ms": 12_000}, 50), *slow(({"sync": "gps", "offset_ms": 50}, 20), ({"offset_ms": 0.1}, 200))],
)
def test_no_bound_is_stated_while_clocks_may_be_further_apart_than_the_slack_of_turns(
    clock: Mapping[str, Any], slack_us: float
) -> None:
    """Of clocks 12 s apart, all that was stated excluded those whose statements about links seemed too old."""
    timing = {"turn_slack_us": slack_us, "bulk_share": 0}
    summary = flown(clock={**clock, "drift_ppm": 1}, rounds=timing, duration_s=11)
    assert summary["pdr"] == 1.0
    assert not summary["bound"]


def test_clocks_that_fit_the_slack_of_turns_leave_all_bounds_as_they_were() -> None:
    timing = {"turn_slack_us": 300, "bulk_share": 0}
    summary = flown(clock={"offset_ms": 0.1, "drift_ppm": 1}, rounds=timing)
    bound = summary["bound"]
    assert bound["stated_share"] == bound["within_share"] == 1.0


def test_bounds_hold_in_a_swarm_that_mixes() -> None:
    """UAVs that mix at 20 m/s on 700 m leave each other's range all the time, and often the swarm."""
    mixing = {"model": "random_waypoint", "speed_m_s": 20.0}
    summary = flown(
        seed=3, duration_s=14, nodes={"layout": "disc", "spacing_m": 100, "telemetry_hz": 1}, world={"area_m": 700},
        mobility=mixing, rounds={"bulk_share": 0},
    )  # fmt: skip
    bound = summary["bound"]
    assert bound["stated_share"] > 0.8
    assert bound["violations"] == 0


ONE: dict[str, Any] = {"priority": "bulk", "payload_bytes": 1024, "destination": 1, "interval_s": 0.5}


def to_one(**tables: Any) -> Mapping[str, Any]:
    return flown(**{"rounds": {"turn_bytes": 600}, **tables})


def test_bulk_for_a_neighbor_takes_one_frame_and_no_wait_for_a_slot() -> None:
    silent = to_one(traffic={**ONE, "arrivals": "none"})
    summary = to_one(traffic={**ONE, "sources": [2]})
    assert summary["pdr"] == 1.0
    assert summary["frames"]["sent"] - silent["frames"]["sent"] <= 1.2 * summary["generated"]
    assert summary["delay_ms"]["p50"] <= 20


@pytest.mark.parametrize("speed_m_s", [20.0, *slow(10.0)])
def test_bulk_for_one_finds_its_way_in_a_swarm_that_mixes(speed_m_s: float) -> None:
    mixing = {"model": "random_waypoint", "speed_m_s": speed_m_s}
    lives = {"duration_s": 16, "drain_s": 7, "routing": {"lifetime_s": 6}}
    summary = to_one(traffic=ONE, mobility=mixing, world={"area_m": 500}, **lives)
    assert summary["reachable"]["traffic"]["pdr"] >= 0.99
    assert summary["frames"]["closes"]


def test_bulk_for_one_goes_another_way_when_a_relay_falls_silent() -> None:
    fallen = [{"kind": "mute", "at_s": 8, "node": node} for node in (2, 7)]
    summary = to_one(traffic={**ONE, "sources": [3, 9, 15]}, faults=fallen)
    assert summary["pdr"] == 1.0
    assert summary["delay_ms"]["max"] <= 1500


def test_bulk_for_one_of_whom_nothing_is_known_yet_is_flooded() -> None:
    summary = to_one(traffic={**ONE, "sources": [15]}, warmup_s=0.1, duration_s=5)
    assert summary["pdr"] == 1.0


@pytest.mark.slow
def test_a_uav_that_hears_nothing_does_not_delay_the_bulk_of_others() -> None:
    """All its neighbors sent each packet sixteen times for it."""
    bulk = {"payload_bytes": 1024, "interval_s": 0.4, "priority": "bulk", "sources": 15}
    deaf = [{"kind": "deaf", "at_s": 5, "node": 8}]
    heard = flown(traffic=bulk)
    summary = flown(traffic=bulk, faults=deaf)
    assert summary["pdr"] > 1 - 1 / 15, "the deaf one is the only one that lacks anything"
    assert summary["delay_ms"]["p95"] < 1.3 * heard["delay_ms"]["p95"]
    assert summary["frames"]["sent"] < 1.2 * heard["frames"]["sent"]


class WokenLate(Uav):
    """A UAV that is woken as late as its process may be, or together with a message that comes first."""

    def receive(self, topic: str, message: Message, now_ns: int) -> bool:
        asked_ns = super().next_wake_ns()
        super().receive(topic, message, now_ns)
        if asked_ns is not None and asked_ns <= now_ns:
            self.wake(now_ns)
        return False

    def next_wake_ns(self) -> int | None:
        asked_ns = super().next_wake_ns()
        return None if asked_ns is None else asked_ns + self.slack_ns


@pytest.mark.slow
def test_a_late_wake_up_of_a_process_costs_no_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    often = {
        "traffic": {"interval_s": 0.25, "payload_bytes": 64},
        "radio": {"lead_ms": 100, "handover_ms": 30},
        "rounds": {"bulk_share": 0},
        "duration_s": 10,
    }
    exact = flown(**often)
    monkeypatch.setattr("sim.run.virtual.make_uav", WokenLate)
    late = flown(**often)
    assert late["delay_ms"]["mean"] <= exact["delay_ms"]["mean"] + 30
    assert late["bound"]["stated_share"] == late["bound"]["within_share"] == 1.0


@pytest.mark.slow
def test_bounds_of_reports_hold_though_warnings_overtake_them_at_each_hop() -> None:
    """Two nodes of a line of 12 warn so often that they use half of the turns. What was promised in the second in
    which they begin is left out: nobody could know.
    """
    tables = {
        "duration_s": 9, "warmup_s": 3,
        "nodes": {"count": 12, "layout": "explicit", "positions_m": [[180.0 * n, 0.0, 60.0] for n in range(12)]},
        "rounds": {"turn_bytes": 600, "bulk_share": 0.3},
        "radio": {"lead_ms": 80},
        "traffic": {"payload_bytes": 64, "interval_s": 0.5, "arrivals": "poisson", "sources": 12},
        "further_traffic": [
            {"name": "warnings", "interval_s": 0.016, "payload_bytes": 100, "sources": [3, 8], "priority": "safety"}
        ],
    }  # fmt: skip
    tree = {key: {**value, **tables.pop(key, {})} if isinstance(value, dict) else value for key, value in BASE.items()}
    records = simulate(config.build({**tree, **tables})).records
    stated = {(one.node, one.seq): one.bound_ns for one in records if isinstance(one, BoundStated) and one.t_ns > 4 * S}
    kept = [
        one.delay_ns <= stated[one.origin, one.seq]
        for one in records
        if isinstance(one, Delivered) and (one.origin, one.seq) in stated and (one.origin not in (3, 8))
    ]
    assert len(kept) > 100
    assert all(kept)


@pytest.mark.slow
def test_over_lossy_links_a_likely_delay_is_stated_again_soon_after_a_uav_is_lost() -> None:
    """Since one was lost, nobody stated any: the likely delay was meant for all or for nobody."""
    tree = {
        **BASE, "duration_s": 15, "drain_s": 2,
        "radio": {**BASE["radio"], "channel": "log_distance", "shadowing_db": 4, "fading": "rician"},
        "traffic": {**BASE["traffic"], "interval_s": 0.25},
        "faults": [{"kind": "mute", "at_s": 8, "node": 8}],
    }  # fmt: skip
    outcome = simulate(config.build(tree))
    born = [one for one in outcome.records if isinstance(one, Generated) and one.t_ns > 12 * S and one.node != 8]
    stated = {(one.node, one.seq) for one in outcome.records if isinstance(one, LikelyStated)}
    assert sum((one.node, one.seq) in stated for one in born) > 0.9 * len(born)
    assert finish(outcome, out=None)["likely"]["within_share"] > 0.98


@pytest.mark.slow
def test_over_shadowed_and_fading_links_a_likely_delay_is_stated_and_kept_in_motion() -> None:
    """A packet that one neighbor was not heard to pass on was sent again by all: some came 9 s late."""
    summary = flown(
        duration_s=15, warmup_s=3, drain_s=3,
        mobility={"model": "formation", "speed_m_s": 10},
        radio={"channel": "log_distance", "shadowing_db": 4, "fading": "rician", "rician_k_db": 10},
        traffic={"interval_s": 0.25},
    )  # fmt: skip
    assert summary["pdr"] > 0.999
    assert summary["delay_ms"]["p99"] < 500
    assert summary["likely"]["stated_share"] > 0.3
    assert summary["likely"]["within_share"] > 0.99
    assert not summary["bound"]
