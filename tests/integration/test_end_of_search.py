"""A search that is over brings everybody home: a whole run in virtual time."""

from collections.abc import Callable

import pytest

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, MissionModeChanged, Posed
from fanet_mw.units import S
from sim.run.virtual import simulate

KEYS = {
    "nodes.count": 4, "nodes.spacing_m": 40, "nodes.altitude_m": 40, "duration_s": 105, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.search": "lines", "mobility.model": "onboard", "mobility.speed_m_s": 7.5,
    "world.area_m": 240, "radio.range_m": 250, "traffic.arrivals": "none", "nodes.telemetry_hz": 0,
}  # fmt: skip


@pytest.mark.parametrize(("sweeps", "camera_hz", "passes"), [(1, 0.0, 2), (0, 2.0, None), (1, 2.0, 1)])
@pytest.mark.slow
def test_after_the_last_sweep_all_land_where_they_started_and_wait_one_sweep_for_who_is_still_sought(
    make_scenario: Callable[..., Scenario], sweeps: int, camera_hz: float, passes: int | None
) -> None:
    keys = {
        **KEYS,
        "duration_s": 105 if passes else 70,
        "mission.sweeps": sweeps,
        "sensors.camera_hz": camera_hz,
        "sensors.camera_fov_deg": 90.0,
    }
    records = simulate(make_scenario(**keys)).records
    modes = [r for r in records if isinstance(r, MissionModeChanged)]
    began_s = min(r.t_ns for r in modes if r.mode == "search") / S
    done_s = [r.t_ns / S for r in modes if r.mode == "done"]
    if passes is None:
        assert not done_s
        return
    assert len(done_s) == 4
    sweep_s = (120 - 25 - 16) / 7.5
    assert done_s == pytest.approx([began_s + passes * sweep_s] * 4, abs=3.0)
    assert {r.node for r in records if isinstance(r, FlightModeChanged) and r.mode == "land"} == set(range(1, 5))
    for node in range(1, 5):
        start, *_, end = [r for r in records if isinstance(r, Posed) and r.node == node]
        assert (end.east_m, end.north_m, end.up_m) == pytest.approx((start.east_m, start.north_m, 0.0), abs=9.0), (
            "as GPS errs"
        )
    assert not [r for r in records if isinstance(r, Collided)]
