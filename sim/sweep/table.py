"""The table of a sweep: one row per run, with the settings that distinguish the runs and all figures of the summary.

Each number of the summary is a column of floats, with names such as `delay_ms.p95`; lists of numbers are columns of
lists. The whole summary is in the column `summary` as JSON, and the resolved scenario in `scenario`.
"""

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
        "run": pa.array([task.key for task, _ in rows], pa.string()),
        "case": pa.array([task.case for task, _ in rows], pa.string()),
        **{key: _settings([task.value(key) for task, _ in rows]) for key in varied},
        "seed": pa.array([task.seed for task, _ in rows], pa.int64()),
        "status": pa.array(["failed" if done.failed else "ok" for _, done in rows], pa.string()),
        "error": pa.array([done.error for _, done in rows], pa.string()),
    }
    for name in sorted(names):
        if name not in columns:
            columns[name] = _figures([row.get(name) for row in figures])
    columns["code"] = pa.array([done.code for _, done in rows], pa.string())
    columns["command"] = pa.array([task.command for task, _ in rows], pa.string())
    columns["scenario"] = pa.array([json.dumps(task.tree) for task, _ in rows], pa.string())
    columns["summary"] = pa.array([done.summary for _, done in rows], pa.string())
    return pa.table(columns)


def _settings(values: list[object]) -> pa.Array:
    """A column of one type if all values are numbers, texts or truth values; otherwise their TOML text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {bool} or kinds <= {int} or kinds <= {str}:
        return pa.array(values, type=None if kinds else pa.string())
    if kinds <= {int, float}:
        return pa.array(values, pa.float64())
    return pa.array([None if value is None else toml_value(value) for value in values], pa.string())


def _figures(values: list[object]) -> pa.Array:
    kinds = {type(value) for value in values if value is not None}
    if not kinds:  # any type would be a guess that may not fit other tables
        return pa.nulls(len(values))
    if kinds <= {bool}:
        return pa.array(values, pa.bool_())
    if kinds <= {int, float}:
        return pa.array(values, pa.float64())
    if kinds <= {list}:
        return pa.array(values, pa.list_(pa.float64()))
    return pa.array([None if value is None else str(value) for value in values], pa.string())
