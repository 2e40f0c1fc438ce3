"""The outlines of buildings in a GeoJSON file (RFC 7946), as the tools of OpenStreetMap export it.

Read are collections of features, single ones and one a line (RFC 8142), with tags as properties, in `tags`
(osmtogeojson) or in `other_tags` (GDAL). A polygon is left out if it has less than three corners, or if its tags say
that it is no building, such as a park, or lies underground.
"""

import contextlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from fanet_mw.scenario.text_files import decoded

_NO_BUILDINGS: Final = (
    "landuse", "natural", "leisure", "waterway", "boundary", "highway", "place", "railway", "power", "barrier",
)  # fmt: skip
"""Tags of areas that are no buildings, unless they have the tag `building`, too."""
_BUILDING: Final = ("building", "building:part")
_OTHER_TAG: Final = re.compile(r'"([^"]+)"=>"([^"]*)"')
_WGS84: Final = re.compile(r"WGS ?84|CRS84|4326|4979|4258", re.IGNORECASE)
"""What names a reference system in longitude and latitude, as GeoJSON of 2008 still does."""
_TURN_DEG: Final = 360.0
_MOST_LON_DEG: Final = 190.0
"""Towns across 180 degrees are also written with longitudes that run on."""
_Ring = list[tuple[float, float]]


class Outline(NamedTuple):
    """The outline of one building, or of one part of it."""

    name: str
    """What a message calls it: its id, or its number in the file."""
    ring: _Ring
    """Longitude and latitude of its corners; across 180 degrees longitudes run on."""
    tags: Mapping[str, Any]


class Outlines(NamedTuple):
    """What a file holds."""

    buildings: list[Outline]
    broken: list[str]
    """The names of polygons that enclose nothing, each with the reason."""

    @property
    def middle_deg(self) -> tuple[float, float]:
        """Latitude and longitude of the middle of all outlines."""
        lons = [lon for outline in self.buildings for lon, _ in outline.ring]
        lats = [lat for outline in self.buildings for _, lat in outline.ring]
        return (min(lats) + max(lats)) / 2, half_turn((min(lons) + max(lons)) / 2)


def half_turn(degrees: float) -> float:
    """An angle in [-180, 180): the shorter way from one longitude to another."""
    return degrees if -180 <= degrees < 180 else (degrees + 180) % _TURN_DEG - 180


def parse(data: bytes) -> Outlines:
    """Read a file; raises ValueError with the reason if it holds no outline of a building."""
    buildings: list[Outline] = []
    broken: list[str] = []
    start: float | None = None
    for name, tags, points in _polygons(_tree(data)):
        if not _is_building(tags):
            continue
        try:
            ring = _ring(points)
        except (TypeError, IndexError, KeyError, ValueError) as error:
            reason = str(error) if isinstance(error, ValueError) else f"no list of positions: {str(points)[:60]}"
            broken.append(f"{name}: {reason}")
            continue
        start = ring[0][0] if start is None else start
        buildings.append(Outline(name, [(start + half_turn(lon - start), lat) for lon, lat in ring], tags))
    if not buildings:
        raise ValueError(broken[0] if broken else "it holds no Polygon of a building")
    return Outlines(buildings, broken)


def _tree(data: bytes) -> Any:  # noqa: ANN401  (JSON)
    text = decoded(data)
    try:
        tree = json.loads(text)
    except json.JSONDecodeError:
        lines = [line.strip("\x1e \r") for line in text.split("\n")]
        lines = [line for line in lines if line]
        if not lines or not all(line.startswith("{") and line.endswith("}") for line in lines):
            raise
        return {"type": "FeatureCollection", "features": [json.loads(line) for line in lines]}
    except ValueError as error:  # of Python, whose advice is not for users
        raise ValueError(str(error).partition(";")[0]) from error
    if isinstance(tree, list) and all(isinstance(feature, dict) for feature in tree):
        tree = {"type": "FeatureCollection", "features": tree}
    if isinstance(tree, dict) and "elements" in tree:
        raise ValueError("it is the JSON of Overpass; export it as GeoJSON")
    if isinstance(tree, dict) and (tree.get("type") == "Topology" or "geometryType" in tree):
        kind = "Esri's JSON" if "geometryType" in tree else "TopoJSON"
        raise ValueError(f"it is {kind}; convert it: ogr2ogr -f GeoJSON -t_srs EPSG:4326 town.geojson in.json")
    if not isinstance(tree, dict) or "type" not in tree:
        raise ValueError("it is no object with a type")
    require_degrees(tree)
    return tree


