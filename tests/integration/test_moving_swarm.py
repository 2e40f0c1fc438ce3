"""Swarms that change their shape while the protocol runs."""

from typing import Any, NamedTuple

import pytest
from kit import slow

from fanet_mw.scenario import config
from sim.results.files import finish
from sim.run.virtual import simulate


class Flight(NamedTuple):
    """A thin swarm that moves."""

    model: str
    columns: int
    speed_m_s: float
    area_m: float
    duration_s: float

    def summary(self, *, mission: dict[str, Any] | None = None, **clusters: Any) -> tuple[dict[str, Any], int]:
        """What came of it, and the last epoch."""
        count = self.columns**2
        tree = {
            "duration_s": self.duration_s, "warmup_s": 10, "drain_s": 3,
            "nodes": {"count": count, "spacing_m": 160, "columns": self.columns, "telemetry_hz": 0},
            "clusters": {
                "count": count - 1, "flooding_period_s": 1.0, "guard_ms": 1, "link_m": 200, "relay": "scheduled",
                **clusters,
            },
            "traffic": {"payload_bytes": 256, "sources": tuple(range(2, count + 1))},
            "radio": {"lead_ms": 0, "cw_min": 7},
            "mobility": {"model": self.model, "speed_m_s": self.speed_m_s}, "world": {"area_m": self.area_m},
            "mission": mission or {},
        }  # fmt: skip
        outcome = simulate(config.build(tree))
        epochs = max(r["epoch"] for r in outcome.reports.values() if r.get("kind") == "agent")
        return finish(outcome, out=None), epochs


@pytest.mark.parametrize(("speed_m_s", "duration_s"), [(20.0, 25), *slow((7.5, 38))])
def test_a_formation_keeps_its_timetable_and_its_bound_through_its_turns(speed_m_s: float, duration_s: float) -> None:
    summary, epochs = Flight("formation", 4, speed_m_s, area_m=900, duration_s=duration_s).summary()
    assert epochs <= 2, "at most one that the start has suggested"
    assert summary["pdr"] == 1.0
    bound = summary["bound"]
    assert (bound["violations"], bound["stated_share"], bound["within_share"]) == (0, 1.0, 1.0)


def test_a_timetable_promises_nothing_to_uavs_that_move_among_each_other() -> None:
    bound = Flight("random_waypoint", 4, 5, area_m=500, duration_s=25).summary()[0]["bound"]
    assert not bound.get("stated_share")


@pytest.mark.parametrize(("reports", "stated"), [(3, False), (10, True)])
def test_a_timetable_promises_nothing_where_the_mission_takes_uavs_to_survivors(reports: int, stated: bool) -> None:
    """Nine UAVs stand; with three reports they fly to a survivor, and ten do not come."""
    mission = {"survivors": 2, "reports_to_approach": reports}
    summary, _ = Flight("static", 3, 5, area_m=500, duration_s=16).summary(mission=mission)
    assert bool(summary["bound"].get("stated_share")) == stated
    assert bool(summary["mission"]["time_to_approach_s"]) != stated


@pytest.mark.slow
def test_heads_that_change_under_a_timetable_lose_no_account_of_a_frame() -> None:
    flight = Flight("random_waypoint", 4, 6, area_m=600, duration_s=22)
    summary, epochs = flight.summary(count=4, reassign_s=5, contention_ms=150)
    assert epochs > 1
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.5


@pytest.mark.slow
def test_new_timetables_bring_a_moving_swarm_what_the_first_one_would_lose() -> None:
    """Links that end bring new timetables without `reassign_s`, too, and not fewer: epochs tell nothing."""
    flight = Flight("random_waypoint", 5, 5, area_m=800, duration_s=90)
    once, _ = flight.summary(reassign_s=0, resume=False)
    anew, epochs = flight.summary(reassign_s=10, resume=False)
    assert epochs > 1
    assert anew["pdr"] > once["pdr"] + 0.03
