"""Measured tables in Markdown: found by their markers, written anew, and compared number by number.

    <!-- table: NAME by scripts/tables NAME -->
    | head | head |
    |---|---|
    | cell | 0.123 |
    <!-- end of NAME -->

A cell agrees when it has the same words, and each of its numbers is near the measured one.
"""

import re
from collections.abc import Sequence
from typing import Final, NamedTuple

Rows = Sequence[Sequence[str]]
"""A head, and the rows below it."""
_NUMBER: Final = re.compile(r"[-+]?\d+(?:,\d{3})*(?:\.\d+)?")
_BEGINS: Final = re.compile(r"^<!-- table: (\S+) by (.+) -->$", re.MULTILINE)


class Tolerance(NamedTuple):
    """How far a number may be from the one measured now: the wider of both, and half a unit of its last digit."""

    absolute: float = 0.0
    relative: float = 0.0

    def of(self, number: float) -> float:
        return max(self.absolute, self.relative * abs(number))


def begin(name: str) -> str:
    return f"<!-- table: {name} by scripts/tables {name} -->"


def end(name: str) -> str:
    return f"<!-- end of {name} -->"


def names(text: str) -> list[str]:
    """The measured tables of a document, in order."""
    return [name for name, _ in _BEGINS.findall(text)]


def written(rows: Rows) -> str:
    """A table in Markdown."""
    head, *body = rows
    lines = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def replaced(text: str, name: str, rows: Rows) -> str:
    """The document with another table between the markers of that name; raises ValueError if there are none."""
    before, after = _around(text, name)
    return f"{before}\n{written(rows)}\n{after}"


def read(text: str, name: str) -> Rows:
    """The table between the markers of that name; raises ValueError if there are none."""
    before, after = _around(text, name)
    lines = text[len(before) : len(text) - len(after)].strip().splitlines()
    if not lines:
        return []
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in (lines[0], *lines[2:])]


def _around(text: str, name: str) -> tuple[str, str]:
    if text.count(begin(name)) != 1 or text.count(end(name)) != 1:
        raise ValueError(f"the document must have `{begin(name)}` and `{end(name)}` once each")
    before, rest = text.split(begin(name))
    return before + begin(name), end(name) + rest.split(end(name))[1]


def differences(documented: Rows, measured: Rows, tolerance: Tolerance, *, machine: Sequence[str] = ()) -> list[str]:
    """What is not as measured, a line each; the columns named in `machine` depend on the machine and are left out."""
    if not documented or list(documented[0]) != list(measured[0]):
        return [f"head: {list(documented[0]) if documented else 'none'} in the document, {list(measured[0])} measured"]
    if len(documented) != len(measured):
        return [f"{len(documented) - 1} rows in the document, {len(measured) - 1} measured"]
    head = measured[0]
    return [
        f"{ours[0]}, {column}: {said} in the document, {found} measured"
        for ours, theirs in zip(documented[1:], measured[1:], strict=True)
        for column, said, found in zip(head, ours, theirs, strict=True)
        if column not in machine and not near(said, found, tolerance)
    ]


def near(said: str, found: str, tolerance: Tolerance) -> bool:
    """Whether two cells have the same words, and numbers that are near each other."""
    if _NUMBER.sub("#", said) != _NUMBER.sub("#", found):
        return False
    pairs = zip(_NUMBER.findall(said), _NUMBER.findall(found), strict=True)
    return all(abs(_value(a) - _value(b)) <= tolerance.of(_value(b)) + _half_a_unit(a) for a, b in pairs)


def _value(number: str) -> float:
    return float(number.replace(",", ""))


def _half_a_unit(number: str) -> float:
    digits = number.partition(".")[2]
    return 0.5000001 * float(10 ** -len(digits)) if digits else 0.0
