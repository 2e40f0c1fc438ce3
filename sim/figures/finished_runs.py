"""The finished runs of a sweep, looked up by case and settings, and functions that combine their values seed by seed.

A dictionary from seed to value, ascending, holds one quantity. Runs of one seed have random numbers in common, so
values are always combined within a seed.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import Table

from fanet_mw.errors import ConfigError
from sim.figures.statistics import Interval, interval
from sim.results.run_table import read_parquet
from sim.sweep.measures import DELAY_EDGES_S

Row = Mapping[str, Any]
_LEFT_OUT: Final = ("summary", "trace_sha256")
"""The summary, whose figures are columns, and hashes, which nothing compresses: half of the file."""
Quantity = str | Callable[[Row], float | None]
"""A quantity of a run: the name of a column, or a function of the row; None where it is undefined."""


class Runs:
    """The rows of a sweep's table, one per run; failed runs are counted and left out of everything else."""

    def __init__(self, table: Table) -> None:
        if missing := {"status", "seed", "code"} - {*table.column_names}:
            raise ConfigError(f"the table has no column {', '.join(sorted(missing))}, so it is not of a sweep")
        rows = table.drop_columns([name for name in ("summary",) if name in table.column_names]).to_pylist()
        self.rows: list[Row] = [row for row in rows if row["status"] == "ok"]
        self.failed = len(rows) - len(self.rows)

    def where(self, **settings: object) -> list[Row]:
        """The rows with these settings: `case`, or scenario keys in which each dot is written as `__`."""
        wanted = {key.replace("__", "."): value for key, value in settings.items()}
        return [row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())]

    def per_seed(self, quantity: Quantity, **settings: object) -> dict[int, float]:
        """The quantity by seed, ascending; runs in which it is undefined are left out."""
        found: dict[int, float] = {}
        for row in sorted(self.where(**settings), key=lambda row: row["seed"]):
            value = row.get(quantity) if isinstance(quantity, str) else quantity(row)
            if value is not None:
                found[row["seed"]] = float(value)
        return found

    def of(self, quantity: Quantity, **settings: object) -> Interval:
        """The mean of the quantity over the seeds, with its confidence interval."""
        return interval(list(self.per_seed(quantity, **settings).values()))

    def levels(self, key: str, **settings: object) -> list[Any]:
        """All values of one setting among the rows with the other settings, ascending."""
        return sorted({row[key] for row in self.where(**settings) if row[key] is not None})


def arrived(runs: Runs, case: str) -> list[Interval]:
    """For each upper edge of `DELAY_EDGES_S` the share of packets x targets delivered by then, mean over the seeds."""
    sums = [[had / row["wanted"] for had in accumulate(row["delay_counts"])] for row in runs.where(case=case)]
    return [interval(column) for column in zip(*sums, strict=True)][: len(DELAY_EDGES_S)]


def differences(left: Mapping[int, float], right: Mapping[int, float]) -> list[float]:
    """Left minus right for each seed that both have: paired samples, as they have random numbers in common."""
    return [left[seed] - right[seed] for seed in left if seed in right]


def mean_per_seed(*many: Mapping[int, float]) -> dict[int, float]:
    """For each seed that all of these quantities have, their mean."""
    return {seed: sum(values) / len(values) for seed, values in _together(many).items()}


def max_per_seed(*many: Mapping[int, float]) -> dict[int, float]:
    """For each seed that all of these quantities have, the greatest one of them."""
    return {seed: max(values) for seed, values in _together(many).items()}


def _together(many: Sequence[Mapping[int, float]]) -> dict[int, list[float]]:
    seeds = [seed for seed in many[0] if all(seed in other for other in many)] if many else []
    return {seed: [one[seed] for one in many] for seed in seeds}


def keep(table: pa.Table, folder: Path, sweep: str, variant: str) -> Path:
    """Write the table of a sweep as the repository keeps it, small; the same table always gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    kept = table.drop_columns([name for name in _LEFT_OUT if name in table.column_names])
    pq.write_table(kept, _path(folder, sweep, variant), compression="zstd", compression_level=19)
    return _path(folder, sweep, variant)


def read_kept(folder: Path, sweep: str, variant: str) -> pa.Table | None:
    path = _path(folder, sweep, variant)
    return read_parquet(path, follow=True) if path.exists() else None


def _path(folder: Path, sweep: str, variant: str) -> Path:
    return folder / f"{sweep}-{variant}.parquet"
