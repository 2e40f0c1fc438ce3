"""A post that was cut off learns what was found as soon as the air is whole: a whole run in virtual time."""

from collections.abc import Callable

import pytest
from kit import slow

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, KnownOnGround
from fanet_mw.units import S
from sim.run.virtual import simulate

KEYS = {
    "nodes.count": 8, "nodes.spacing_m": 60, "nodes.altitude_m": 40, "duration_s": 32, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.survivor_positions_m": ((60.0, 120.0),), "mission.search": "lines",
    "mobility.model": "onboard", "mobility.speed_m_s": 7.5, "world.area_m": 320, "radio.range_m": 250,
    "nodes.telemetry_hz": 0, "traffic.arrivals": "none", "sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0,
    "ground.at_m": (0.0, -100.0),
}  # fmt: skip
WHOLE_S = 26


@pytest.mark.parametrize("protocol", ["rounds", *slow("clustered")])
def test_what_was_found_is_known_on_the_other_side_soon_after_the_air_is_whole(
    make_scenario: Callable[..., Scenario], protocol: str
) -> None:
    part = {"kind": "partition", "nodes": (9,), "at_s": 5, "for_s": WHOLE_S - 5}
    records = simulate(make_scenario(**{**KEYS, "routing.protocol": protocol, "faults": [part]})).records
    found_ns = min(r.t_ns for r in records if isinstance(r, Confirmed))
    known_ns = min(r.t_ns for r in records if isinstance(r, KnownOnGround))
    assert found_ns < (WHOLE_S - 13) * S, "hellos do not tell it on any more when the air is whole"
    assert WHOLE_S * S < known_ns < (WHOLE_S + 3) * S
