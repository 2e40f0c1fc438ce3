"""Writes `tests/validation/ns3/hidden_terminal.csv` from a live ns-3.44: `python tests/ns3/hidden_table.py PREFIX`.

Two stations that do not hear each other send to the one between them. Under `cbr` their phases decide at the start
whether all frames collide or none: there many short runs say more than a few long ones. PREFIX: see `live.py`.
"""

import argparse
import csv
import statistics
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

from tests.ns3 import live

TABLE: Final = Path(__file__).parent.parent / "validation" / "ns3" / "hidden_terminal.csv"
CASTS: Final = {"bc": "broadcast", "uc": "unicast"}
_HEAD: Final = (
    "chan", "cast", "arr", "interval", "seconds", "runs", "pdr", "pdr_sd", "mean_retries", "mean_retries_sd",
)  # fmt: skip


class Load(NamedTuple):
    """How the stations send, for how long, and how often that is repeated."""

    arrivals: str
    interval_s: float
    seconds: int
    runs: int


LOADS: Final = (
    *(Load("cbr", interval_s, seconds=3, runs=500) for interval_s in (0.01, 0.1)),
    *(Load("poisson", interval_s, seconds=30, runs=10) for interval_s in (0.005, 0.01, 0.02, 0.05, 0.1)),
)


def row(what: tuple[str, Load], *, program: Path) -> list[str]:
    """One row of the table."""
    cast, load = what
    said = [
        live.run(
            program, topology="hidden", cast=CASTS[cast], arrivals=load.arrivals, interval=load.interval_s,
            duration=load.seconds, run=run,
        )
        for run in range(1, load.runs + 1)
    ]  # fmt: skip
    cells = ["A", cast, load.arrivals, f"{load.interval_s:g}", str(load.seconds), str(load.runs)]
    for figure in ("pdr", "air.mean_retries"):
        values = [one[figure] for one in said]
        blank = figure != "pdr" and cast == "bc"
        cells += ["", ""] if blank else [f"{statistics.fmean(values):.6f}", f"{statistics.stdev(values):.6f}"]
    return cells


def main() -> None:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    prefix = flags.parse_args().prefix
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor() as pool:
        program = live.build(prefix, Path(folder))
        rows = list(pool.map(partial(row, program=program), product(CASTS, LOADS)))
    with TABLE.open("w", encoding="ascii", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([_HEAD, *rows])


if __name__ == "__main__":
    main()
