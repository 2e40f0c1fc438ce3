"""Buildings from a GeoJSON file (RFC 7946), as OpenStreetMap tools export them.

Each Polygon, and each part of a MultiPolygon, becomes an upright box: the smallest rectangle around its outer ring. Its
height is the property `height` [m]; if that is missing, `building:levels` (or `levels`) times 3 m; if that is missing,
too, the middle of `world.building_height_m`. Longitude and latitude are converted to east and north of
`world.origin_deg`, or of the middle of all buildings if that is unset. Other geometries are ignored. Not modeled:
courtyards, and roofs that are not flat.
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Geodetic, to_enu
from sim.world.engines.contract import Rows
from sim.world.environment.given_file import content

LEVEL_M: Final = 3.0
_LEAST_SIDE_M: Final = 0.1
_HIGHEST_M: Final = 2000.0


class Footprint(NamedTuple):
    """One building: the middle of its rectangle, its sides, its rotation, and its height above ground."""

    east: float
    north: float
    width: float
    depth: float
    yaw: float
    height: float


def read(path: Path, *, origin_deg: tuple[float, float] | None, height_m: float) -> list[Footprint]:
    """The buildings in a file; raises ConfigError with the name of the file."""
    data = content(path, key="world.buildings_geojson")
    try:
        tree = json.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise ConfigError(f"world.buildings_geojson: {path} is no JSON: {error}") from error
    try:
        rings = [(_ring(points), _height(properties, height_m)) for points, properties in _polygons(tree)]
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        reason = str(error) if isinstance(error, ValueError) else repr(error)
        raise ConfigError(f"world.buildings_geojson: {path} is no GeoJSON of buildings: {reason}") from error
    if not rings:
        raise ConfigError(f"world.buildings_geojson: {path} holds no Polygon")
    if origin_deg is None:
        every = np.vstack([ring for ring, _ in rings])
        lon, lat = ((every.min(axis=0) + every.max(axis=0)) / 2).tolist()
    else:
        lat, lon = origin_deg
    origin = Geodetic(lat, lon, 0.0)
    return [_rectangle(_plane(ring, origin), height) for ring, height in rings]


def _polygons(tree: dict[str, Any]) -> Iterator[tuple[list[Any], dict[str, Any]]]:
    """The outer ring of every polygon, with the properties of its feature."""
    features = tree["features"] if tree["type"] == "FeatureCollection" else [tree]
    for feature in features:
        geometry = feature.get("geometry") if feature["type"] == "Feature" else feature
        properties = feature.get("properties") or {}
        if geometry and geometry["type"] == "Polygon":
            yield geometry["coordinates"][0], properties
        elif geometry and geometry["type"] == "MultiPolygon":
            for polygon in geometry["coordinates"]:
                yield polygon[0], properties


def _ring(points: list[Any]) -> Rows:
    """Longitude and latitude of the corners."""
    ring = np.array([[float(point[0]), float(point[1])] for point in points])
    if len(ring) < 4 or not (np.abs(ring) <= [180.0, 90.0]).all():
        raise ValueError(f"a ring must have four positions of longitude and latitude, not {points[:4]!r}")
    return ring


def _height(properties: dict[str, Any], default_m: float) -> float:
    for key, unit_m in (("height", 1.0), ("building:levels", LEVEL_M), ("levels", LEVEL_M)):
        if properties.get(key) is not None:
            height = float(str(properties[key]).removesuffix("m").strip()) * unit_m
            if not 0 < height <= _HIGHEST_M:
                raise ValueError(f"{key} = {properties[key]!r} must be within (0, {_HIGHEST_M:g}] m")
            return height
    return default_m


def _plane(ring: Rows, origin: Geodetic) -> Rows:
    return np.array([to_enu(Geodetic(lat, lon, 0.0), origin)[:2] for lon, lat in ring.tolist()])


def _rectangle(ring: Rows, height: float) -> Footprint:
    """The smallest rectangle around a ring; one of its sides lies along a side of the ring's hull (Freeman and Shapira,
    1975).
    """
    edges = np.diff(ring, axis=0)
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (math.pi / 2), 9))
    best: tuple[float, Footprint] | None = None
    for yaw in angles.tolist():
        cos, sin = math.cos(yaw), math.sin(yaw)
        turned = ring @ np.array([[cos, -sin], [sin, cos]])
        low, high = turned.min(axis=0), turned.max(axis=0)
        width, depth = np.maximum(high - low, _LEAST_SIDE_M).tolist()
        middle = (low + high) / 2
        east, north = (np.array([[cos, -sin], [sin, cos]]) @ middle).tolist()
        if best is None or width * depth < best[0] - 1e-9:
            best = width * depth, Footprint(east, north, width, depth, yaw, height)
    assert best is not None, "a ring has edges"
    return best[1]
