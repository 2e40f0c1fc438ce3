"""Reads heights of the ground from a file: an ASCII grid (`.asc`), a tile of SRTM (`.hgt`), or a GeoTIFF (`.tif`).

A file in longitude and latitude, or with a reference system, is laid where it belongs about `world.origin_deg`, and
its lowest point within the area is at height 0. Of an ASCII grid in metres the middle is put at the origin and the
lowest point of the file at height 0. Cells without a height (voids) within the area are refused.
"""

import math
import re
import struct
import zlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.geodesy import Geodetic, to_geodetic
from fanet_mw.scenario import ascii_grid
from fanet_mw.scenario.named_files import content
from fanet_mw.scenario.outlines import half_turn
from fanet_mw.units import Enu
from sim.world.arrays import Flags, Rows, Values

_MOST_CELLS: Final = 64_000_000
_ROUNDED: Final = 1e-9
"""The share of a length that may be lost by rounding."""
_LOWEST_M: Final = -500.0
_HIGHEST_M: Final = 9000.0
"""Land lies between the shore of the Dead Sea, -430 m, and Mount Everest, 8849 m."""
_ODD_M: Final = 50.0
_ODD_SHARE: Final = 0.1
"""The lowest cells are told if they are this much lower than all others, and no greater share of the area."""
_THOUSANDS_M: Final = re.compile(r"[1-9],\d{3}")
"""A height with a comma that may be one of thousands; no land is higher."""
_MOST_PRJ_BYTES: Final = 1 << 16
_PRJ_UNIT: Final = re.compile(
    r"""(?:^|[\[,])\s*UNITS?(?:\["([^"]*)",\s*([\d.]+)|\s+(\w+))""", re.IGNORECASE | re.MULTILINE
)
"""A unit in the text of a reference system, and in that of ArcInfo; the last one is that of lengths."""
_TIFF: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TILE: Final = re.compile(r"([NS])(\d\d)([EW])(\d\d\d)", re.IGNORECASE)


class Heightmap(NamedTuple):
    """Heights of a file, the southernmost row first, and where its cells lie in the world."""

    metres: Rows
    """NaN where there is none."""
    middle: tuple[float, float]
    """Column and row at the origin."""
    per_m: Rows
    """Columns and rows for each metre to the east and to the north [2, 2]."""
    middle_deg: tuple[float, float] | None = None
    """Latitude and longitude of the file's middle, if the file says where on earth it lies."""
    name_of: Callable[[int, int], str] = lambda row, column: f"row {row + 1} from the south, column {column + 1}"
    """How a cell is called in the file, by its row and column."""
    odd_low: str = ""
    """What is odd about the lowest cells of the area, if they may be voids."""

    @property
    def cell_m(self) -> float:
        return 1 / float(np.linalg.norm(self.per_m, axis=1).max())

    def cell(self, east: Values, north: Values) -> tuple[Values, Values]:
        """Column and row of places."""
        (a, b), (c, d) = self.per_m.tolist()
        return self.middle[0] + a * east + b * north, self.middle[1] + c * east + d * north

    def places(self) -> tuple[Values, Values]:
        """East and north of all cells."""
        rows, columns = self.metres.shape
        (a, b), (c, d) = np.linalg.inv(self.per_m).tolist()
        x, y = np.meshgrid(np.arange(columns) - self.middle[0], np.arange(rows) - self.middle[1])
        return a * x + b * y, c * x + d * y

    def sample(self, east: Values, north: Values) -> Values:
        """Heights at places by bilinear interpolation; outside of the grid those of its edge."""
        rows, columns = self.metres.shape
        x, y = self.cell(east, north)
        x, y = np.clip(x, 0, columns - 1 - 1e-9), np.clip(y, 0, rows - 1 - 1e-9)
        i, j = y.astype(np.int64), x.astype(np.int64)
        v, u = y - i, x - j
        corners = ((0, 0, (1 - u) * (1 - v)), (0, 1, u * (1 - v)), (1, 0, (1 - u) * v), (1, 1, u * v))
        found = np.zeros_like(x)
        for up, right, weight in corners:  # a void of no weight counts for nothing
            found += np.where(weight > 1e-6, weight * self.metres[i + up, j + right], 0.0)
        return found