def require_degrees(tree: Mapping[str, Any]) -> None:
    """Raises ValueError if GeoJSON names a reference system other than longitude and latitude."""
    crs = tree.get("crs") or "WGS84"
    if isinstance(crs, dict) and isinstance(crs.get("properties"), dict):
        crs = crs["properties"].get("name", crs)
    if not _WGS84.search(str(crs)):
        raise ValueError(
            f"its crs is {str(crs)[:80]}; convert the file to EPSG:4326: "
            "ogr2ogr -t_srs EPSG:4326 out.geojson in.geojson"
        )


def _polygons(tree: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any], Any]]:
    """Name, tags and outer ring of every polygon."""
    if tree["type"] == "FeatureCollection":
        features = tree.get("features")
        if not isinstance(features, list):
            raise ValueError("its features are no list")
    else:
        features = [tree]
    for number, feature in enumerate(features, start=1):
        if not isinstance(feature, dict):
            continue
        is_feature = feature.get("type") == "Feature"
        tags = _tags(feature.get("properties")) if is_feature else {}
        name = str(tags.get("@id") or feature.get("id") or tags.get("osm_id") or tags.get("id") or f"feature {number}")
        geometry = feature.get("geometry") if is_feature else feature
        for ring in _rings(geometry, lines=any(key in tags for key in _BUILDING)):
            yield name, tags, ring


def _rings(geometry: object, *, lines: bool) -> Iterator[Any]:
    """The outer rings of a geometry; what has no area has none. `lines`: closed lines are outlines, too."""
    if not isinstance(geometry, dict):
        return
    inner = geometry.get("geometries" if geometry.get("type") == "GeometryCollection" else "coordinates")
    polygons = [inner] if geometry.get("type") == "Polygon" else inner
    if geometry.get("type") == "GeometryCollection":
        for each in inner or ():
            yield from _rings(each, lines=lines)
    elif geometry.get("type") in {"Polygon", "MultiPolygon"}:
        for polygon in polygons if isinstance(polygons, list) else [None]:
            yield polygon[0] if isinstance(polygon, list) and polygon else polygon
    elif (
        lines
        and geometry.get("type") == "LineString"
        and isinstance(inner, list)
        and inner[3:]
        and inner[0] == inner[-1]
    ):
        yield inner


def _tags(properties: object) -> Mapping[str, Any]:
    if not isinstance(properties, dict):
        return {}
    found: dict[str, Any] = {}
    others = properties.get("other_tags")
    if isinstance(others, str):
        found.update(_OTHER_TAG.findall(others))
    nested = properties.get("tags")
    if isinstance(nested, str) and nested.startswith("{"):
        with contextlib.suppress(ValueError):
            nested = json.loads(nested)
    if isinstance(nested, dict):
        found.update(nested)
    found.update((key, value) for key, value in properties.items() if value is not None)
    return {**{key.lower(): value for key, value in found.items()}, **found}  # shapefiles have HEIGHT


def _is_building(tags: Mapping[str, Any]) -> bool:
    if str(tags.get("location")).lower() == "underground":
        return False
    said = [tags[key] for key in _BUILDING if key in tags]
    if said:
        return any(str(value).lower() not in {"no", "false", "0"} for value in said)
    return not any(key in tags for key in _NO_BUILDINGS)


def _ring(points: Any) -> _Ring:  # noqa: ANN401  (JSON)
    """Longitude and latitude of the corners, closed; raises ValueError unless there are three of them."""
    ring = [(float(point[0]), float(point[1])) for point in points]
    if not all(math.isfinite(lon) and math.isfinite(lat) for lon, lat in ring):
        raise ValueError("a position is not finite")
    if any(abs(lon) > _MOST_LON_DEG or abs(lat) > 90 for lon, lat in ring):
        raise ValueError(
            f"a position must be longitude and latitude, not {points[0]!r}; convert the file to EPSG:4326: "
            "ogr2ogr -t_srs EPSG:4326 town.geojson in.geojson"
        )
    if len(set(ring)) < 3:
        raise ValueError(f"a ring must have four positions of longitude and latitude, not {points[:4]!r}")
    return ring if ring[0] == ring[-1] else [*ring, ring[0]]
