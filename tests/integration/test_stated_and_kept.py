"""Bounds by timetables that were stated and not kept, as a fuzz found them: each is kept, or not stated."""

from typing import Any

import pytest
from kit import slow

from fanet_mw.scenario import config
from fanet_mw.trace import BoundExcludes, BoundStated
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.outcome import Outcome
from sim.run.virtual import simulate

BASE: dict[str, Any] = {
    "name": "drawn", "duration_s": 26, "warmup_s": 8, "drain_s": 8,
    "routing": {"protocol": "clustered", "lifetime_s": 8},
    "clusters": {"relay": "scheduled", "guard_ms": 1},
    "radio": {"channel": "range", "range_m": 250, "standard": "g", "rate_mbps": 6},
}  # fmt: skip


def flown(**tables: Any) -> Outcome:
    seed = tables.pop("seed", 1)
    tree = {key: {**value, **tables.pop(key, {})} if isinstance(value, dict) else value for key, value in BASE.items()}
    return simulate(config.build({**tree, **tables, "seed": seed}))


def bound_of(**tables: Any) -> dict[str, Any]:
    found: dict[str, Any] = finish(flown(**tables), out=None)["bound"]
    return found


def test_a_timetable_does_not_count_on_a_link_that_errors_of_positions_made() -> None:
    """Four in a line, 125.58 m apart: the second next is 251.2 m away, and by its GPS sometimes within the range."""
    bound = bound_of(
        seed=237700, nodes={"count": 4, "layout": "grid", "columns": 4, "spacing_m": 125.57797, "telemetry_hz": 0},
        traffic={"payload_bytes": 65, "interval_s": 2.6956061237, "sources": 3, "arrivals": "poisson"},
        radio={"cw_min": 15, "lead_ms": 43, "handover_ms": 43 / 3},
        clusters={"count": 3, "flooding_period_s": 1.166106141476719},
        mobility={"model": "formation", "speed_m_s": 5.229136},
    )  # fmt: skip
    assert bound["violations"] == 0
    assert bound["stated_share"] == 1.0


@pytest.mark.parametrize(
    ("count", "columns", "spacing_m", "seed"), [*slow((9, 4, 227.04, 886227)), (13, 6, 189.3, 185840)]
)
def test_nobody_promises_while_the_timetable_has_not_reached_everybody(
    count: int, columns: int, spacing_m: float, seed: int
) -> None:
    bound = bound_of(
        seed=seed, nodes={"count": count, "layout": "grid", "columns": columns, "spacing_m": spacing_m},
        traffic={"payload_bytes": 300, "interval_s": 1.4, "sources": count - 1, "arrivals": "poisson"},
        radio={"standard": "b", "rate_mbps": 5.5, "cw_min": 7, "lead_ms": 0},
        clusters={"count": count - 1, "flooding_period_s": 0.6},
        mobility={"model": "formation", "speed_m_s": 10.0},
    )  # fmt: skip
    assert bound["violations"] == 0
    assert bound["stated_share"] > 0.3


@pytest.mark.parametrize(("contention_ms", "states"), [(12, False), (20, True)])
def test_no_bound_is_stated_where_hellos_do_not_fit_their_window(contention_ms: float, *, states: bool) -> None:
    """Nine hellos of 1.1 ms each: neighbors that are not heard are taken for dead, and the timetable ends."""
    bound = bound_of(
        nodes={"count": 9, "layout": "grid", "columns": 3, "spacing_m": 150, "telemetry_hz": 0},
        traffic={"payload_bytes": 65, "interval_s": 2, "sources": 8},
        radio={"standard": "b", "rate_mbps": 2, "cw_min": 15},
        clusters={"count": 3, "flooding_period_s": 1, "contention_ms": contention_ms},
    )  # fmt: skip
    assert bool(bound.get("stated_share")) == states
    assert not bound.get("violations")


def test_nobody_promises_by_the_timetable_of_a_leader_that_another_one_has_followed() -> None:
    """Five in a line; the second one falls, and with it the leader is lost. Three of them elect another one later."""
    outcome = flown(
        seed=649573, duration_s=46,
        nodes={"count": 5, "layout": "grid", "columns": 5, "spacing_m": 210.0957427813038, "telemetry_hz": 0},
        traffic={"payload_bytes": 451, "interval_s": 2.7141770846806974, "sources": 4, "arrivals": "poisson"},
        radio={"standard": "b", "rate_mbps": 11, "cw_min": 7, "lead_ms": 11, "handover_ms": 11 / 3},
        clusters={"count": 4, "flooding_period_s": 0.7028440175227947},
        faults=[{"kind": "crash", "node": 2, "at_s": 12}],
    )  # fmt: skip
    late = {(one.node, one.seq) for one in outcome.records if isinstance(one, BoundStated) and one.t_ns > 20 * S}
    excluded = {(one.node, one.seq) for one in outcome.records if isinstance(one, BoundExcludes) and one.other == 1}
    assert late
    assert late <= excluded
