"""Flattens a summary into one row of figures with names such as `delay_ms.p95`."""

from collections.abc import Mapping
from typing import Any

Cell = float | bool | str | list[float] | None


def flat(summary: Mapping[str, Any], prefix: str = "") -> dict[str, Cell]:
    """All numbers, truth values, texts and lists of numbers of a summary, under their dotted names."""
    row: dict[str, Cell] = {}
    for key, value in summary.items():
        name = f"{prefix}{key}"
        match value:
            case Mapping():
                row.update(flat(value, f"{name}."))
            case list():
                if value and all(isinstance(item, int | float) for item in value):
                    row[name] = [float(item) for item in value]
            case bool() | str() | None:
                row[name] = value
            case int() | float():
                row[name] = float(value)
    return row
