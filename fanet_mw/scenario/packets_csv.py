"""Reads a file of packets, a line `seconds,bytes` for each, as spreadsheets of several countries write it.

Cells lie between commas, semicolons or tabs; a decimal comma is read where it cannot be one between cells. Lines that
begin with `#` are comments, `sep=;` is Excel's word. A heading that says that the cells hold something else is refused.
"""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.tables.sections import MOST_S
from fanet_mw.scenario.tables.traffic import LEAST_BYTES, MOST_BYTES
from fanet_mw.scenario.text_files import read_text

_BETWEEN: Final = re.compile(r"\s*\"?sep=(.)\"?\s*", re.IGNORECASE)
_LIKE_A_NUMBER: Final = re.compile(r"[-+=.\d]")
_DECIMAL: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?")
_COMMENT: Final = re.compile(r"\s*#(?!N/A|DIV/0!|VALUE!|REF!|NAME\?|NUM!|NULL!|##)")
"""What a spreadsheet writes where it has no value is no comment."""
_THOUSANDS: Final = re.compile(r"[1-9]\d{0,2},\d{3}")
_OTHER_SECONDS: Final = re.compile(
    r"m(illi)?s(ec|ecs|ekunden)?|milliseconds?|us(ec)?|[µμ]s|microseconds?|ns|nanoseconds?|min(s|utes?|uten)?|h|hours?"
    r"|bytes?|size|len(gth)?|octets|größe"
)
_OTHER_BYTES: Final = re.compile(r"[km]i?b|kilobytes|k?bits?|m?s(ec|ecs|econds?|ekunden)?|time|t|zeit")
"""Words of a heading by which a cell holds neither seconds nor bytes."""


def packets_of(path: Path, *, key: str) -> list[tuple[float, int]]:
    """The packets of a file; raises ConfigError with the line that is wrong. `key` is the scenario's for it."""
    what = f"{key} = {path}"
    found: list[tuple[float, int]] = []
    may_be_heading = True
    for number, line, cells in _lines(read_text(path, what=what, latin=True), what):  # as Excel writes it
        if may_be_heading and not any(_LIKE_A_NUMBER.match(cell) for cell in cells):
            _require_units(cells, f"{what}, line {number}: {line!r}")
        else:
            seconds, size = map(_number, cells) if len(cells) == 2 else (None, None)
            if seconds is None or size is None or seconds < 0 or size != int(size):
                raise ConfigError(
                    f"{what}, line {number}: {line!r} must be seconds,bytes: a number >= 0 and a whole one"
                )
            if seconds > MOST_S:
                raise ConfigError(
                    f"{what}, line {number}: {line!r}: seconds must be at most {MOST_S:g}; they count from start_s, "
                    "and are no time of day"
                )
            if not LEAST_BYTES <= size <= MOST_BYTES:
                raise ConfigError(
                    f"{what}, line {number}: {line!r}: bytes must be within [{LEAST_BYTES}, {MOST_BYTES}]; they "
                    "include the routing header"
                )
            found.append((seconds, int(size)))
        may_be_heading = False
    if not found:
        raise ConfigError(f"{what}: holds no line seconds,bytes")
    return found


def _lines(text: str, what: str) -> Iterator[tuple[int, str, Sequence[str]]]:
    """The number, the text and the cells of each line that holds any."""
    lines = [("" if _COMMENT.match(line) else line) for line in text.splitlines()]
    first = next((at for at, line in enumerate(lines) if line.strip()), None)
    if first is not None and (stated := _BETWEEN.fullmatch(lines[first])):
        between, lines[first] = stated[1], ""
    else:
        between = next((mark for mark in (";", "\t") if any(mark in line for line in lines)), ",")
    for number, line in enumerate(lines, start=1):
        try:
            cells = next(csv.reader([line.rstrip(f"{between} \t")], delimiter=between, skipinitialspace=True), [])
        except csv.Error as error:
            raise ConfigError(f"{what}, line {number}: {error}") from error
        if "".join(cells).strip():
            yield number, line[:80], [_point(cell.strip().strip("'").strip(), between) for cell in cells]


def _point(cell: str, between: str) -> str:
    """A cell with a decimal point; among commas, what may be thousands stays as it is."""
    return cell if between == "," and _THOUSANDS.fullmatch(cell) else cell.replace(",", ".", 1)


def _number(text: str) -> float | None:
    """A finite number as people write it; None for anything else."""
    value = float(text) if _DECIMAL.fullmatch(text) else math.nan
    return value if math.isfinite(value) else None


def _require_units(heading: Sequence[str], where: str) -> None:
    """Raises ConfigError for a heading by which the cells hold no seconds, or no bytes."""
    for cell, others in zip(heading, (_OTHER_SECONDS, _OTHER_BYTES), strict=False):
        if any(map(others.fullmatch, re.findall(r"[^\W\d_]+", cell.lower()))):
            raise ConfigError(f"{where}: the cells of each line must be seconds and bytes, in this order")
