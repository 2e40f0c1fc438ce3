"""Areas, no-fly areas and people from the files of ground stations and maps."""

import json
import math
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import examples

from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Geodetic, to_geodetic
from fanet_mw.scenario import Scenario, config, map_files
from fanet_mw.units import Enu

ORIGIN = Geodetic(47.3, 8.5, 0.0)
SQUARE = [(-300.0, -200.0), (300.0, -200.0), (300.0, 200.0), (-300.0, 200.0)]
TOWER = [(90.0, 90.0), (110.0, 90.0), (110.0, 110.0), (90.0, 110.0)]
PEOPLE = [(10.0, 20.0), (-100.0, 150.0)]


def degrees(point: tuple[float, float]) -> tuple[float, float]:
    place = to_geodetic(Enu(*point, 0.0), ORIGIN)
    return place.lat_deg, place.lon_deg


def lonlat(points: list[tuple[float, float]]) -> list[list[float]]:
    return [[lon, lat] for lat, lon in map(degrees, points)]


def kml(polygons: list[list[tuple[float, float]]], points: list[tuple[float, float]] = []) -> str:  # noqa: B006
    rings = "".join(
        "<Placemark><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        + " ".join(f"{lon},{lat},0" for lon, lat in lonlat([*ring, ring[0]]))
        + "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>"
        for ring in polygons
    )
    marks = "".join(
        f"<Placemark><Point><coordinates>{lon},{lat}</coordinates></Point></Placemark>" for lon, lat in lonlat(points)
    )
    return f'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{rings}{marks}</Document></kml>'


def plan() -> str:
    center = [*degrees((0.0, -100.0))]
    return json.dumps({
        "fileType": "Plan", "version": 1,
        "geoFence": {
            "polygons": [
                {"inclusion": True, "polygon": [list(degrees(point)) for point in SQUARE], "version": 1},
                {"inclusion": False, "polygon": [list(degrees(point)) for point in TOWER], "version": 1},
            ],
            "circles": [{"inclusion": False, "circle": {"center": center, "radius": 25.0}, "version": 1}],
            "version": 2,
        },
        "mission": {"items": [{"command": 16, "params": [0, 0, 0, None, *degrees(SQUARE[0]), 50]}]},
        "rallyPoints": {"points": [[*degrees(point), 30] for point in PEOPLE], "version": 2},
    })  # fmt: skip


def geojson() -> str:
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "Polygon", "coordinates": [lonlat([*SQUARE, SQUARE[0]])]},
        },
        {"type": "Feature", "properties": {}, "geometry": {"type": "MultiPoint", "coordinates": lonlat(PEOPLE)}},
        {"type": "Feature", "properties": {}, "geometry": None},
    ]
    return json.dumps({"type": "FeatureCollection", "features": features})


def waypoints() -> str:
    home = degrees((0.0, 0.0))
    rows = [(0, 0, 16, *home), *((n + 1, 3, 16, *degrees(at)) for n, at in enumerate(SQUARE)), (5, 3, 20, 0.0, 0.0)]
    return "QGC WPL 110\n" + "".join(
        f"{n}\t0\t{frame}\t{c}\t0\t0\t0\t0\t{lat}\t{lon}\t50\t1\n" for n, frame, c, lat, lon in rows
    )


def wpl(*rows: tuple[float, ...], home: bool = True) -> str:
    """A list of waypoints: index, frame, command, first parameter, latitude, longitude."""
    every = [(0, 0, 16, 0, 47.3, 8.5), *rows] if home else rows
    lines = (
        f"{n}\t0\t{frame}\t{command}\t{p}\t0\t0\t0\t{lat}\t{lon}\t50\t1\n" for n, frame, command, p, lat, lon in every
    )
    return "QGC WPL 110\n" + "".join(lines)


