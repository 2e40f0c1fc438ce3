"""The folder of a sweep: the result of each finished run is stored at once, so a crash loses only the runs under way.

    DIR/finished/*.parquet   one row per finished run, under its key; each file is written whole, then renamed
    DIR/runs.parquet         the table for people: a row per run of the sweep, in its order, with settings and figures

The same sweep with the same code gives the same `runs.parquet`, whatever the machine and the order of the runs.
"""

import contextlib
import fcntl
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import TypeAdapter, ValidationError

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import json_of
from fanet_mw.whole_file import replacing, require_folder, writing
from sim.results.run_folder import checked
from sim.results.run_table import flat, read_parquet
from sim.sweep.one_run import Finished
from sim.sweep.tasks import Task
from sim.sweep.toml_values import toml_value

TABLE: Final = "runs.parquet"
_SCHEMA: Final = pa.schema(
    [
        (field.name, pa.float64() if field.type is float else pa.string())
        for field in fields(Finished)
    ]
)  # fmt: skip
_UNFINISHED: Final = re.compile(r"\.(runs|\d{6,12})\.parquet\.\d+\.new")
_PART: Final = re.compile(r"\d{6,12}\.parquet")
"""The names of files that this store makes; no others are read or removed."""
_ROW: Final = TypeAdapter(Finished)
_TABLE: Final = TypeAdapter(dict[str, Any])
_MERGE_AT: Final = 200
"""The number of files with single runs that are merged into one, because a folder with thousands is slow to read."""


def _rows(path: Path) -> list[dict[str, Any]]:
    """The rows of one file of finished runs."""
    try:
        rows: list[dict[str, Any]] = read_parquet(path).to_pylist()
        return rows
    except ConfigError as error:
        raise ConfigError(f"{str(error).rstrip('.')}; remove it, and its runs are repeated") from error


def _storable(row: Finished) -> dict[str, Any]:
    return {name: told(value) if isinstance(value, str) else value for name, value in asdict(row).items()}


class Store:
    """The finished runs in one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._parts = folder / "finished"
        self._finished: dict[str, Finished] = {}
        self._files: list[Path] = []
        self._next = 0

    def read(self) -> None:
        """Read what earlier sweeps have finished here; half-written files are removed."""
        try:
            require_folder(self._parts)
            for path in (*self.folder.iterdir(), *self._parts.iterdir()):
                if _UNFINISHED.fullmatch(path.name):
                    path.unlink()
            self._files = sorted(path for path in self._parts.iterdir() if _PART.fullmatch(path.name))
            for path in self._files:
                for row in _rows(path):
                    done = _ROW.validate_python(row)
                    for text in (done.summary or "{}", done.measured):
                        checked(_TABLE, json_of(text.encode(), source=str(path)), path)
                    if done.failed and not done.error:
                        raise ConfigError(f"{path}: run {done.key} has neither a summary nor an error")
                    self._finished[done.key] = done
        except OSError as error:
            raise ConfigError(f"--out {self.folder}: cannot be written: {error.strerror}") from error
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise ConfigError(
                f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg'].lower()}; it is of another program or "
                "version: remove it, and its runs are repeated"
            ) from error
        self._next = max((int(path.stem) for path in self._files), default=0) + 1

    def get(self, key: str) -> Finished | None:
        return self._finished.get(key)

    def add(self, done: Finished) -> None:
        """Store the result of a run; it is on disk when this method returns."""
        self._finished[done.key] = done
        self._files.append(self._write([done]))
        if len(self._files) >= _MERGE_AT:
            self._merge()

    def _merge(self) -> None:
        old = self._files
        self._files = [self._write(self._finished.values())]
        # the new file has all of them; if the process dies here, a run is stored twice, which does no harm
        for path in old:
            path.unlink()

    def _write(self, rows: Iterable[Finished]) -> Path:
        path = self._parts / f"{self._next:06}.parquet"
        self._next += 1
        write_whole(path, pa.Table.from_pylist([_storable(row) for row in rows], schema=_SCHEMA))
        return path

    def publish(self, tasks: Sequence[Task], columns: Sequence[str]) -> pa.Table:
        """Write the table of these runs, as far as they are finished, and return it."""
        rows = [(task, self._finished[task.key]) for task in tasks if task.key in self._finished]
        table = table_of(rows, columns)
        write_whole(self.folder / TABLE, table)
        return table

    def _lock(self, lock: int) -> None:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ConfigError(f"--out {self.folder}: another sweep writes there now") from error
        except OSError as error:
            raise ConfigError(
                f"--out {self.folder}: its file system cannot lock files (flock: {error.strerror}), so that two sweeps "
                "might write there at the same time: choose a folder on another one"
            ) from error

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Lock the folder against other processes; raises ConfigError if another one has locked it."""
        with writing(f"--out {self.folder}"):
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = os.open(self.folder / ".lock", os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            self._lock(lock)
            yield
        finally:
            os.close(lock)


def write_whole(path: Path, table: pa.Table) -> None:
    """Write a table so that it is complete or missing, even if the machine dies; raises ConfigError."""
    with writing(path), replacing(path) as file:
        pq.write_table(table, file, compression="zstd")
        file.flush()
        os.fsync(file.fileno())


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
