"""Draws maps, grids of heights and packet traces as people bring them, each with what it means.

The spellings are those of public documentation: Esri's and GDAL's ASCII grids (`dx`, comments, voids of SRTM and of
32-bit floats), OpenStreetMap's wiki for `height` and `building:levels` (units, feet and inches, several values, words),
RFC 7946 and 8142 and their exporters for GeoJSON, and spreadsheets of several countries for lines of numbers. What has
one meaning is drawn with it; what has none, or several, with None: it has to be refused in one sentence.
"""

import json
from collections.abc import Callable
from random import Random
from typing import NamedTuple

CELL_M = 10.0
AREA_M = 100.0
PARIS = (48.8566, 2.3522)
VOIDS = ("-9999", "-9999.0", "-32768", "-32767", "32767", "-3.4028234663852886e+38", "-3.402823e+38", "1e+30", "nan",
         "NaN", "-99999", "1.#QNAN", "-1.#IND", "-2147483648", "*", "NULL", "NoData")  # fmt: skip
Write = Callable[[str], bytes]


class Sample(NamedTuple):
    """A file, and what it means: a plain value that the reader gives; None if it must be refused."""

    data: bytes
    meaning: object | None


def written(random: Random, text: str) -> bytes:
    """Text as some program writes it."""
    text = text.replace("\n", random.choice(("\n", "\r\n")))
    return text.encode(random.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16")))


def grid(random: Random) -> Sample:
    """An ASCII grid of 12 x 12 cells over 120 m; its meaning is the height at the origin and 30 m to the north-east,
    above the lowest cell.
    """
    side, base = 12, random.choice((0.0, 34.5, -3.25, 812.75, 4807.5))
    slope_e, slope_n = (random.choice((0.0, 0.5, 2.25)) for _ in range(2))
    rows = [[base + slope_e * column + slope_n * (side - 1 - row) for column in range(side)] for row in range(side)]
    middle = (side - 1) / 2
    meaning: object | None = [slope_e * (middle + offset) + slope_n * (middle + offset) for offset in (0, 3)]
    cells = [[f"{height:.{random.choice((2, 3, 6))}f}" for height in row] for row in rows]
    header = [
        (random.choice(("ncols", "NCOLS")), str(side)), ("nrows", str(side)),
        ("xllcorner", random.choice(("448000", "448000.0", "0", "-60"))),
        ("yllcorner", random.choice(("5411000", "0.0"))),
    ]  # fmt: skip
    size = random.choice(("10", "10.0", "10.000000000000"))
    header += random.choice(([("cellsize", size)], [("dx", size), ("dy", size)], [("CELLSIZE", size)]))
    declared = random.choice((None, None, *VOIDS[:7]))
    if declared is not None:
        header.append((random.choice(("NODATA_value", "nodata_value", "NODATA_VALUE")), declared))
    fate = random.random()
    if fate < 0.25:
        cells[random.randrange(side)][random.randrange(side)] = declared or random.choice(VOIDS)
        meaning = None
    elif fate < 0.3:
        cells[random.randrange(side)].pop()
        meaning = None
    elif fate < 0.35:
        cells[random.randrange(side)][random.randrange(side)] = random.choice(("x", "1.2.3", "--5", "1'000", "10m"))
        meaning = None
    elif fate < 0.37:
        header.insert(random.randrange(len(header)), (random.choice(("cellsize", "dx")), "20"))
        meaning = None
    elif fate < 0.4:
        header = [line for line in header if line[0].lower() != random.choice(("ncols", "nrows"))]
        meaning = meaning if len(header) >= 5 + ("dx" in dict(header)) + (declared is not None) else None
    between = random.choice((" ", "  ", "\t", ";", "\u00a0", ", " if meaning is not None else " "))
    comma = between != ", " and random.random() < 0.25
    lines = [f"{key}{random.choice((' ', '     ', chr(9)))}{value}" for key, value in header]
    if random.random() < 0.3:
        lines.insert(random.randrange(len(lines)), random.choice(("# made by hand", "// metres above the sea", "")))
    if comma and all(len(cell) == 5 and cell[1] == "." and cell[0] > "0" for row in cells for cell in row):
        meaning = None  # "1,234" may be thousands
    text = "\n".join([*lines, *(between.join(row) for row in cells)]) + random.choice(("\n", "", "\n\n", "\n\x1a"))
    return Sample(written(random, text.replace(".", ",") if comma else text), meaning)


HEIGHTS: tuple[tuple[dict[str, object], float], ...] = (
    ({}, 19.0), ({"height": "12"}, 12.0), ({"height": 12.5}, 12.5), ({"height": "12.5 m"}, 12.5),
    ({"height": "12m"}, 12.0), ({"height": "40 ft"}, 12.192), ({"height": "40'"}, 12.192),
    ({"height": "6'6\""}, 1.9812), ({"height": "12,5"}, 12.5),
    ({"height": "yes"}, 19.0), ({"height": "yes", "building:levels": 2}, 6.0), ({"height": ""}, 19.0),
    ({"height": "0"}, 19.0), ({"height": "-4"}, 19.0), ({"height": "1e9"}, 19.0), ({"height": "12;15"}, 15.0),
    ({"height": "~ 20"}, 20.0), ({"height": "about 20 m"}, 20.0), ({"est_height": "7"}, 7.0), ({"height": None}, 19.0),
    ({"building:levels": "3"}, 9.0), ({"building:levels": "2;3"}, 9.0), ({"building:levels": "3-4"}, 12.0),
    ({"building:levels": "2.5"}, 7.5), ({"building:levels": "0", "roof:levels": "1"}, 19.0), ({"levels": 4}, 12.0),
    ({"building:levels": "ground floor"}, 19.0), ({"height": ["12"]}, 19.0), ({"height": {"value": 3}}, 19.0),
    ({"building:levels": "4F"}, 12.0), ({"building:levels": "3 storeys"}, 9.0), ({"height": "12."}, 12.0),
    ({"height": "12 mt"}, 12.0), ({"height": "9 m (est.)"}, 9.0), ({"height": "1,200"}, 19.0),
    ({"height": True}, 19.0), ({"height": "NaN"}, 19.0), ({"height": "12 стор."}, 19.0), ({"height": "١٢"}, 12.0),
    ({"HEIGHT": 12}, 12.0), ({"height": "40\u2019"}, 12.192), ({"height": "12m50"}, 19.0), ({"height": "12 cm"}, 19.0),
    ({"height": "6 ft 6 in"}, 1.9812), ({"building:levels": "G+3"}, 19.0), ({"building:levels": "3;roof"}, 9.0),
    ({"building:levels": "-1"}, 19.0), ({"building:levels": "1,2"}, 6.0), ({"building:levels": "2,5"}, 7.5),
    ({"building_levels": "5"}, 15.0), ({"num_floors": 4, "height": None}, 12.0), ({"building:levels": "1, 2, 3"}, 9.0),
    ({"height": "10,000"}, 19.0), ({"height": "nicht bekannt"}, 19.0),
)  # fmt: skip
"""Tags of a building, and its height; 19 m is the default."""


def _area(ring: object, **tags: str) -> object:
    return {"type": "Feature", "properties": tags, "geometry": {"type": "Polygon", "coordinates": ring}}


ODD: tuple[object, ...] = (
    None, {"type": "Feature", "properties": {}, "geometry": None}, {"type": "Feature"}, {},
    _area([[[2, 48], [2, 49], [3, 49]]], leisure="park"), _area([], building="yes"), _area([[[2, 48]]], building="yes"),
    _area([[["a", 48], [2, None]]], building="yes"), {"type": "Feature", "geometry": {"type": "LineString"}},
)  # fmt: skip
"""What is among the features of a file, and is no building."""


def town(random: Random) -> Sample:
    """GeoJSON of some buildings of 20 m about Paris; its meaning is the sorted heights of the boxes."""
    features: list[object] = []
    heights = []
    for number in range(random.randrange(1, 6)):
        tags, height = random.choice(HEIGHTS)
        lon, lat = PARIS[1] + random.uniform(-4e-4, 4e-4), PARIS[0] + random.uniform(-3e-4, 3e-4)
        ring = [[lon + x * 1e-4, lat + y * 1e-4] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
        if random.random() < 0.2:
            ring = [[*point, 35.0] for point in ring]
        if random.random() < 0.2:
            ring.pop()  # some do not close them
        if random.random() < 0.2:
            ring.reverse()
        geometry: dict[str, object] = {"type": "Polygon", "coordinates": [ring]}
        if random.random() < 0.2:
            geometry = {"type": "MultiPolygon", "coordinates": [[ring]]}
        if random.random() < 0.1:
            geometry = {
                "type": "GeometryCollection",
                "geometries": [geometry, {"type": "Point", "coordinates": [0, 0]}],
            }
        properties: dict[str, object] = {"building": "yes", "@id": f"way/{number}", **tags}
        if random.random() < 0.2:
            properties = {"type": "way", "tags": random.choice((properties, json.dumps(properties)))}
        features.append({"type": "Feature", "id": number, "properties": properties, "geometry": geometry})
        heights.append(height)
    for odd in ODD:
        if random.random() < 0.15:
            features.insert(random.randrange(len(features) + 1), odd)
    meaning: object | None = sorted(heights)
    tree: object = {"type": "FeatureCollection", "name": "übung", "features": features}
    fate = random.random()
    if fate < 0.05:
        tree, meaning = {"elements": [], "version": 0.6}, None
    elif fate < 0.1:
        tree, meaning = {"type": "FeatureCollection", "features": []}, None
    text = json.dumps(tree, ensure_ascii=random.random() < 0.5, indent=random.choice((None, 1)))
    if 0.1 < fate < 0.2:
        text = "\n".join(random.choice(("", "\x1e")) + json.dumps(feature) for feature in features if feature)
    elif 0.2 < fate < 0.25:
        text, meaning = text[: len(text) // 2], None
    return Sample(written(random, text), meaning)


def trace(random: Random) -> Sample:
    """Lines of packets; its meaning is the packets."""
    packets = [(round(random.uniform(0, 60), 3), random.randrange(64, 2268)) for _ in range(random.randrange(1, 9))]
    between, comma = random.choice(
        ((",", False), (", ", False), (";", False), (";", True), ("\t", False), ("\t", True))
    )
    lines = []
    for seconds, size in packets:
        number = random.choice((f"{seconds:.3f}", f"{seconds:.6f}", f"{seconds:.9E}", f"+{seconds:.3f}"))
        cells = [number.replace(".", ",") if comma else number, random.choice((str(size), f" {size} "))]
        if random.random() < 0.1:
            cells = [f'"{cell.strip()}"' for cell in cells]
        lines.append(between.join(cells))
    meaning: object | None = [list(packet) for packet in packets]
    if random.random() < 0.2:
        lines[random.randrange(len(lines))] += random.choice(("x", f"{between}7", f"{between}x"))
        meaning = None
    elif random.random() < 0.1:
        lines[0] = between.join(("l.5", "100"))
        meaning = None
    if between == "," and random.random() < 0.1 and meaning is not None:
        lines = [f'"{seconds:.4f}","{size}"'.replace(".", ",") for seconds, size in packets]
    headings = [(("seconds", "bytes"), True), (("t [s]", "size"), True), (("Zeit", "Größe"), True)]
    headings += [(("t_ms", "bytes"), False), (("bytes", "seconds"), False), (("s", "kB"), False)]
    if random.random() < 0.5:
        heading, is_right = headings[random.choice((0, 0, 1, 1, 2, 2, 3, 4, 5))]
        lines.insert(0, between.join(heading))
        meaning = meaning if is_right else None
    if random.random() < 0.1:
        lines.insert(random.randrange(len(lines) + 1), f"{random.choice(('#N/A', '#VALUE!', '#DIV/0!'))}{between}100")
        meaning = None
    if random.random() < 0.3:
        remark = random.choice(("", "# pause", "   ", "# a pause; long", "  # of a\tpause"))
        lines.insert(random.randrange(len(lines) + 1), remark)
    if random.random() < 0.1:
        lines.insert(0, f"sep={between.strip(' ')}")
    return Sample(written(random, "\n".join(lines) + random.choice(("\n", ""))), meaning)
