"""Areas, no-fly areas and people from the files of ground stations and maps, as values of a scenario.

    mission.area = "area.kml"           -> world.origin_deg and world.area_m: the least square around its polygons
    world.no_fly = "fence.plan"         -> world.no_fly_m: a circle around each polygon, and each circle
    mission.survivors_at = "people.kml" -> mission.survivor_positions_m, one for each point

Read are GeoJSON (RFC 7946), KML and KMZ (OGC 12-007r2), plans of QGroundControl (.plan) and lists of waypoints
(QGC WPL 110); docs/how-to/write-a-scenario.md says what of a plan becomes the area, no-fly areas and points.
"""

import io
import json
import math
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.geodesy import Geodetic, to_enu, to_geodetic
from fanet_mw.scenario.outlines import half_turn, require_degrees
from fanet_mw.scenario.quantities import in_unit_of
from fanet_mw.scenario.text_files import decoded
from fanet_mw.units import Enu

_MOST_BYTES: Final = 16 << 20
_MOST_SHAPES: Final = 10_000
_FARTHEST_M: Final = 1e6
_ROUNDED_DEG: Final = 1e-6
"""Corners that are no farther than this from a line lie on it: 0.1 m."""
_ROUNDED_M: Final = 1.0
"""An area that reaches no farther than this beyond the square that is stated lies within it."""
_Point = tuple[float, float]
_WAYPOINT: Final = 16
_FENCE_VERTICES: Final = {5001: True, 5002: False}
_FENCE_CIRCLES: Final = {5003: True, 5004: False}
"""Commands of MAVLink; True: to stay inside."""
_RALLY: Final = 5100
_IN_DEGREES: Final = frozenset({0, 3, 5, 6, 10, 11})
"""The frames of MAVLink that hold latitude and longitude."""
_KEYS: Final = (("mission", "area"), ("world", "no_fly"), ("mission", "survivors_at"))


class Shapes(NamedTuple):
    """What a file holds, as latitudes and longitudes [degrees]."""

    inside: list[list[_Point]]
    """Polygons that are areas; of a circle the four outermost points."""
    outside: list[list[_Point]]
    """Polygons to stay out of; in a file that knows no such thing, the same."""
    circles: list[tuple[float, float, float]]
    """Circles to stay out of: latitude, longitude, radius [m]."""
    points: list[_Point]
    no_points: str = ""
    """Why what stands for points is none; who asks for no points need not care."""


def take_in(tree: dict[str, Any], folder: Path) -> tuple[float, float] | None:
    """Replace the keys of a scenario that name such files by what the files say; raises ConfigError.

    Returns the origin about which it is laid; None without such files.
    """
    if not all(isinstance(tree.get(table, {}), dict) for table in ("world", "mission")):
        return None  # whoever checks the tables says so
    found = {}
    for table, key in _KEYS:
        within = tree.get(table)
        if isinstance(within, dict) and isinstance(within.get(key), str) and within[key]:
            path = folder / within.pop(key)
            found[key] = f"{table}.{key} = {path}", read(path, key=f"{table}.{key}")
    if not found:
        return None
    world, mission = tree.setdefault("world", {}), tree.setdefault("mission", {})
    if "area" in found:
        said, shapes = found["area"]
        _take_area(world, said, shapes)
    if "origin_deg" not in world:
        raise ConfigError(f"{next(iter(found.values()))[0]}: needs world.origin_deg, or mission.area, which says it")
    origin = origin_of(world)
    if "no_fly" in found:
        _take_no_fly(world, *found["no_fly"], origin)
    if "survivors_at" in found:
        _take_people(mission, *found["survivors_at"], origin)
    return origin