@lru_cache(maxsize=4)
def read(path: Path, *, origin_deg: tuple[float, float], area_m: float, digest: str = "") -> Heightmap:
    """Heights of the area, and of a cell beyond it where the file has one; raises ConfigError with the file's name."""
    data = content(path, key="world.heightmap", digest=digest)
    try:
        found = _read(path, data, _lattice(origin_deg, area_m))
    except ConfigError:
        raise
    except (ValueError, KeyError, IndexError, struct.error, zlib.error) as error:
        raise ConfigError(
            f"world.heightmap: {path} is neither an ASCII grid, an SRTM tile (.hgt) nor a GeoTIFF: {error}"
        ) from error
    if min(found.metres.shape) < 2:
        raise ConfigError(f"world.heightmap: {path} must hold at least 2 x 2 heights")
    _require_area(found, path, origin_deg, area_m)
    return _without_voids(found, path, area_m)


class _Place(NamedTuple):
    """A place in the world, and on earth."""

    at: Enu
    on_earth: Geodetic


def _lattice(origin_deg: tuple[float, float], area_m: float) -> list[_Place]:
    """Nine places over the area, by which a file in degrees is laid under it."""
    origin, sides = Geodetic(*origin_deg, 0.0), (-area_m / 2, 0.0, area_m / 2)
    every = [Enu(east, north, 0.0) for north in sides for east in sides]
    return [_Place(at, to_geodetic(at, origin)) for at in every]


def _read(path: Path, data: bytes, lattice: list[_Place]) -> Heightmap:
    if path.suffix.lower() == ".hgt":
        return _tile(path.name, data, lattice)
    if data.startswith(_TIFF):
        from sim.world.environment import geotiff  # it needs an extra of the package

        metres, cells, middle_deg = geotiff.read(
            path, data, [place.on_earth for place in lattice], most_cells=_MOST_CELLS
        )
        return _laid(metres, cells, lattice, middle_deg)
    grid = ascii_grid.parse(data)
    if not grid.in_degrees:
        _require_metres(path)
    return _ascii(grid, lattice)


def _require_metres(path: Path) -> None:
    """Raises ValueError if the .prj that Esri's tools write beside an ASCII grid says that its lengths are others."""
    beside = path.with_suffix(".prj")
    if not beside.exists():
        return
    text = read_regular(beside, most_bytes=_MOST_PRJ_BYTES).decode(errors="replace")
    units = _PRJ_UNIT.findall(text)
    if not units or (units[-1][0] and math.isclose(float(units[-1][1]), 1.0)) or units[-1][2].upper() == "METERS":
        return
    name = units[-1][0] or units[-1][2]
    raise ValueError(
        f"{beside.name} says that its lengths are in {name}; convert it: gdalwarp -t_srs EPSG:... -tr 30 30"
    )


def _ascii(grid: ascii_grid.AsciiGrid, lattice: list[_Place]) -> Heightmap:
    rows, columns = grid.rows, grid.columns
    metres = _numbers(grid)[::-1]
    if grid.void is not None:  # the header may write it with more digits than the cells do
        metres[np.isclose(metres, grid.void, rtol=1e-6, atol=0.0)] = np.nan
    one_row_a_line = len(grid.lines) == rows

    def name_of(row: int, column: int) -> str:
        place = rows - 1 - row
        return f"{f'line {grid.first_line + place}' if one_row_a_line else f'row {place + 1}'}, column {column + 1}"

    if grid.place_deg is None:
        return _centered(metres, grid.cell)._replace(name_of=name_of)
    width, height = grid.cell
    lat, lon = grid.place_deg
    cells = [
        (half_turn(place.lon_deg - lon) / width + (columns - 1) / 2, (place.lat_deg - lat) / height + (rows - 1) / 2)
        for _, place in lattice
    ]
    return _laid(metres, cells, lattice, grid.place_deg)._replace(name_of=name_of)


