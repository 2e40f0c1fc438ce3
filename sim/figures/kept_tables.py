"""The tables of sweeps as they are kept in the repository: small, and enough to draw and judge every figure anew.

FOLDER/SWEEP-VARIANT.parquet    `runs.parquet` of the sweep without the columns that no figure is made from
"""

from pathlib import Path
from typing import Final

import pyarrow as pa
import pyarrow.parquet as pq

from sim.results.run_table import read_parquet

_LEFT_OUT: Final = ("summary", "trace_sha256")
"""The summary, whose figures are columns, and hashes, which nothing compresses: half of the file."""


def keep(table: pa.Table, folder: Path, sweep: str, variant: str) -> Path:
    """Write the table of a sweep; the same table always gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    kept = table.drop_columns([name for name in _LEFT_OUT if name in table.column_names])
    pq.write_table(kept, _path(folder, sweep, variant), compression="zstd", compression_level=19)
    return _path(folder, sweep, variant)


def read_kept(folder: Path, sweep: str, variant: str) -> pa.Table | None:
    path = _path(folder, sweep, variant)
    return read_parquet(path, follow=True) if path.exists() else None


def _path(folder: Path, sweep: str, variant: str) -> Path:
    return folder / f"{sweep}-{variant}.parquet"