def _take_no_fly(world: dict[str, Any], said: str, shapes: Shapes, origin: _Point) -> None:
    circles = [
        *(_around(ring, origin) for ring in shapes.outside),
        *(_circle(one, origin) for one in shapes.circles),
    ]
    if not circles:
        raise ConfigError(f"{said}: it holds no area to stay out of")
    for east, north, _ in circles:
        _require_near(said, (east, north), origin)
    stated = world.get("no_fly_m", [])
    if not isinstance(stated, list):
        raise ConfigError(f"world.no_fly_m = {stated!r:.40}: must be a list of [east, north, radius]")
    world["no_fly_m"] = [*stated, *circles]


def _take_people(mission: dict[str, Any], said: str, shapes: Shapes, origin: _Point) -> None:
    if shapes.no_points or not shapes.points:
        raise ConfigError(f"{said}: {shapes.no_points or 'it holds no points'}")
    places = [_flat(point, origin) for point in shapes.points]
    for place in places:
        _require_near(said, place, origin)
    mission["survivor_positions_m"] = [[round(part, 2) for part in place] for place in places]
    mission.setdefault("survivors", len(shapes.points))


def origin_of(world: dict[str, Any]) -> _Point:
    """Latitude and longitude of `world.origin_deg`, which may have units; raises ConfigError."""
    stated = world.get("origin_deg")
    numbers = [_number("origin_deg", part) for part in stated] if isinstance(stated, list | tuple) else []
    if len(numbers) != 2 or not (abs(numbers[0]) <= 90 and abs(numbers[1]) <= 180):
        raise ConfigError(
            f"world.origin_deg = {stated!r:.60}: must be latitude and longitude, within 90 and 180 degrees"
        )
    return numbers[0], numbers[1]


def _number(key: str, stated: Any) -> float:  # noqa: ANN401  (of TOML)
    """A number as the scenario's model reads it, in the unit of its key; nan for anything else."""
    if isinstance(stated, bool) or not isinstance(stated, int | float | str):
        return math.nan
    try:
        found = in_unit_of(key, stated) if isinstance(stated, str) else None
        return float(stated) if found is None else found
    except (ValueError, OverflowError):
        return math.nan


def _take_area(world: dict[str, Any], said: str, shapes: Shapes) -> None:
    points = [point for ring in shapes.inside for point in ring]
    if not points:
        raise ConfigError(f"{said}: it holds no polygon")
    start = points[0][1]
    lats, lons = [lat for lat, _ in points], [start + half_turn(lon - start) for _, lon in points]
    middle = (min(lats) + max(lats)) / 2, half_turn((min(lons) + max(lons)) / 2)
    world.setdefault("origin_deg", [round(part, 7) for part in middle])
    origin = origin_of(world)
    reach_m = max(abs(part) for point in points for part in _flat(point, origin))
    if "area_m" in world:
        half_m = _number("area_m", world["area_m"]) / 2
        if reach_m > half_m + _ROUNDED_M:
            raise ConfigError(
                f"{said}: its polygons reach {reach_m:.0f} m from world.origin_deg = [{origin[0]:g}, {origin[1]:g}], "
                f"beyond world.area_m / 2 = {half_m:g}: leave out area_m, or also the origin"
            )
    elif 2 * reach_m > _FARTHEST_M:
        raise ConfigError(f"{said}: the square around its polygons has {2 * reach_m:.0f} m, must be <= {_FARTHEST_M:g}")
    else:
        world["area_m"] = math.ceil(2 * reach_m)


def _require_near(said: str, place: tuple[float, float], origin: _Point) -> None:
    if math.hypot(*place) > _FARTHEST_M:
        raise ConfigError(
            f"{said}: a place is {math.hypot(*place):.0f} m from world.origin_deg = [{origin[0]:g}, {origin[1]:g}], "
            f"must be <= {_FARTHEST_M:g}"
        )


def _flat(point: _Point, origin: _Point) -> tuple[float, float]:
    at = to_enu(Geodetic(*point, 0.0), Geodetic(*origin, 0.0))
    return at.east, at.north


