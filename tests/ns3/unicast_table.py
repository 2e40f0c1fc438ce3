"""Writes `tests/validation/ns3/unicast_load.csv` from a live ns-3.44: `python tests/ns3/unicast_table.py PREFIX [JOBS]`

Stations in a disc of 100 m radius send acknowledged unicast to one of them at regular intervals, as the scenario
`contention_unicast` does, and for as long: where more is offered than the medium carries, the queues are still empty at
first, so the share that arrives depends on how long the run is. PREFIX: see `live.py`.
"""

import csv
import statistics
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from typing import Final

from tests.ns3 import live

TABLE: Final = Path(__file__).parent.parent / "validation" / "ns3" / "unicast_load.csv"
SENDERS: Final = (2, 10, 44)
INTERVALS_S: Final = (0.01, 0.02, 0.05, 0.1)
RUNS: Final = 5
DURATION_S: Final = 10
_HEAD: Final = ("chan", "arr", "nsrc", "interval", "runs", "pdr", "pdr_sd", "mean_retries", "mean_retries_sd")


def row(what: tuple[int, float], *, program: Path) -> list[str]:
    """One row of the table."""
    senders, interval_s = what
    said = [
        live.run(
            program, topology="disc", nodes=senders + 1, cast="unicast", arrivals="cbr", interval=interval_s,
            duration=DURATION_S, run=run,
        )
        for run in range(1, RUNS + 1)
    ]  # fmt: skip
    cells = ["A", "cbr", str(senders), f"{interval_s:g}", str(RUNS)]
    for figure in ("pdr", "air.mean_retries"):
        values = [one[figure] for one in said]
        cells += [f"{statistics.fmean(values):.6f}", f"{statistics.stdev(values):.6f}"]
    return cells


def main(prefix: Path, jobs: int) -> None:
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(jobs) as pool:
        program = live.build(prefix, Path(folder))
        rows = list(pool.map(partial(row, program=program), product(SENDERS, INTERVALS_S)))
    with TABLE.open("w", encoding="ascii", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([_HEAD, *rows])


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if sys.argv[2:] else 1)