def scenario(folder: Path, text: str) -> Scenario:
    path = folder / "search.toml"
    path.write_text(f"[nodes]\ncount = 9\n{text}", encoding="utf-8")
    return config.load(path)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "area.kml").write_text(kml([SQUARE]), encoding="utf-8")
    (tmp_path / "area.geojson").write_text(geojson(), encoding="utf-8")
    (tmp_path / "area.plan").write_text(plan(), encoding="utf-8")
    (tmp_path / "area.waypoints").write_text(waypoints(), encoding="utf-8")
    (tmp_path / "towers.kml").write_text(kml([TOWER]), encoding="utf-8")
    (tmp_path / "people.kml").write_text(kml([], PEOPLE), encoding="utf-8")
    with zipfile.ZipFile(tmp_path / "area.kmz", "w") as archive:
        archive.writestr("doc.kml", kml([SQUARE]))
    return tmp_path


@pytest.mark.parametrize("kind", ["kml", "kmz", "geojson", "plan", "waypoints"])
def test_an_area_of_any_kind_of_file_is_the_square_around_it(files: Path, kind: str) -> None:
    found = scenario(files, f'[mission]\narea = "area.{kind}"')
    assert found.world.origin_deg == pytest.approx((ORIGIN.lat_deg, ORIGIN.lon_deg), abs=2e-6)
    assert found.world.area_m == pytest.approx(600, abs=1.5)


def test_an_area_changes_neither_origin_nor_size_that_are_there(files: Path) -> None:
    found = scenario(files, '[mission]\narea = "area.kml"\n[world]\norigin_deg = [47.3, 8.501]\narea_m = 900')
    assert found.world.origin_deg == (47.3, 8.501)
    assert found.world.area_m == 900


@pytest.mark.parametrize(
    "world", ["area_m = 400", "area_m = 600\norigin_deg = [47.3, 8.51]", "area_m = 1.0e6\norigin_deg = [8.5, 47.3]"]
)
def test_a_square_that_leaves_some_of_the_area_unsearched_is_refused(files: Path, world: str) -> None:
    """A search flew over a place that had been given by mistake, and nothing said that it was another one."""
    with pytest.raises(ConfigError, match=r"area\.kml: its polygons reach \d+ m .* world\.area_m / 2 = [235]"):
        scenario(files, f'[mission]\narea = "area.kml"\n[world]\n{world}')


def test_an_origin_with_units_is_one_and_what_is_none_is_one_sentence(files: Path) -> None:
    """Both were tracebacks; elsewhere in a scenario a number may be text with its unit."""
    found = scenario(files, '[mission]\narea = "area.kml"\n[world]\norigin_deg = ["47.3 deg", "8.5"]\narea_m = "1 km"')
    assert found.world.origin_deg == (47.3, 8.5)
    for wrong in ('["north", 8.5]', "[147.3, 8.5]", "[47.3]", "47.3", "[true, 8.5]", "[nan, 8.5]"):
        with pytest.raises(ConfigError, match=r"world\.origin_deg = .* must be latitude and longitude, within 90 and"):
            scenario(files, f'[mission]\narea = "area.kml"\n[world]\norigin_deg = {wrong}')
    with pytest.raises(ConfigError, match=r"world\.no_fly_m = 3"):
        scenario(files, '[world]\nno_fly = "towers.kml"\nno_fly_m = 3\norigin_deg = [47, 8]')
    with pytest.raises(ConfigError, match=r"world = 3"):
        config.parse('world = 3\nmission.area = "area.kml"', source="s", name="s", folder=files)


def test_no_change_of_one_run_moves_the_origin_about_which_people_are_laid(files: Path) -> None:
    """They and the area went along with it, to a place that the file does not name."""
    path = files / "search.toml"
    path.write_text('[nodes]\ncount = 9\n[mission]\narea = "area.kml"\nsurvivors_at = "people.kml"')
    with pytest.raises(ConfigError, match=r"--set changes world\.origin_deg, but .* laid about \[47\.3, 8\.5\]"):
        config.load(path, ["world.origin_deg=[47.31, 8.5]"])
    config.load(path, ["world.area_m=800"])


def test_fences_to_stay_outside_are_no_fly_areas(files: Path) -> None:
    found = scenario(files, '[mission]\narea = "area.plan"\n[world]\nno_fly = "area.plan"\nno_fly_m = [[1, 2, 3]]')
    first, tower, circle = found.world.no_fly_m
    assert first == (1, 2, 3)
    assert tower == pytest.approx((100, 100, 14.15), abs=0.1)
    assert circle == pytest.approx((0, -100, 25), abs=0.1)
    found = scenario(files, '[mission]\narea = "area.plan"\n[world]\nno_fly = "towers.kml"')
    assert found.world.no_fly_m[0] == pytest.approx((100, 100, 14.15), abs=0.1)


