"""Where things are: survivors, buildings and heights from files, no-fly areas; and what is refused by name."""

import json
import math
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from kit import slow

from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Geodetic, to_geodetic
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import Enu
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.pybullet import Physics
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import IRIS
from sim.world.environment import footprints, heightmap
from sim.world.environment.layout import positions
from sim.world.environment.obstacles import Box, Obstacles, covered_by, obstacles
from sim.world.environment.solids import Solids
from sim.world.environment.survivors import Survivors, place
from sim.world.incidents import NoFlyEntries

MakeScenario = Callable[..., Scenario]
PARIS = Geodetic(48.8566, 2.3522, 0.0)


# --- survivors --------------------------------------------------------------------------------------------------------


def test_survivors_are_where_the_list_says(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"mission.survivors": 2, "mission.survivor_positions_m": ((10, -20), (300, 40))})
    assert place(scenario) == [Enu(10, -20, 0), Enu(300, 40, 0)]


def test_a_place_is_inside_buildings_when_it_is_inside_one_of_them() -> None:
    random = Random(7)
    bounds = ((-40, 40), (-40, 40), (1, 20), (1, 20), (1, 20), (-4, 4))
    boxes = [Box(*(random.uniform(*bound) for bound in bounds)) for _ in range(30)]
    inside, found = covered_by(boxes), []
    for _ in range(2000):
        at = Enu(random.uniform(-60, 60), random.uniform(-60, 60), random.uniform(0, 20))
        found.append(any(box.near(np.array([at]), margin_m=0.0) for box in boxes))
        assert inside(at) == found[-1]
    assert 100 < sum(found) < 1900
    assert not covered_by(())(Enu(0.0, 0.0, 0.0))


def test_survivors_among_ten_thousand_buildings_have_their_places_at_once(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"mission.survivors": 8, "world.buildings": 10_000, "world.area_m": 1000})
    began_s = time.process_time()
    assert len(place(scenario)) == 8
    assert time.process_time() - began_s < 5, "by one building after the other it took 19 s"


def test_survivors_in_buildings_are_within_walls(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{"mission.survivors": 40, "mission.survivors_in": "buildings", "world.buildings": 6, "world.area_m": 900}
    )
    boxes = obstacles(scenario, np.array(positions(scenario))).boxes
    homes = [[i for i, b in enumerate(boxes) if b.near(np.array([at]), margin_m=0)] for at in place(scenario)]
    assert all(homes)
    assert len({home[0] for home in homes}) > 3
    assert place(scenario) == place(scenario)


def test_the_surface_below_is_the_highest_roof_of_those_that_cover_the_place() -> None:
    quarter = math.pi / 4
    solids = Solids(Obstacles(None, (Box(0, 0, 40, 10, 12), Box(0, 0, 10, 10, 30), Box(100, 0, 40, 4, 8, quarter))))
    at = [[0, 0, 50], [15, 0, 50], [15, 0, 3], [15, 6, 50], [100 + 12, 12, 50], [100 + 12, -12, 50]]
    assert solids.surface_m(np.array(at, dtype=float)).tolist() == pytest.approx([30, 12, 12, 0, 8, 0])
    assert solids.any
    assert not Solids(Obstacles(None, ())).any


@pytest.mark.parametrize("east_m", [-20, 0, 100, 200, 220])
def test_buildings_beside_the_whole_of_a_path_are_near_it_and_others_are_not(east_m: float) -> None:
    boxes = (
        Box(east_m, 30, 10, 10, 12),
        Box(east_m, -42, 10, 10, 12),
        Box(290, 0, 10, 10, 12),
        Box(-90, 0, 10, 10, 12),
    )
    rows, corners, roofs = Solids(Obstacles(None, boxes)).corners_near(
        np.array([[0.0, 0, 20]]), np.array([[200.0, 0, 150]]), margin_m=30.0
    )
    assert (rows.tolist(), roofs.tolist()) == ([0], [12])
    assert sorted(map(tuple, corners[0].tolist())) == [
        (east_m + side, 30 + along) for side in (-5, 5) for along in (-5, 5)
    ]


def test_survivors_stand_on_the_hills_and_a_share_of_them_is_buried(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        **{"mission.survivors": 20, "mission.buried": 0.3, "world.terrain_m": 40, "nodes.altitude_m": 90}
    )
    solids = Solids(obstacles(scenario, np.array(positions(scenario))))
    found = Survivors(scenario, solids.ground_m)
    assert found.buried.sum() == 6
    assert found.places[:, 2].max() > 10
    assert np.abs(solids.gap_m(found.places)).max() < 1e-9


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        (
            {"mission.survivors": 3, "mission.survivor_positions_m": ((1, 2),)},
            "has 1 entries; .* mission.survivors = 3",
        ),
        (
            {"mission.survivors": 1, "mission.survivor_positions_m": ((900, 2),), "world.area_m": 1000},
            r"survivor_positions_m\.0 = \[900, 2\] must be within \+-world.area_m / 2 = 500",
        ),
        ({"mission.survivors": 1, "mission.survivors_in": "buildings"}, "needs world.buildings"),
    ],
)
def test_places_that_cannot_be_are_refused_by_name(
    make_scenario: MakeScenario, keys: dict[str, Any], named: str
) -> None:
    with pytest.raises(ConfigError, match=named):
        make_scenario(**keys)


