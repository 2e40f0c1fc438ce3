"""Ground stations see a swarm where its scenario, or the map of its scenario, says that it flies; so do the UAVs."""

import json
from pathlib import Path

import pytest

from fanet_mw import mavlink
from fanet_mw.scenario import config
from sim.results.files import finish
from sim.run.virtual import simulate

PLACES = {
    "GLOBAL_POSITION_INT": ("lat", "lon"), "GPS_RAW_INT": ("lat", "lon"), "HOME_POSITION": ("latitude", "longitude")
}  # fmt: skip
SYDNEY = (-33.8565, 151.2155)
SCENARIO = """duration_s = 12
[nodes]
count = 2
layout = "line"
spacing_m = 60
altitude_m = 60
[traffic]
arrivals = "none"
[clusters]
count = 1
[mission]
collision_distance_m = 15
collision_horizon_s = 5
[mobility]
model = "crossing"
speed_m_s = 8
[world]
gps_sigma_m = 0
"""


@pytest.mark.parametrize(
    ("world", "origin"),
    [
        ("", (37.5665, 126.978)),
        ("origin_deg = [48.8566, 2.3522]", (48.8566, 2.3522)),
        ('buildings_geojson = "town.geojson"', SYDNEY),
        ('buildings_geojson = "town.geojson"\norigin_deg = [-33.857, 151.215]', (-33.857, 151.215)),
    ],
    ids=["documented", "scenario", "map", "scenario with a map"],
)
def test_every_message_has_the_origin_of_the_scenario(tmp_path: Path, world: str, origin: tuple[float, float]) -> None:
    lat, lon = SYDNEY
    houses = [[[lon + x, lat + 1e-3], [lon + x, lat - 1e-3], [lon + x / 2, lat]] for x in (2e-3, -2e-3)]
    (tmp_path / "town.geojson").write_text(json.dumps({"type": "MultiPolygon", "coordinates": [[r] for r in houses]}))
    (tmp_path / "s.toml").write_text(SCENARIO + world)
    outcome = simulate(config.load(tmp_path / "s.toml"))
    seen = set()
    for _, frames in outcome.taps:
        for message in mavlink.decode(frames):
            if message.get_type() in PLACES:
                place = (getattr(message, name) / 1e7 for name in PLACES[message.get_type()])
                at = mavlink.to_enu(mavlink.Geodetic(*place, 0.0), mavlink.Geodetic(*origin, 0.0))
                assert max(abs(at.east), abs(at.north)) < 100
                seen.add(message.get_type())
    assert seen == set(PLACES)
    assert finish(outcome, out=None)["separation"]["warnings"] > 0, "they read each other's places as they were meant"