@pytest.mark.parametrize("name", ["people.kml", "area.plan", "area.geojson"])
def test_points_are_people(files: Path, name: str) -> None:
    found = scenario(files, f'[mission]\narea = "area.kml"\nsurvivors_at = "{name}"')
    assert found.mission.survivors == 2
    for at, wanted in zip(found.mission.survivor_positions_m, PEOPLE, strict=True):
        assert at == pytest.approx(wanted, abs=0.1)


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("x.kml", "<kml", "cannot be read as .kml"),
        ("x.kml", '<!DOCTYPE x [<!ENTITY a "b">]><kml/>', "entities"),
        ("x.kml", kml([[(0, 0), (1, 1), (0, 0)]]), "has 2 corners, must be >= 3"),
        ("x.kml", kml([[(0, 0), (100, 100), (900, 900), (0, 0)]]), "all corners of a polygon lie on a line"),
        ("x.kml", kml([], PEOPLE), "it holds no polygon"),
        ("x.kml", "<kml><Polygon><coordinates>8.5,97 1,2 3,4</coordinates></Polygon></kml>", "within 90 and 180"),
        ("x.geojson", '{"type": "Polygon", "coordinates": [[["a", 1], [2, 3], [4, 5]]]}', "cannot be read"),
        ("x.geojson", "[" * 100_000, "cannot be read"),
        ("x.plan", '{"fileType": "Mission"}', 'fileType is not "Plan"'),
        ("x.plan", "[]", "cannot be read"),
        ("x.waypoints", "hello", "first line is not QGC WPL"),
        ("x.kml", '<?xml version="1.0" encoding="klingon"?><kml/>', "cannot be read as .kml: unknown encoding"),
        ("x.kml", "<kml><Point><coordinates>8.5, 47.3, 0</coordinates></Point></kml>", "'8.5,' must be longitude,lat"),
        ("x.geojson", "null", "cannot be read as .geojson"),
        ("x.geojson", json.dumps({"crs": {"properties": {"name": "EPSG:2056"}}, **json.loads(geojson())}), "EPSG:2056"),
        ("x.geojson", '{"type": "Polygon", "coordinates": [[[true, 1], [2, 3], [4, 5]]]}', "1 and longitude True must"),
        (
            "x.plan",
            plan().replace('"inclusion": true', '"inclusion": "false"'),
            "inclusion = 'false' must be true or f",
        ),
        ("x.waypoints", wpl((1, 3, 16, 0, 0.0, 0.0)), "line 3: '1\\t0\\t3\\t16"),
        ("x.waypoints", wpl((1, 3, 16, 0, 0.0, 0.0)), "latitude and longitude 0"),
        ("x.waypoints", wpl((1, 1, 16, 0, 10.0, 20.0)), "frame 1 has no latitude"),
        ("x.waypoints", "QGC WPL 110\n0\t1\t0\t16\n1\t0", "line 3: '1\\t0'"),
        ("x.waypoints", "QGC WPL 110\n" + "0 " * 12 + "\n1 0 3 16 0 0 0 0 47,3 8,5 50 1", "line 3: '1 0 3 16"),
        (
            "x.waypoints",
            wpl((1, 3, 16, 0, 47.0, 8.0), (2, 3, 16, 0, 47, 8.1), (3, 3, 16, 0, 71, 9)),
            "must be <= 1e+06",
        ),
        ("x.kmz", "no zip", "is no KMZ"),
        ("x.shp", "", "must be a .geojson"),
    ],
)
def test_what_cannot_be_used_is_one_line_with_the_file(tmp_path: Path, name: str, content: str, why: str) -> None:
    (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"mission\.area = ") as caught:
        scenario(tmp_path, f'[mission]\narea = "{name}"')
    assert why in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("item", "why"),
    [
        ({"params": [0, 0, 0, None, None, None, 50]}, "latitude None and longitude None must"),
        ({"params": [0, 0, 0, None, 0, 0, 50]}, "latitude and longitude 0"),
        ({"frame": 1, "params": [0, 0, 0, None, 47.3, 8.5, 50]}, "frame 1 has no latitude"),
    ],
)
def test_a_waypoint_at_no_place_is_nobody_s_place_and_matters_to_no_area(
    tmp_path: Path, item: dict[str, object], why: str
) -> None:
    fence = {"inclusion": True, "polygon": [list(degrees(point)) for point in SQUARE]}
    tree = {"fileType": "Plan", "geoFence": {"polygons": [fence]}, "mission": {"items": [{"command": 16, **item}]}}
    (tmp_path / "x.plan").write_text(json.dumps(tree))
    assert scenario(tmp_path, '[mission]\narea = "x.plan"').world.area_m == 600
    with pytest.raises(ConfigError) as caught:
        scenario(tmp_path, '[mission]\narea = "x.plan"\nsurvivors_at = "x.plan"')
    assert "mission.survivors_at = " in str(caught.value)
    assert why in str(caught.value)