# --- no-fly areas -----------------------------------------------------------------------------------------------------


def test_entries_into_a_no_fly_area_are_counted_once_each() -> None:
    area = NoFlyEntries([(100, 0, 30)], np.array([[0.0, 0, 50], [50, 0, 50]]))
    ways = (50, 60, 80, 100, 120, 140, 100, 200, 0)
    for came_from, east in pairwise(ways):
        area.watch(np.array([[0.0, 0, 50], [came_from, 0, 50]]), np.array([[0.0, 0, 50], [east, 0, 50]]))
    assert area.entries == 3, "into it and through it, into it and out of it, and straight through within one step"


def test_a_start_within_a_no_fly_area_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"world.no_fly_m.1: node 2 starts within it"):
        NoFlyEntries([(900, 0, 30), (50, 0, 30)], np.array([[0.0, 0, 50], [50, 0, 50]]))


# --- heights from files -----------------------------------------------------------------------------------------------


def slope(tmp_path: Path, *, columns: int = 61, rows: int = 41, cell_m: float = 20.0) -> Path:
    """Rises by 0.1 m a metre to the east and by 0.05 to the north, from 200 m above the sea."""
    lines = [f"ncols {columns}", f"nrows {rows}", "xllcorner 350000", "yllcorner 4100000", f"cellsize {cell_m}"]
    for row in range(rows):  # the northernmost first
        north = (rows - 1 - row) * cell_m
        lines.append(" ".join(f"{200 + 0.1 * column * cell_m + 0.05 * north:.3f}" for column in range(columns)))
    path = tmp_path / "slope.asc"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_an_ascii_grid_rises_where_the_file_does(make_scenario: MakeScenario, tmp_path: Path) -> None:
    path = slope(tmp_path)
    scenario = make_scenario(
        **{"world.heightmap": str(path), "world.area_m": 800, "nodes.count": 2, "nodes.altitude_m": 200}
    )
    solids = Solids(obstacles(scenario, np.array(positions(scenario))))
    middle, east, north = solids.ground_m(np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0]])).tolist()
    assert middle == pytest.approx(0.1 * 600 + 0.05 * 400, abs=0.01)
    assert east - middle == pytest.approx(10, abs=0.01)
    assert north - middle == pytest.approx(5, abs=0.01)


def test_a_path_is_taken_from_the_scenario_files_folder(tmp_path: Path) -> None:
    slope(tmp_path)
    file = tmp_path / "s.toml"
    file.write_text(
        "duration_s = 5\n[clusters]\ncount = 1\n"
        '[nodes]\ncount = 2\naltitude_m = 200\n[world]\narea_m = 800\nheightmap = "slope.asc"\n'
    )
    scenario = config.load(file)
    assert obstacles(scenario, np.array(positions(scenario))).hills is not None


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "neither an ASCII grid"),
        ("ncols 2\nnrows 2\ncellsize 10\n1 2 3\n", "3 heights, not 2 x 2"),
        (
            "ncols 2\nnrows 2\ncellsize 790\nNODATA_value -9\n1 2\n-9 3\n",
            r"1 cell within .* = 800 has no data, or .*: the first has the value of a void \(line 6, column 1\)",
        ),
        ("ncols 2\nnrows 2\ncellsize 0\n1 2 3 4\n", "cell size in"),
        ("ncols 2\nnrows 2\ncellsize 790\n1 2\n3 nan\n", "1 cell within .* has no data"),
        ("ncols 2\nnrows 2\ncellsize 790\n1 2\n3 *\n", r"1 cell within .* no data.* \(line 5, column 2\)"),
        ("ncols 2\nnrows 2\ncellsize 790\nNODATA_value null\nnull 2\n3 4\n", r"1 cell .* \(line 5, column 1\)"),
        ("north: 5\nsouth: 1\n", "line 1: 'north: 5' is no line of the header .*gdal_translate -of AAIGrid"),
        ("ncols 2\nnrows 2\ncellsize 10\n1 2 3 4\n", r"covers 20 m to the east, which must be >= world.area_m = 800"),
    ],
)
def test_a_heightmap_that_is_none_is_refused_by_name(
    make_scenario: MakeScenario, tmp_path: Path, text: str, named: str
) -> None:
    path = tmp_path / "bad.asc"
    path.write_text(text)
    scenario = make_scenario(**{"world.heightmap": str(path), "world.area_m": 800})
    with pytest.raises(ConfigError, match=named):
        obstacles(scenario, np.array(positions(scenario)))
    with pytest.raises(ConfigError, match="cannot be read"):
        heights_of(tmp_path / "none.asc")


def heights_of(path: Path, *, area_m: float = 1) -> heightmap.Heightmap:
    return heightmap.read(path, origin_deg=PARIS[:2], area_m=area_m)


def town_of(path: Path) -> footprints.Town:
    return footprints.read(path, origin_deg=PARIS[:2], height_m=19.0, area_m=1000.0)


