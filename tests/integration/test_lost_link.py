"""A UAV whose radio fails flies home, and the others search on without it: a whole run in virtual time."""

from collections.abc import Callable

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, MissionModeChanged, Planned, Posed
from fanet_mw.units import S
from sim.run.virtual import simulate

CUT, CUT_FOR_A_WHILE = 2, 4
KEYS = {
    "nodes.count": 6, "nodes.spacing_m": 40, "nodes.altitude_m": 40, "duration_s": 92, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.search": "spiral", "mission.lost_link_s": 8, "mobility.model": "onboard",
    "world.area_m": 600, "radio.range_m": 250, "traffic.arrivals": "none", "nodes.telemetry_hz": 0,
    "faults": [
        {"kind": "cut", "node": CUT, "at_s": 22},
        {"kind": "cut", "node": CUT_FOR_A_WHILE, "at_s": 22, "for_s": 11},
    ],
}  # fmt: skip


def test_who_is_cut_off_lands_at_home_and_keeps_its_place_in_the_plan(make_scenario: Callable[..., Scenario]) -> None:
    records = simulate(make_scenario(**KEYS)).records

    def modes(node: int) -> list[tuple[str, float]]:
        of_node = [r for r in records if isinstance(r, MissionModeChanged) and r.node == node]
        return [(record.mode, record.t_ns / S) for record in of_node]

    (left, left_s), (landed, _) = modes(CUT)[-2:]
    assert (left, landed) == ("lost_link", "land")
    assert left_s == pytest.approx(22 + 8 + 1, abs=1.5)
    assert [r.mode for r in records if isinstance(r, FlightModeChanged) and r.node == CUT][-1] == "land"
    start, *_, end = [r for r in records if isinstance(r, Posed) and r.node == CUT]
    assert (end.east_m, end.north_m, end.up_m) == pytest.approx((start.east_m, start.north_m, 0.0), abs=6)

    timeline = modes(CUT_FOR_A_WHILE)
    away = next(i for i, (mode, _) in enumerate(timeline) if mode == "lost_link")
    back, back_s = timeline[away + 1]
    assert back == "deploy", "it takes up its place again"
    assert back_s == pytest.approx(22 + 11 + 1, abs=1.5)

    assert {r.revision for r in records if isinstance(r, Planned)} == {1}, "others close ranks, and the plan remains"
    assert not [r for r in records if isinstance(r, Collided)]
