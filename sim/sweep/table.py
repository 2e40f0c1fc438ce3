"""The table of a sweep: one row per run, with the settings that distinguish the runs and all figures of the summary.

Each number of the summary is a column of floats, with names such as `delay_ms.p95`; lists of numbers are columns of
lists. The whole summary is in the column `summary` as JSON, and the resolved scenario in `scenario`.
"""

import contextlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from sim.results.run_table import flat
from sim.sweep.one_run import Finished
from sim.sweep.tasks import Task
from sim.sweep.toml_values import toml_value


def table_of(rows: Sequence[tuple[Task, Finished]], varied: Sequence[str]) -> pa.Table:
    """One row per task; each of the scenario keys `varied` gets a column."""
    names: dict[str, None] = {}
    figures: list[Mapping[str, Any]] = []
    for _, done in rows:
        row = {**flat(json.loads(done.summary or "{}")), **json.loads(done.measured)}
        figures.append(row)
        names.update(dict.fromkeys(row))
    columns: dict[str, pa.Array] = {
        "run": _texts([task.key for task, _ in rows]),
        "case": _texts([task.case for task, _ in rows]),
        **{key: _settings([task.value(key) for task, _ in rows]) for key in varied},
        "seed": pa.array([task.seed for task, _ in rows], pa.int64()),
        "status": _texts(["failed" if done.failed else "ok" for _, done in rows]),
        "error": _texts([done.error for _, done in rows]),
    }
    for name in sorted(names):
        if name not in columns:
            columns[name] = _figures([row.get(name) for row in figures])
    columns["code"] = _texts([done.code for _, done in rows])
    columns["command"] = _texts([task.command for task, _ in rows])
    columns["scenario"] = _texts([json.dumps(task.tree) for task, _ in rows])
    columns["summary"] = _texts([done.summary for _, done in rows])
    return pa.table(columns)


def _texts(values: Sequence[str | None]) -> pa.Array:
    return pa.array([None if each is None else told(each) for each in values], pa.string())


def told(text: str) -> str:
    """Text that UTF-8 can hold: half of a pair of surrogates, as for a byte in the name of a file, as its code."""
    return text if text.isascii() else text.encode(errors="backslashreplace").decode()


def _settings(values: list[object]) -> pa.Array:
    """A column of one type if all values are numbers, texts or truth values; otherwise their TOML text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {str}:
        return _texts([None if value is None else str(value) for value in values])
    if kinds <= {bool} or kinds <= {int}:
        return pa.array(values)
    if kinds <= {int, float}:
        return pa.array(values, pa.float64())
    return _texts([None if value is None else toml_value(value) for value in values])


def _figures(values: list[object]) -> pa.Array:
    kinds = {type(value) for value in values if value is not None}
    if not kinds:  # any type would be a guess that may not fit other tables
        return pa.nulls(len(values))
    if kinds <= {bool}:
        return pa.array(values, pa.bool_())
    if kinds <= {int, float}:
        return pa.array(values, pa.float64())
    if kinds <= {list}:
        with contextlib.suppress(pa.ArrowInvalid, TypeError):  # not of numbers
            return pa.array(values, pa.list_(pa.float64()))
    return _texts([None if value is None else str(value) for value in values])