def _around(ring: list[_Point], origin: _Point) -> list[float]:
    """East, north and radius of a circle around a polygon: about the middle of its extent."""
    corners = [_flat(point, origin) for point in ring]
    east = (min(e for e, _ in corners) + max(e for e, _ in corners)) / 2
    north = (min(n for _, n in corners) + max(n for _, n in corners)) / 2
    radius_m = max(math.hypot(e - east, n - north) for e, n in corners)
    return [round(east, 2), round(north, 2), math.ceil(100 * radius_m) / 100]


def _circle(circle: tuple[float, float, float], origin: _Point) -> list[float]:
    east, north = _flat(circle[:2], origin)
    return [round(east, 2), round(north, 2), circle[2]]


# --- files --------------------------------------------------------------------------------------------------------


def read(path: Path, *, key: str = "file") -> Shapes:
    """What a file holds; raises ConfigError with what is wrong."""
    readers = {
        ".geojson": _geojson, ".json": _geojson, ".kml": _kml, ".kmz": _kmz, ".plan": _plan, ".waypoints": _waypoints,
        ".txt": _waypoints,
    }  # fmt: skip
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ConfigError(f"{key} = {path}: must be a .geojson, .kml, .kmz, .plan or .waypoints file")
    data = read_regular(path, most_bytes=_MOST_BYTES)
    try:
        shapes = reader(data)
    except (ValueError, ElementTree.ParseError, RecursionError) as error:
        raise ConfigError(f"{key} = {path}: cannot be read as {path.suffix}: {error}") from error
    except (TypeError, LookupError, AttributeError) as error:
        built = "" if type(error) is LookupError else "it is built otherwise: "  # that of its own is an encoding
        raise ConfigError(f"{key} = {path}: cannot be read as {path.suffix}: {built}{error}") from error
    except (zipfile.BadZipFile, EOFError, OSError, zlib.error, RuntimeError) as error:
        raise ConfigError(f"{key} = {path}: is no KMZ: {error}") from error
    return shapes


def _shapes(polygons: list[list[_Point]], points: list[_Point]) -> Shapes:
    if len(polygons) + len(points) > _MOST_SHAPES:
        raise ValueError(f"{len(polygons) + len(points)} shapes, must be <= {_MOST_SHAPES}")
    return Shapes(polygons, polygons, [], points)


def _place(lat: Any, lon: Any) -> _Point:  # noqa: ANN401  (of a file)
    numbers = all(isinstance(part, int | float | str) and not isinstance(part, bool) for part in (lat, lon))
    found = (float(lat), float(lon)) if numbers else (math.nan, math.nan)
    if not (abs(found[0]) <= 90 and abs(found[1]) <= 180):
        raise ValueError(f"latitude {lat!r:.20} and longitude {lon!r:.20} must be within 90 and 180 degrees")
    return found


def _flown(frame: Any, lat: Any, lon: Any) -> _Point:  # noqa: ANN401
    """The place of an item of a mission; flight controllers take two zeros for the place where they are."""
    if frame not in _IN_DEGREES:
        raise ValueError(f"frame {frame!r:.20} has no latitude and longitude")
    found = _place(lat, lon)
    if found == (0.0, 0.0):
        raise ValueError("an item has latitude and longitude 0, which is no place")
    return found


def _circle_of(place: _Point, radius: Any) -> tuple[float, float, float]:  # noqa: ANN401
    radius_m = float(radius)
    if not 0 < radius_m < _FARTHEST_M:
        raise ValueError(f"a circle has a radius of {radius_m:g} m, must be in (0, {_FARTHEST_M:g})")
    return (*place, radius_m)


def _ring(points: list[_Point]) -> list[_Point]:
    if len(set(points)) < 3:
        raise ValueError(f"a polygon has {len(set(points))} corners, must be >= 3")
    (lat, lon), *others = points
    far = max(others, key=lambda point: math.hypot(point[0] - lat, point[1] - lon))
    span_deg = math.hypot(far[0] - lat, far[1] - lon)
    aside = (abs((far[0] - lat) * (x - lon) - (far[1] - lon) * (y - lat)) for y, x in others)
    if max(aside) <= _ROUNDED_DEG * span_deg:
        raise ValueError(f"all corners of a polygon lie on a line, from {points[0]} to {far}")
    return points


