"""The header of an ASCII grid of heights (Esri; GDAL's AAIGrid): how many cells, how large, and where on earth.

Read are also files with `dx` and `dy` in place of `cellsize`, comments, decimal commas, byte-order marks, and cells in
degrees, as OpenTopography delivers them. The heights themselves are read where they are needed, with numpy.
"""

import math
import re
from collections.abc import Sequence
from typing import Final, NamedTuple

from fanet_mw.scenario.text_files import decoded

_KEYS: Final = {
    "ncols": "ncols", "nrows": "nrows", "cellsize": "cellsize", "dx": "dx", "dy": "dy", "xdim": "dx", "ydim": "dy",
    "xllcorner": "xllcorner", "yllcorner": "yllcorner", "xllcenter": "xllcenter", "yllcenter": "yllcenter",
    "xllcentre": "xllcenter", "yllcentre": "yllcenter",
    "nodata_value": "nodata", "nodata": "nodata",
}  # fmt: skip
_SIDES: Final = ("cellsize", "dx", "dy")
THOUSANDS: Final = re.compile(r"[1-9]\d{0,2},\d{3}")
"""A comma that may be one of thousands."""
COMMENTS: Final = ("#", "//", "!")
VOIDS: Final = frozenset({"*", "-", "null", "nodata", "n/a", "na", "none", "void"})
"""Words for a cell without a height; GRASS writes `*`, and databases `null`."""
_CONVERT: Final = "other formats are converted by gdal_translate -of AAIGrid"
_LARGEST: Final = 1e7
"""A cell of so many metres is a quarter of the earth."""
_COARSEST_DEG: Final = 0.02
"""A grid with places in degrees has cells of at most this; cells of less than 2 cm there are none."""


class AsciiGrid(NamedTuple):
    """An ASCII grid, whose heights are still text."""

    columns: int
    rows: int
    cell: tuple[float, float]
    """The extent of a cell along x and along y: metres, or degrees if `in_degrees`."""
    middle: tuple[float, float]
    """x and y of the middle of the grid."""
    void: float | None
    """The value of cells without a height, if the header declares one."""
    lines: Sequence[str]
    first_line: int
    """The number of the first of them in the file."""

    @property
    def in_degrees(self) -> bool:
        """True if x and y are longitude and latitude; metres are never so small and so near to 0."""
        (x, y), (width, height) = self.middle, self.cell
        fits = abs(x) <= 360 and abs(y) + height * self.rows / 2 <= 90 + height
        return fits and max(width, height) < _COARSEST_DEG and width * self.columns <= 360

    @property
    def place_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude of the middle; None for a grid in metres, of which they are unknown."""
        return (self.middle[1], (self.middle[0] + 180) % 360 - 180) if self.in_degrees else None


def parse(data: bytes) -> AsciiGrid:
    """Read the header; raises ValueError with the line that is wrong."""
    lines = _text(data).rstrip("\x1a").splitlines()  # the last character of files of DOS
    found: dict[str, float] = {}
    body = len(lines)
    for at, line in enumerate(lines):
        words = line.replace("=", " ").replace(":", " ").split()
        if not words or words[0].startswith(COMMENTS):
            continue
        key = _KEYS.get(words[0].lower())
        if key is None:
            if words[0][0].isalpha() and words[0].lower() not in {"nan", "inf", "infinity", *VOIDS}:
                raise ValueError(
                    f"line {at + 1}: {line.strip()[:60]!r} is no line of the header of an ASCII grid; {_CONVERT}"
                )
            body = at
            break
        if len(words) != 2:
            raise ValueError(f"line {at + 1}: {line.strip()[:60]!r} must be a key and one number")
        is_void = key == "nodata" and words[1].lower() in VOIDS
        value = math.nan if is_void else number(words[1], line=at + 1)
        if key != "nodata" and not math.isfinite(value):
            raise ValueError(f"line {at + 1}: {words[0]} = {words[1]} must be a finite number")
        if key in _SIDES and THOUSANDS.fullmatch(words[1]):
            raise ValueError(f"line {at + 1}: {words[1]} may be thousands or a decimal comma; write {words[0]} without")
        if found.setdefault(key, value) != value and not math.isnan(value):
            raise ValueError(f"line {at + 1}: {words[0]} = {words[1]}, and {found[key]:g} in a line above")
    for key in ("dx", "dy"):
        if key in found and found.get("cellsize", found[key]) != found[key]:
            raise ValueError(f"{key} = {found[key]:g} contradicts cellsize = {found['cellsize']:g}")
    columns, rows = _count(found, "ncols"), _count(found, "nrows")
    cell = _side(found, "dx"), _side(found, "dy")
    middle = (_middle(found, "x", cells=columns, cell=cell[0]), _middle(found, "y", cells=rows, cell=cell[1]))
    return AsciiGrid(columns, rows, cell, middle, found.get("nodata"), lines[body:], body + 1)


def number(text: str, *, line: int) -> float:
    try:
        if "_" not in text:  # which Python would pass over
            return float(text.replace(",", ".", 1))
    except ValueError:
        pass
    raise ValueError(f"line {line}: {text[:40]!r} is no number")


def _text(data: bytes) -> str:
    """The text of a file; byte-order marks say in which encoding it is, and comments may be in any."""
    try:
        text = decoded(data)
    except UnicodeDecodeError:
        text = decoded(data, otherwise="latin-1")
    if "\0" in text[:4096]:
        raise ValueError(f"it is binary; {_CONVERT}")
    return text


def _count(found: dict[str, float], key: str) -> int:
    if key not in found:
        raise ValueError(f"its header has no {key}; {_CONVERT}")
    value = found[key]
    if not (1 <= value <= 1e9 and value == int(value)):
        raise ValueError(f"{key} = {value:g} must be a whole number > 0")
    return int(value)


def _side(found: dict[str, float], key: str) -> float:
    value = found.get(key, found.get("cellsize"))
    if value is None:
        raise ValueError("its header has no cellsize, nor dx and dy")
    if not 0 < value <= _LARGEST:
        raise ValueError(
            f"{'cellsize' if key not in found else key} = {value:g} must be a cell size in (0, {_LARGEST:g}]"
        )
    return value


def _middle(found: dict[str, float], axis: str, *, cells: int, cell: float) -> float:
    """X or y of the middle; NaN if the file does not say where it lies."""
    if f"{axis}llcenter" in found:
        return found[f"{axis}llcenter"] + (cells - 1) * cell / 2
    return found.get(f"{axis}llcorner", math.nan) + cells * cell / 2