def _tile(name: str, data: bytes, lattice: list[_Place]) -> Heightmap:
    """A tile of SRTM: 16-bit heights over one degree, whose corner in the south west is in the file's name."""
    corner = _TILE.match(name)
    if corner is None:
        raise ValueError("the name of a .hgt file says where it lies: N48E002.hgt")
    south = int(corner[2]) * (1 if corner[1] in "Nn" else -1)
    west = int(corner[4]) * (1 if corner[3] in "Ee" else -1)
    side = math.isqrt(len(data) // 2)
    if side < 2 or 2 * side * side != len(data):
        raise ValueError(f"{len(data)} bytes are no square of 16-bit heights: is it cut short?")
    metres = np.frombuffer(data, ">i2").reshape(side, side)[::-1].astype(np.float64)
    cells = [
        (half_turn(place.lon_deg - west) * (side - 1), (place.lat_deg - south) * (side - 1)) for _, place in lattice
    ]
    return _laid(metres, cells, lattice, (south + 0.5, west + 0.5))


def _centered(metres: Rows, cell_m: tuple[float, float]) -> Heightmap:
    rows, columns = metres.shape
    return Heightmap(metres, ((columns - 1) / 2, (rows - 1) / 2), np.diag([1 / cell_m[0], 1 / cell_m[1]]))


def _laid(
    metres: Rows, cells: list[tuple[float, float]], lattice: list[_Place], middle_deg: tuple[float, float]
) -> Heightmap:
    """Heights under the area by column and row of the lattice; cells as parallelograms are right to 5 m over 10 km."""
    known = np.array([[1.0, place.at.east, place.at.north] for place in lattice])
    fit, *_ = np.linalg.lstsq(known, np.array(cells), rcond=None)
    return Heightmap(metres, (float(fit[0, 0]), float(fit[0, 1])), fit[1:].T, middle_deg)


def _require_area(found: Heightmap, path: Path, origin_deg: tuple[float, float], area_m: float) -> None:
    """Raises ConfigError unless there is a cell under each corner of the area."""
    rows, columns = found.metres.shape
    if found.middle_deg is None:
        for axis, side, count in ((0, "east", columns), (1, "north", rows)):
            cell_m = 1 / float(found.per_m[axis, axis])
            if count * cell_m < area_m * (1 - _ROUNDED):
                degrees = "; if its cells are degrees: gdalwarp -t_srs EPSG:... -tr 30 30" if cell_m < 1 else ""
                raise ConfigError(
                    f"world.heightmap: {path} covers {count * cell_m:g} m to the {side}, "
                    f"which must be >= world.area_m = {area_m:g}{degrees}"
                )
        return
    corners = np.array([-area_m / 2, area_m / 2])
    x, y = found.cell(*np.meshgrid(corners, corners))
    if x.min() < -0.5 or y.min() < -0.5 or x.max() > columns - 0.5 or y.max() > rows - 0.5:
        lat, lon = found.middle_deg
        raise ConfigError(
            f"world.heightmap: {path} does not cover world.area_m = {area_m:g} about world.origin_deg = "
            f"[{origin_deg[0]:g}, {origin_deg[1]:g}]; the middle of the file is [{lat:.5f}, {lon:.5f}]"
        )


def _without_voids(found: Heightmap, path: Path, area_m: float) -> Heightmap:
    """The part of the heights that lies under the area, from its lowest point on, or that of the file."""
    with np.errstate(invalid="ignore"):
        void = ~((found.metres >= _LOWEST_M) & (found.metres <= _HIGHEST_M))
    if void.all():
        raise ConfigError(f"world.heightmap: {path} holds no height within [{_LOWEST_M:g}, {_HIGHEST_M:g}] m")
    part, (first_row, first_column) = _under(found, area_m)
    rows, columns = part.metres.shape
    used, void_here = _used(part, area_m), void[first_row : first_row + rows, first_column : first_column + columns]
    missing = void_here & used
    if missing.any():
        row = int(np.nonzero(missing.any(axis=1))[0][-1])
        column = int(missing[row].argmax())
        cell, value = found.name_of(first_row + row, first_column + column), part.metres[row, column]
        said = f"{value:g}" if np.isfinite(value) else "the value of a void"
        count = int(missing.sum())
        raise ConfigError(
            f"world.heightmap: {path}: {count} cell{'s' * (count > 1)} within world.area_m = {area_m:g} "
            f"{'have' if count > 1 else 'has'} no data, or no height on earth, [{_LOWEST_M:g}, {_HIGHEST_M:g}] m: "
            f"the first has {said} ({cell}); "
            "fill them, for example by gdal_fillnodata.py, or put the area where there are none"
        )
    lowest = part.metres[used] if found.middle_deg else found.metres[~void]
    return part._replace(
        metres=np.where(void_here, np.nan, part.metres - lowest.min()), odd_low=_odd_low(part.metres[used])
    )


def _odd_low(heights: Values) -> str:
    """A few cells of one height, far below all others: a void, perhaps, that nobody has declared."""
    low = heights.min()
    others = heights[heights > low]
    count = heights.size - others.size
    if not others.size or others.min() - low < _ODD_M or count > _ODD_SHARE * heights.size:
        return ""
    return (
        f"{low:g} m at {count} of {heights.size} cells of the area, and at least {others.min():g} m at all others: "
        "a void that the file does not declare?"
    )


def _under(found: Heightmap, area_m: float) -> tuple[Heightmap, tuple[int, int]]:
    """The rectangle of cells that holds the area, and its first row and column."""
    corners = np.array([-area_m / 2, area_m / 2])
    x, y = found.cell(*np.meshgrid(corners, corners))
    rows, columns = found.metres.shape
    low = [max(0, min(size - 2, math.floor(part.min()) - 1)) for part, size in ((y, rows), (x, columns))]
    high = [min(size, max(2, math.ceil(part.max()) + 2)) for part, size in ((y, rows), (x, columns))]
    part = found.metres[low[0] : high[0], low[1] : high[1]]
    return found._replace(metres=part, middle=(found.middle[0] - low[1], found.middle[1] - low[0])), (low[0], low[1])


def _used(part: Heightmap, area_m: float) -> Flags:
    """True for the cells on which some height within the area depends."""
    (a, b), (c, d) = np.abs(np.linalg.inv(part.per_m)).tolist()
    east, north = part.places()
    half = area_m / 2 - 1e-6
    return np.asarray((np.abs(east) < half + a + b) & (np.abs(north) < half + c + d))


def _floats(words: list[str]) -> Values:
    try:
        return np.array(words, dtype=np.float64)
    except ValueError:  # some of them are words, perhaps
        return np.array(["nan" if word.lower() in ascii_grid.VOIDS else word for word in words], dtype=np.float64)


def _numbers(grid: ascii_grid.AsciiGrid) -> Rows:
    """The heights of an ASCII grid, the northernmost row first; raises ValueError with the line that is wrong."""
    count = grid.columns * grid.rows
    if count > _MOST_CELLS:
        raise ValueError(f"{grid.columns} x {grid.rows} cells must be at most {_MOST_CELLS}")
    lines = ["" if line.lstrip().startswith(ascii_grid.COMMENTS) else line for line in grid.lines]
    text = "\n".join(lines).replace(";", " ").replace("\t", " ")
    if "," in text:  # between two heights, unless each of them may have one as its decimal comma
        words = text.split()
        is_decimal = len(words) == count and not re.search(r",\s|\.", text)
        if is_decimal and all("," not in word or _THOUSANDS_M.fullmatch(word) for word in words):
            height = next(word for word in words if "," in word)
            raise ValueError(
                f"the comma in {height}, and in all other heights, may be one of thousands or a decimal one"
            )
        text = text.replace(",", "." if is_decimal else " ")
    words = re.sub(r"-?1\.#\w+", "nan", text).split() if "#" in text else text.split()
    try:
        if "_" in text:  # which numpy would pass over, as Python does
            raise ValueError("a height with an underscore is no number")
        heights = _floats(words)
    except ValueError:
        for at, line in enumerate(grid.lines):
            for word in line.replace(";", " ").split():
                if word.lower() not in ascii_grid.VOIDS:
                    ascii_grid.number(word, line=grid.first_line + at)
        raise
    _require_lines(grid, text, count=len(heights))
    return heights.reshape(grid.rows, grid.columns)


def _require_lines(grid: ascii_grid.AsciiGrid, text: str, *, count: int) -> None:
    """Raises ValueError unless there are as many heights as the header says, in lines that do not contradict it."""
    widths = {at: len(line.split()) for at, line in enumerate(text.split("\n"), start=grid.first_line) if line.strip()}
    columns, rows = grid.columns, grid.rows
    odd = next((at for at, width in widths.items() if width != columns), None) if len(widths) == rows else None
    if count != columns * rows:
        raise ValueError(
            f"{count} heights, not {columns} x {rows}" + ("" if odd is None else f"; line {odd} has {widths[odd]}")
        )
    if odd is not None:  # one too many here and one too few there would move all between them
        raise ValueError(f"line {odd} has {widths[odd]} heights, not ncols = {columns}")
    if len(widths) == columns != rows and set(widths.values()) == {rows}:
        raise ValueError(f"{columns} lines of {rows} heights each, but ncols = {columns} and nrows = {rows}: swapped?")