def _geojson(data: bytes) -> Shapes:
    polygons: list[list[_Point]] = []
    points: list[_Point] = []

    def look(node: Any) -> None:  # noqa: ANN401  (JSON)
        kind = node["type"]
        if kind == "FeatureCollection":
            for feature in node["features"]:
                look(feature)
        elif kind == "Feature":
            if node.get("geometry") is not None:
                look(node["geometry"])
        elif kind == "GeometryCollection":
            for geometry in node["geometries"]:
                look(geometry)
        elif kind in ("Polygon", "MultiPolygon"):
            several = [node["coordinates"]] if kind == "Polygon" else node["coordinates"]
            polygons.extend(_ring([_place(lat, lon) for lon, lat, *_ in rings[0]]) for rings in several)
        elif kind in ("Point", "MultiPoint"):
            for lon, lat, *_ in [node["coordinates"]] if kind == "Point" else node["coordinates"]:
                points.append(_place(lat, lon))

    tree = json.loads(decoded(data))
    if isinstance(tree, dict):
        require_degrees(tree)
    look(tree)
    return _shapes(polygons, points)


def _kml(data: bytes) -> Shapes:
    if b"<!DOCTYPE" in data[:4096] or b"<!ENTITY" in data:
        raise ValueError("it declares entities, which no KML needs")
    polygons: list[list[_Point]] = []
    points: list[_Point] = []
    for element in ElementTree.fromstring(data).iter():  # noqa: S314  (entities are refused above)
        kind = element.tag.rpartition("}")[2]
        if kind == "Polygon":
            outer = next((one for one in element.iter() if one.tag.endswith("outerBoundaryIs")), None)
            polygons.append(_ring([*_coordinates(element if outer is None else outer)]))
        elif kind == "Point":
            points += _coordinates(element)
    return _shapes(polygons, points)


def _coordinates(element: ElementTree.Element) -> Iterator[_Point]:
    for one in element.iter():
        if one.tag.rpartition("}")[2] == "coordinates":
            for triple in (one.text or "").split():
                lon, lat, *_ = [*triple.split(","), ""]
                if not lat:
                    raise ValueError(f"{triple[:40]!r} must be longitude,latitude,height without blanks between them")
                yield _place(lat, lon)


def _kmz(data: bytes) -> Shapes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = [entry for entry in archive.infolist() if entry.filename.lower().endswith(".kml")]
        if not entries:
            raise ValueError("it holds no .kml")
        root = min(entries, key=lambda entry: (entry.filename.lower() != "doc.kml", "/" in entry.filename))
        if root.flag_bits & 1:
            raise ValueError(f"{root.filename} is encrypted")
        if root.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{root.filename} is compressed by method {root.compress_type}")
        with archive.open(root) as file:
            content = file.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        raise ValueError(f"{root.filename} is longer than {_MOST_BYTES} bytes")
    return _kml(content)


def _plan(data: bytes) -> Shapes:
    tree = json.loads(decoded(data))
    if tree.get("fileType") != "Plan":
        raise ValueError('its fileType is not "Plan"')
    fence = tree.get("geoFence") or {}
    inside, outside = list[list[_Point]](), list[list[_Point]]()
    circles = []
    for polygon in fence.get("polygons", ()):
        ring = _ring([_place(lat, lon) for lat, lon, *_ in polygon["polygon"]])
        (inside if _included(polygon) else outside).append(ring)
    for entry in fence.get("circles", ()):
        circle = _circle_of(_place(*entry["circle"]["center"][:2]), entry["circle"]["radius"])
        if _included(entry):
            inside.append(_extremes(circle))
        else:
            circles.append(circle)
    flown, no_points = [], ""
    for item in (tree.get("mission") or {}).get("items", ()):
        if isinstance(item.get("polygon"), list):
            inside.append(_ring([_place(lat, lon) for lat, lon, *_ in item["polygon"]]))
        elif item.get("command") == _WAYPOINT:
            try:
                flown.append(_flown(item.get("frame", 3), *item["params"][4:6]))
            except ValueError as error:
                no_points = no_points or str(error)
    rally = [_place(*point[:2]) for point in (tree.get("rallyPoints") or {}).get("points", ())]
    if len(inside) + len(outside) + len(rally) + len(flown) > _MOST_SHAPES:
        raise ValueError(f"more than {_MOST_SHAPES} shapes")
    return Shapes(inside, outside, circles, rally or flown, "" if rally else no_points)