# --- buildings from files ---------------------------------------------------------------------------------------------


def geojson(tmp_path: Path, *buildings: tuple[list[tuple[float, float]], dict[str, Any]]) -> Path:
    """Buildings given by their corners in metres about Paris."""
    features = []
    for corners, properties in buildings:
        ring = [to_geodetic(Enu(east, north, 0.0), PARIS) for east, north in (*corners, corners[0])]
        polygon = {"type": "Polygon", "coordinates": [[[g.lon_deg, g.lat_deg] for g in ring]]}
        features.append({"type": "Feature", "properties": properties, "geometry": polygon})
    features.append({"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [2.35, 48.85]}})
    path = tmp_path / "town.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def turned(corners: list[tuple[float, float]], degrees: float, about: tuple[float, float]) -> list[tuple[float, float]]:
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [(about[0] + cos * x - sin * y, about[1] + sin * x + cos * y) for x, y in corners]


HOUSE = [(-20.0, -5.0), (20.0, -5.0), (20.0, 5.0), (0.0, 5.0), (0.0, 4.0), (-18.0, 4.0), (-20.0, 2.0)]


def test_a_building_is_the_smallest_rectangle_about_its_outline(tmp_path: Path) -> None:
    path = geojson(
        tmp_path,
        (turned(HOUSE, 30, (100, 50)), {"height": "12 m"}),
        (turned(HOUSE, 0, (-80, 0)), {"building:levels": 4}),
        (turned(HOUSE, 0, (0, 90)), {}),
    )
    first, second, third = town_of(path).boxes
    assert (first.east, first.north) == pytest.approx((100, 50), abs=0.05)
    assert (first.width, first.depth, math.degrees(first.yaw)) == pytest.approx((40, 10, 30), abs=0.05)
    assert (first.height, second.height, third.height) == (12.0, 12.0, 19.0)


@pytest.mark.parametrize("engine", ["kinematic", "pybullet", *slow("rotors")])
def test_a_turned_building_hides_and_is_hit_where_it_stands(
    make_scenario: MakeScenario, tmp_path: Path, engine: str
) -> None:
    path = geojson(tmp_path, (turned(HOUSE, 90, (0, 0)), {"height": 40}))
    scenario = make_scenario(
        **{"world.buildings_geojson": str(path), "nodes.count": 1, "nodes.layout": "explicit",
           "nodes.positions_m": ((-60, 0, 20),), "world.area_m": 500},
    )  # fmt: skip
    solid = obstacles(scenario, np.array(positions(scenario)))
    made: Engine
    if engine == "pybullet":
        made = Physics(physics_hz=240, obstacles=solid)
    else:
        made = Kinematic(Solids(solid)) if engine == "kinematic" else Rotors(IRIS, solids=Solids(solid))
    made.reset(np.array([[-60.0, 0, 20]]))
    first = np.array([[-60.0, 0, 20], [-60, 18, 20], [-60, 22, 20], [-60, 0, 41]])
    assert Solids(solid).blocked(first, first + np.array([120.0, 0, 0])).tolist() == [True, True, False, False]
    for _ in range(200):
        made.advance(0.05, np.array([[8.0, 0, 0]]))
    assert made.contacts() == [(0, 1)]
    assert -6.5 < made.positions()[0, 0] < -5, "its wall is at -5 m now, and nobody creeps into it"
    made.close()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("{", "is no JSON"),
        ("[]", "holds no Polygon"),
        ("[1]", "no GeoJSON of buildings"),
        ('{"type": "Topology", "arcs": []}', "it is TopoJSON; convert it"),
        ('{"geometryType": "esriGeometryPolygon", "features": []}', "it is Esri's JSON; convert it"),
        ('{"type": "FeatureCollection", "features": []}', "holds no Polygon"),
        ('{"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}', "four positions"),
        ('{"type": "Polygon", "coordinates": [[[200, 0], [1, 1], [1, 2], [0, 0]]]}', "longitude and latitude"),
    ],
)
def test_a_file_without_buildings_is_refused_by_name(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "bad.geojson"
    path.write_text(text)
    with pytest.raises(ConfigError, match=named):
        town_of(path)


def test_buildings_far_from_the_origin_and_on_a_start_are_refused(make_scenario: MakeScenario, tmp_path: Path) -> None:
    path = str(geojson(tmp_path, (turned(HOUSE, 0, (0, 0)), {"height": 90})))
    far = make_scenario(**{"world.buildings_geojson": path, "world.origin_deg": (10.0, 10.0)})
    with pytest.raises(ConfigError, match=r"is world\.origin_deg right"):
        obstacles(far, np.array(positions(far)))
    exchanged = make_scenario(**{"world.buildings_geojson": path, "world.origin_deg": (PARIS[1], PARIS[0])})
    with pytest.raises(ConfigError, match=r"the middle of the file is \[.*: are longitude and latitude exchanged"):
        obstacles(exchanged, np.array(positions(exchanged)))
    there = make_scenario(**{"world.buildings_geojson": path, "nodes.count": 1})
    with pytest.raises(ConfigError, match="node 1 starts within the building"):
        obstacles(there, np.array(positions(there)))