@pytest.mark.parametrize(("polygons", "side_m"), [((), 600), ((SQUARE,), None)])
def test_a_circle_to_stay_inside_is_area_alone_and_beside_polygons(
    tmp_path: Path, polygons: tuple[list[tuple[float, float]], ...], side_m: int | None
) -> None:
    circle = {"inclusion": True, "circle": {"center": [*degrees((0.0, 2000.0 if polygons else 0.0))], "radius": 300.0}}
    fences = [{"inclusion": True, "polygon": [list(degrees(point)) for point in square]} for square in polygons]
    tree = {"fileType": "Plan", "geoFence": {"polygons": fences, "circles": [circle]}}
    (tmp_path / "round.plan").write_text(json.dumps(tree))
    area_m = scenario(tmp_path, '[mission]\narea = "round.plan"').world.area_m
    assert area_m == pytest.approx(side_m, abs=2) if side_m else area_m > 2300


@pytest.mark.parametrize("home", [True, False])
def test_fences_and_rally_points_of_mission_planner_are_read(tmp_path: Path, home: bool) -> None:
    inside, outside = ([(command, 4, *degrees(at)) for at in ring] for command, ring in ((5001, SQUARE), (5002, TOWER)))
    rest = [(5004, 25, *degrees((0.0, -100.0))), *((5100, 0, *degrees(point)) for point in PEOPLE)]
    rows = [(n, 3, *row) for n, row in enumerate([*inside, *outside, *rest], start=int(home))]
    (tmp_path / "fence.waypoints").write_text(wpl(*rows, home=home))
    names = 'area = "fence.waypoints"\nsurvivors_at = "fence.waypoints"\n[world]\nno_fly = "fence.waypoints"'
    found = scenario(tmp_path, f"[mission]\n{names}")
    assert found.world.area_m == pytest.approx(600, abs=1.5)
    assert found.world.no_fly_m[0] == pytest.approx((100, 100, 14.15), abs=0.1)
    assert found.world.no_fly_m[1] == pytest.approx((0, -100, 25), abs=0.1)
    assert found.mission.survivor_positions_m[1] == pytest.approx(PEOPLE[1], abs=0.1)