def _included(entry: Any) -> bool:  # noqa: ANN401  (JSON)
    said = entry.get("inclusion", True)
    if said is not True and said is not False:  # the text "false" would be taken for true
        raise ValueError(f"inclusion = {said!r:.20} must be true or false")
    return bool(said)


def _extremes(circle: tuple[float, float, float]) -> list[_Point]:
    """The points of a circle farthest to the east, north, west and south."""
    lat, lon, radius_m = circle
    ways = ((radius_m, 0.0), (0.0, radius_m), (-radius_m, 0.0), (0.0, -radius_m))
    places = [to_geodetic(Enu(east, north, 0.0), Geodetic(lat, lon, 0.0)) for east, north in ways]
    return [_place(place.lat_deg, place.lon_deg) for place in places]


def _waypoints(data: bytes) -> Shapes:
    inside, outside = list[list[_Point]](), list[list[_Point]]()
    circles, points = [], dict[int, list[_Point]](((_WAYPOINT, []), (_RALLY, [])))
    vertices: dict[int, list[_Point]] = {command: [] for command in _FENCE_VERTICES}
    for command, parameter, place in _items(decoded(data).splitlines()):
        if command in _FENCE_VERTICES:
            vertices[command].append(place)
            if len(vertices[command]) >= parameter:
                (inside if _FENCE_VERTICES[command] else outside).append(_ring(vertices[command]))
                vertices[command] = []
        elif command not in _FENCE_CIRCLES:
            points[command].append(place)
        elif _FENCE_CIRCLES[command]:
            inside.append(_extremes(_circle_of(place, parameter)))
        else:
            circles.append(_circle_of(place, parameter))
    if left := sum(map(len, vertices.values())):
        raise ValueError(f"a fence ends after {left} of its corners")
    flown, rally = points[_WAYPOINT], points[_RALLY]
    if not (inside or outside or circles) and len(set(flown)) >= 3:
        inside = outside = [flown]
    if len(inside) + len(outside) + len(circles) + len(rally) + len(flown) > _MOST_SHAPES:
        raise ValueError(f"more than {_MOST_SHAPES} shapes")
    return Shapes(inside, outside, circles, rally or flown)


def _items(lines: list[str]) -> Iterator[tuple[int, float, _Point]]:
    """Command, first parameter and place of each item of a list of waypoints that has a meaning here."""
    if not lines or not lines[0].startswith("QGC WPL"):
        raise ValueError("its first line is not QGC WPL 110")
    known = {_WAYPOINT, _RALLY, *_FENCE_VERTICES, *_FENCE_CIRCLES}
    rows = [(n, line) for n, line in enumerate(lines[1:], start=2) if line.strip()]
    for number, line in rows:
        row = line.split("\t") if "\t" in line else line.split()
        try:
            command = int(row[3])
            is_home = command == _WAYPOINT and number == rows[0][0] and int(row[2]) == 0  # its height is above the sea
            if command in known and not is_home:
                yield command, float(row[4]), _flown(int(row[2]), *row[8:10])
        except (ValueError, IndexError, TypeError) as error:
            raise ValueError(f"line {number}: {line[:60]!r}: {error}") from error
