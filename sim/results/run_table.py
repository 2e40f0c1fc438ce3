"""Results as a table: one row per run, for a notebook. `read` takes the folder of a sweep, or of a single run."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import open_regular
from sim.results.file_names import SUMMARY_FILE
from sim.results.run_folder import RunFolder

if TYPE_CHECKING:
    from pyarrow import Table

_SWEEP: Final = "runs.parquet"
_MOST_BYTES: Final = 1 << 31
"""The greatest size of a table, packed and unpacked."""


def read(*folders: str | Path) -> "Table":
    """Every run of these folders (`fanet sweep --out`, `fanet simulate --out`) as one pyarrow table.

    `.to_pandas()` makes a pandas table of it, `polars.from_arrow(...)` one of polars. Columns that a folder does not
    have are null in its rows. Raises ConfigError for a folder that holds neither.
    """
    try:
        import pyarrow as pa
    except ImportError as error:
        raise ConfigError("reading results needs pyarrow: pip install 'fanet-mw[sweep]'") from error
    tables = [_read(Path(folder)) for folder in folders]
    if not tables:
        raise ConfigError("read: needs at least one folder")
    return pa.concat_tables(tables, promote_options="permissive")


def _read(folder: Path) -> "Table":
    import pyarrow as pa

    if folder.is_file():
        return read_parquet(folder, follow=True)
    if os.path.lexists(folder / _SWEEP):
        return read_parquet(folder / _SWEEP)
    if os.path.lexists(folder / SUMMARY_FILE):
        return pa.Table.from_pylist([_row(folder)])
    raise ConfigError(f"{folder}: holds neither {_SWEEP} (of a sweep) nor {SUMMARY_FILE} (of a run)")


def read_parquet(path: Path, *, follow: bool = False) -> "Table":
    """The table of a regular file of bounded size, also when it is unpacked; raises ConfigError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with open_regular(path, most_bytes=_MOST_BYTES, follow=follow) as file:
        try:
            found = pq.ParquetFile(file)
            size = sum(found.metadata.row_group(i).total_byte_size for i in range(found.metadata.num_row_groups))
            table = found.read() if 0 <= size <= _MOST_BYTES else None
            if table is not None:
                table.validate(full=True)  # for example that text is UTF-8
        except (OSError, ValueError, pa.ArrowException) as error:  # also names of columns that are no UTF-8
            raise ConfigError(f"{path}: cannot be read: {str(error)[:200]}") from error
    if table is None:
        raise ConfigError(f"{path}: cannot be read: {size} bytes when unpacked, at most {_MOST_BYTES}")
    return table


def _row(folder: Path) -> dict[str, Any]:
    """A single run as one row with the same columns."""
    run = RunFolder(folder)
    scenario = run.scenario.model_dump(mode="json", exclude_none=True)
    row: dict[str, Any] = {"seed": scenario["seed"], "status": "ok", **flat(run.summary)}
    return {**row, "scenario": json.dumps(scenario), "summary": run.text.decode()}


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