@pytest.mark.parametrize(("west", "east", "middle"), [(179.999, -179.998, -179.9995), (-179.999, 179.996, 179.9985)])
def test_an_area_across_180_degrees_is_one(tmp_path: Path, west: float, east: float, middle: float) -> None:
    corners = [[west, -16.5], [east, -16.5], [east, -16.501], [west, -16.501]]
    (tmp_path / "fiji.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [[*corners, corners[0]]]}))
    world = scenario(tmp_path, '[mission]\narea = "fiji.geojson"').world
    assert world.origin_deg == pytest.approx((-16.5005, middle))
    assert world.area_m == pytest.approx(
        60.0 * 1852 * abs(east - west - math.copysign(360, east - west)) * 0.959, rel=0.01
    )


def test_of_a_list_without_home_the_first_waypoint_counts(tmp_path: Path) -> None:
    (tmp_path / "people.waypoints").write_text(
        wpl(*((n, 3, 16, 0, *degrees(at)) for n, at in enumerate(PEOPLE)), home=False)
    )
    names = f'survivors_at = "people.waypoints"\n[world]\norigin_deg = [{ORIGIN.lat_deg}, {ORIGIN.lon_deg}]'
    found = scenario(tmp_path, f"[mission]\n{names}").mission.survivor_positions_m
    assert [round(east) for east, _ in found] == [round(east) for east, _ in PEOPLE]


@pytest.mark.parametrize(("encoding", "end"), [("utf-16", "\n"), ("utf-8-sig", "\r"), ("ascii", "\r\n")])
def test_text_of_any_system_is_read(tmp_path: Path, encoding: str, end: str) -> None:
    (tmp_path / "area.waypoints").write_bytes(waypoints().replace("\n", end).encode(encoding))
    assert scenario(tmp_path, '[mission]\narea = "area.waypoints"').world.area_m == pytest.approx(600, abs=1.5)


@pytest.mark.parametrize(
    ("at", "value", "why"),
    [(6, b"\1", "doc.kml is encrypted"), (8, b"\x0e", "compressed by method 14"), (60, b"\xff" * 9, "is no KMZ: ")],
)
def test_an_archive_that_cannot_be_unpacked_is_one_line(tmp_path: Path, at: int, value: bytes, why: str) -> None:
    path = tmp_path / "x.kmz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", kml([SQUARE], PEOPLE))
    data = bytearray(path.read_bytes())
    for start in (at, data.index(b"PK\1\2") + at + 2) if at < 60 else (at,):
        data[start : start + len(value)] = value
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=why):
        scenario(tmp_path, '[mission]\narea = "x.kmz"')


def test_the_root_of_an_archive_is_read_whatever_comes_first(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.kmz", "w") as archive:
        archive.writestr("files/overlay.kml", kml([TOWER]))
        archive.writestr("doc.kml", kml([SQUARE]))
    assert scenario(tmp_path, '[mission]\narea = "x.kmz"').world.area_m == pytest.approx(600, abs=1.5)


def test_places_far_from_the_origin_are_told_with_their_file(files: Path) -> None:
    for key in ('[mission]\nsurvivors_at = "people.kml"\n[world]', '[world]\nno_fly = "towers.kml"'):
        with pytest.raises(
            ConfigError, match=r"(people|towers)\.kml: a place is .* m from world.origin_deg = \[0, 0\]"
        ):
            scenario(files, f"{key}\norigin_deg = [0, 0]")


def test_what_needs_an_origin_says_so_and_what_is_not_there_is_named(files: Path) -> None:
    with pytest.raises(ConfigError, match=r"needs world.origin_deg, or mission.area"):
        scenario(files, '[mission]\nsurvivors_at = "people.kml"')
    with pytest.raises(ConfigError, match=r"nowhere.kml"):
        scenario(files, '[mission]\narea = "nowhere.kml"')
    with pytest.raises(ConfigError, match=r"mission\.area = .*: is read with a scenario file only"):
        config.build({"mission": {"area": "area.kml"}})
    with pytest.raises(ConfigError, match="no area to stay out of"):
        scenario(files, '[mission]\narea = "area.kml"\n[world]\nno_fly = "people.kml"')


@given(
    st.binary(max_size=200), st.sampled_from([".kml", ".kmz", ".geojson", ".plan", ".waypoints"]), st.integers(0, 10**6)
)
@examples(200)
def test_any_bytes_are_shapes_or_one_message(
    tmp_path_factory: pytest.TempPathFactory, noise: bytes, kind: str, at: int
) -> None:
    whole = {".kml": kml([SQUARE], PEOPLE), ".geojson": geojson(), ".plan": plan(), ".waypoints": waypoints()}
    text = whole.get(kind, "").encode()
    data = text[: at % (len(text) + 1)] + noise + text[at % (len(text) + 1) + len(noise) :]
    path = tmp_path_factory.getbasetemp() / f"fuzz{kind}"
    path.write_bytes(data)
    try:
        shapes = map_files.read(path)
    except ConfigError:
        return
    for lat, lon in [*shapes.points, *(point for ring in shapes.inside for point in ring)]:
        assert abs(lat) <= 90
        assert abs(lon) <= 180
