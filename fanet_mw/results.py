"""Results for a notebook: `fanet_mw.results.read(DIR)` is the table of a sweep or of a single run.

Needs the extra `sweep`. A companion computer, which has neither results nor numpy, never imports what this calls.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyarrow import Table


def read(*folders: str | Path) -> "Table":
    """Every run of these folders (`fanet sweep --out`, `fanet simulate --out`) as one pyarrow table.

    `.to_pandas()` makes a pandas table of it, `polars.from_arrow(...)` one of polars. Raises ConfigError for a folder
    that holds no results.
    """
    table: Table = import_module("sim.results.read").read(*folders)
    return table
