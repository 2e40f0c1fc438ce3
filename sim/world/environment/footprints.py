"""Buildings from a GeoJSON file (`fanet_mw/scenario/outlines.py`), as OpenStreetMap tools export them.

Each outline becomes upright boxes: the smallest rectangle around it or, if it is concave and fills less than
`_LEAST_FILLED` of that, those of its parts. Where its height comes from: docs/how-to/real-place.md; of several values
the greatest counts. Not modeled: courtyards, and roofs that are not flat.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.geodesy import Geodetic, to_enu
from fanet_mw.scenario import outlines
from fanet_mw.scenario.named_files import content
from sim.world.arrays import Rows

LEVEL_M: Final = 3.0
"""The height of one level of a building."""
_FOOT_M: Final = 0.3048
_INCH_M: Final = 0.0254
_INCHES_A_FOOT: Final = 12
_LONGEST_TAG: Final = 60
"""A note quotes at most so many characters of a tag."""
_LEAST_SIDE_M: Final = 0.1
"""An outline whose rectangle has a shorter side encloses nothing; no box has one."""
_HIGHEST_M: Final = 2000.0
"""A greater height in a tag is passed over."""
_LEAST_FILLED: Final = 0.85
"""An outline that fills so much of its rectangle is not cut."""
_LEAST_CONVEX: Final = 0.95
"""An outline that fills so much of its convex hull is not cut, because no cut makes its boxes smaller."""
_LEAST_PART_M2: Final = 0.01
"""What a cut leaves that is smaller is passed over."""
_MOST_PARTS: Final = 16
"""The greatest number of boxes of one building."""
_MOST_CUTS: Final = 24
"""The number of cuts that are tried on a part, along each axis."""
_MOST_ANGLES: Final = 400
"""The number of sides along which a rectangle around an outline is tried."""
_KEYS: Final = (
    ("height", 1.0), ("building:height", 1.0), ("est_height", 1.0), ("building:levels", LEVEL_M),
    ("building_levels", LEVEL_M), ("levels", LEVEL_M), ("num_floors", LEVEL_M),
)  # fmt: skip
_NUMBER: Final = r"\+?(?:\d+(?:\.\d*|,(?!\d{3}(?!\d))\d*)?|[.,]\d+)"
"""A comma before three digits may be one of thousands, so that number is not read."""
_FEET: Final = re.compile(
    rf"({_NUMBER})\s*(?:['\u2019\u00b4\u2032]|ft\.?|feet|foot)\s*(?:({_NUMBER})\s*(?:[\"\u201d\u2033]|in\.?|inch(?:es)?|''|\u2019\u2019)?)?"
)
_METRES: Final = re.compile(
    rf"({_NUMBER})\s*(?:m\.?|mt|mts|mtrs?|metres?|meters?|mètres?|\u043c\.?|\u043c\u0435\u0442\u0440\w*)?"
)
_LEVELS: Final = re.compile(rf"({_NUMBER})\s*(?:levels?|lvls?|floors?|fl|f|stor(?:e?ys?|ies))?")
_ABOUT: Final = re.compile(r"^(?:~|≈|<|>|<=|>=|ca\.?|c\.|approx\.?|approximately|about|around|est\.?)\s*")
_SUPPOSED: Final = re.compile(r"\s*(?:\(.*\)|\?|approx\.?|approximately|ca\.?|est\.?|estimated)$")
_LEVELS_LISTED: Final = re.compile(r",(?!5$)")
"""A comma between levels, of which only half ones are written with a decimal comma."""
_SEVERAL: Final = re.compile(r"\s*(?:;|\||/|\u2013|\u2014|-|\bto\b|\bor\b)\s*")


class Footprint(NamedTuple):
    """One box: the middle of its rectangle, its sides, its rotation, and its height above ground."""

    east: float
    north: float
    width: float
    depth: float
    yaw: float
    height: float


class Town(NamedTuple):
    """The buildings within the area, and what was guessed or passed over."""

    boxes: tuple[Footprint, ...]
    buildings: int
    """The number of buildings in the file."""
    guessed: tuple[str, ...]
    """The buildings within the area of which a tag could not be read as it is written."""
    untold: int
    """The number of buildings within the area of which no tag states a height."""
    broken: tuple[str, ...]
    """The outlines that are no building: those of the file that cannot be one, and those within the area whose corners
    lie on a line.
    """
    middle_deg: tuple[float, float]
    """Latitude and longitude of the middle of the file."""


@lru_cache(maxsize=8)
def read(path: Path, *, origin_deg: tuple[float, float], height_m: float, area_m: float, digest: str = "") -> Town:
    """The buildings of a file whose middle lies in the area; raises ConfigError. `digest`: of the file, so that it is
    read again once it has changed.
    """
    data = content(path, key="world.buildings_geojson", digest=digest)
    try:
        found = outlines.parse(data)
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        what = (
            "JSON"
            if isinstance(error, json.JSONDecodeError | UnicodeDecodeError | RecursionError)
            else "GeoJSON of buildings"
        )
        raise ConfigError(f"world.buildings_geojson: {path} is no {what}: {error}") from error
    origin = Geodetic(*origin_deg, 0.0)
    boxes: list[Footprint] = []
    guessed: list[str] = []
    broken = [*found.broken]
    untold = 0
    for outline in found.buildings:
        ring = _plane(outline.ring, origin)
        whole = _rectangle(ring, 0.0)
        if max(abs(whole.east), abs(whole.north)) > area_m / 2:
            continue
        if min(whole.width, whole.depth) <= _LEAST_SIDE_M:
            broken.append(f"{outline.name}: its corners lie on a line")
            continue
        height, why = height_of(outline.tags, height_m)
        boxes += _parts(ring, whole, height)
        if why:
            guessed.append(f"{outline.name}: {why}")
        untold += not any(_said(outline.tags, key) for key, _ in _KEYS)
    return Town(tuple(boxes), len(found.buildings), tuple(guessed), untold, tuple(broken), found.middle_deg)


def height_of(tags: Mapping[str, Any], default_m: float) -> tuple[float, str]:
    """The height that the tags of a building state, and what had to be guessed, if anything."""
    passed: list[str] = []
    for key, unit_m in _KEYS:
        said = _said(tags, key)
        if not said:
            continue
        values = _values(said, in_levels=unit_m != 1.0)
        height = max((value for value in values if value is not None), default=0.0) * unit_m
        if 0 < height <= _HIGHEST_M:
            passed += [f"{key} = {said[:_LONGEST_TAG]}"] if len(values) > 1 else []
            return height, f"{', '.join(passed)}: taken as {height:g} m" if passed else ""
        passed.append(f"{key} = {said[:_LONGEST_TAG]}")
    return default_m, f"{', '.join(passed)}: taken as {default_m:g} m" if passed else ""


def _said(tags: Mapping[str, Any], key: str) -> str:
    return "" if tags.get(key) is None else str(tags[key]).strip()


def _values(text: str, *, in_levels: bool) -> list[float | None]:
    """The numbers that a tag states, in metres or levels; None for a part of it that states anything else."""
    found: list[float | None] = []
    said = _ABOUT.sub("", text.strip().lower())
    parts = _SEVERAL.split(_LEVELS_LISTED.sub(";", said) if in_levels else said)
    if not parts[0]:  # a minus, and no range
        return [None]
    for part in parts:
        word = _SUPPOSED.sub("", part.strip())
        if match := (_LEVELS if in_levels else _METRES).fullmatch(word):
            found.append(_float(match[1]))
        elif not in_levels and (match := _FEET.fullmatch(word)) and _float(match[2] or "0") < _INCHES_A_FOOT:
            found.append(_float(match[1]) * _FOOT_M + _float(match[2] or "0") * _INCH_M)
        else:
            found.append(None)
    return found


def _float(text: str) -> float:
    return float(text.replace(",", "."))


def _plane(ring: list[tuple[float, float]], origin: Geodetic) -> Rows:
    return np.array([to_enu(Geodetic(lat, lon, 0.0), origin)[:2] for lon, lat in ring])


def _turn(yaw: float) -> Rows:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin], [sin, cos]])


def _rectangle(ring: Rows, height: float) -> Footprint:
    """The smallest rectangle around a ring, which has a side along one of its hull (Freeman and Shapira, 1975)."""
    hull = _hull(ring)
    edges = np.diff(hull, axis=0)
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (math.pi / 2), 9))
    best: tuple[float, Footprint] | None = None
    for yaw in angles[:: -(-len(angles) // _MOST_ANGLES)].tolist():
        box = _around(hull, yaw, height)
        if best is None or box.width * box.depth < best[0] - 1e-9:
            best = box.width * box.depth, box
    assert best is not None, "a ring has edges"
    return best[1]


def _around(ring: Rows, yaw: float, height: float) -> Footprint:
    turned = ring @ _turn(yaw)
    low, high = turned.min(axis=0), turned.max(axis=0)
    width, depth = np.maximum(high - low, _LEAST_SIDE_M).tolist()
    east, north = (_turn(yaw) @ ((low + high) / 2)).tolist()
    return Footprint(east, north, width, depth, yaw, height)


def _hull(ring: Rows) -> Rows:
    """The convex hull of a ring, closed (Andrew, 1979)."""
    corners = sorted(set(map(tuple, ring.tolist())))
    sides = []
    for order in (corners, corners[::-1]):
        side: list[tuple[float, float]] = []
        for x, y in order:
            while len(side) > 1 and _left(side[-2], side[-1], (x, y)) <= 0:
                side.pop()
            side.append((x, y))
        sides += side[:-1]
    return np.array([*sides, sides[0]])


def _left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _parts(ring: Rows, whole: Footprint, height: float) -> Iterator[Footprint]:
    """Rectangles that cover the inside of a ring together: a concave part is cut in two, where that saves most."""
    waiting, count = [ring @ _turn(whole.yaw)], 1
    while waiting:
        part = waiting.pop(0)
        halves = [] if count >= _MOST_PARTS or _is_simple(part) else _halves(part)
        if halves:
            waiting += halves
            count += len(halves) - 1
        else:
            yield _around(part @ _turn(whole.yaw).T, whole.yaw, height)


def _is_simple(ring: Rows) -> bool:
    """True if a ring fills its rectangle, or is convex."""
    area = _enclosed(ring)
    return area >= _LEAST_FILLED * _covered(ring) or area >= _LEAST_CONVEX * _enclosed(_hull(ring))


def _enclosed(ring: Rows) -> float:
    x, y = (ring - ring[0]).T
    return abs(float(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1]))) / 2


def _covered(ring: Rows) -> float:
    width, depth = (ring.max(axis=0) - ring.min(axis=0)).tolist()
    return float(width * depth)


def _halves(ring: Rows) -> list[Rows]:
    """Both sides of the best cut: that which leaves the smallest rectangles, and of equal ones the largest part that
    needs no further cut.
    """
    best: tuple[float, float] | None = None
    halves: list[Rows] = []
    for axis in (0, 1):
        places = np.unique(np.round(ring[:, axis], 2))[1:-1]
        for place in places[:: max(1, -(-len(places) // _MOST_CUTS))].tolist():
            parts = [half for side in (1, -1) if _enclosed(half := _clipped(ring, axis, place, side)) > _LEAST_PART_M2]
            done = max((_enclosed(part) for part in parts if _is_simple(part)), default=0.0)
            score = round(sum(map(_covered, parts)), 1), -done
            if parts and (best is None or score < best):
                best, halves = score, parts
    return halves


def _clipped(ring: Rows, axis: int, place: float, side: int) -> Rows:
    """The part of a ring on one side of a line (Sutherland and Hodgman, 1974)."""
    beyond = (ring[:, axis] - place) * side
    found: list[Rows] = []
    for i in range(len(ring) - 1):
        first, second = beyond[i], beyond[i + 1]
        if first <= 0:
            found.append(ring[i])
        if (first < 0 < second) or (second < 0 < first):
            found.append(ring[i] + (ring[i + 1] - ring[i]) * (first / (first - second)))
    return np.array([*found, found[0]]) if found else ring[:1]
