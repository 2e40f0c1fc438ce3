"""Looks up the finished runs of a sweep by case and settings: one value per seed, in the order of the seeds."""

from collections.abc import Callable, Mapping
from itertools import accumulate
from typing import Any

from pyarrow import Table

from sim.figures.statistics import Interval, interval
from sim.sweep.measures import DELAY_EDGES_S

Row = Mapping[str, Any]
Quantity = str | Callable[[Row], float | None]
"""A column, or a function of a row."""


class Runs:
    """The rows of a table, without failed runs."""

    def __init__(self, table: Table) -> None:
        rows = table.drop_columns([name for name in ("scenario", "summary") if name in table.column_names]).to_pylist()
        self.rows: list[Row] = [row for row in rows if row["status"] == "ok"]
        self.failed = len(rows) - len(self.rows)

    def where(self, **settings: object) -> list[Row]:
        """The rows with these settings; `case` is one of them, and a dot in a key is written `__`."""
        wanted = {key.replace("__", "."): value for key, value in settings.items()}
        return [row for row in self.rows if all(row.get(key) == value for key, value in wanted.items())]

    def per_seed(self, quantity: Quantity, **settings: object) -> dict[int, float]:
        """The quantity for each seed, in their order, without runs in which it is undefined."""
        found: dict[int, float] = {}
        for row in sorted(self.where(**settings), key=lambda row: row["seed"]):
            value = row.get(quantity) if isinstance(quantity, str) else quantity(row)
            if value is not None:
                found[row["seed"]] = float(value)
        return found

    def of(self, quantity: Quantity, **settings: object) -> Interval:
        """The mean and its interval over the seeds."""
        return interval(list(self.per_seed(quantity, **settings).values()))

    def levels(self, key: str, **settings: object) -> list[Any]:
        """The values of a setting that occur, ascending."""
        return sorted({row[key] for row in self.where(**settings) if row[key] is not None})


def arrived(runs: Runs, case: str) -> list[Interval]:
    """The share of packets x targets that had arrived by each edge of the classes of delay."""
    sums = [[had / row["wanted"] for had in accumulate(row["delay_counts"])] for row in runs.where(case=case)]
    return [interval(column) for column in zip(*sums, strict=True)][: len(DELAY_EDGES_S)]


def differences(left: Mapping[int, float], right: Mapping[int, float]) -> list[float]:
    """Left minus right for each seed that both have; common random numbers make them differences of pairs."""
    return [left[seed] - right[seed] for seed in left if seed in right]


def pooled(*many: Mapping[int, float]) -> dict[int, float]:
    """The mean of several quantities for each seed, so that seeds remain the independent units."""
    seeds = [seed for seed in many[0] if all(seed in other for other in many)] if many else []
    return {seed: sum(one[seed] for one in many) / len(many) for seed in seeds}


def best(*many: Mapping[int, float]) -> dict[int, float]:
    """The greatest of several quantities for each seed."""
    seeds = [seed for seed in many[0] if all(seed in other for other in many)] if many else []
    return {seed: max(one[seed] for one in many) for seed in seeds}
