"""Results for a notebook: `read(DIR)` is the table of a sweep or of a single run, `records(DIR)` the events of a run.

`read` needs the extra `sweep`, `records` none. A companion computer, which has neither results nor numpy, never imports
what these call.
"""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from fanet_mw.trace import Record

if TYPE_CHECKING:
    from pyarrow import Table

R = TypeVar("R", bound=Record)


def read(*folders: str | Path) -> "Table":
    """Every run of these folders (`fanet sweep --out`, `fanet simulate --out`) as one pyarrow table.

    `.to_pandas()` makes a pandas table of it, `polars.from_arrow(...)` one of polars. Raises ConfigError for a folder
    that holds no results.
    """
    table: Table = import_module("sim.results.run_table").read(*folders)
    return table


def records(folder: str | Path, *kinds: type[R]) -> Iterator[R]:
    """The recorded events of one run (`fanet simulate --out`, `fanet launch --out`), in the order of its trace.

    With `kinds` (classes of `fanet_mw.trace`) only those: `records(DIR, Delivered, Dropped)`. Raises ConfigError for a
    folder without a trace, and at a line that is no record.
    """
    found: Iterator[R] = import_module("sim.results.run_folder").read_trace(Path(folder), *kinds)
    return found
