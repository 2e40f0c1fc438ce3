"""Results as a table: one row per run, for a notebook. `read` takes the folder of a sweep, or of a single run."""

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fanet_mw.errors import ConfigError
from sim.results.file_names import SCENARIO_FILE, SUMMARY_FILE
from sim.results.flat_summary import flat

if TYPE_CHECKING:
    from pyarrow import Table

_SWEEP = "runs.parquet"


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
    import pyarrow.parquet as pq

    path = folder if folder.is_file() else folder / _SWEEP
    try:
        if path.exists():
            return pq.read_table(path)
        if (folder / SUMMARY_FILE).exists():
            return pa.Table.from_pylist([_row(folder)])
    except (OSError, ValueError, pa.ArrowException) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    raise ConfigError(f"{folder}: holds neither {_SWEEP} (of a sweep) nor {SUMMARY_FILE} (of a run)")


def _row(folder: Path) -> dict[str, Any]:
    """A single run as one row with the same columns."""
    text = (folder / SUMMARY_FILE).read_text(encoding="utf-8")
    scenario = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8"))
    row: dict[str, Any] = {"seed": scenario.get("seed"), "status": "ok", **flat(json.loads(text))}
    return {**row, "scenario": json.dumps(scenario), "summary": text}
