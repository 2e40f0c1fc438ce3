"""Flies the missions of long tables piece by piece: `python -m tests.tables.pieces --seconds 600 TABLE ...`.

What was flown is kept (`kept.py`); once all of a table is there, `scripts/tables TABLE` writes it at once.
"""

import argparse
from collections.abc import Mapping
from typing import Final

from tests.tables.kept import KEPT, Kept, OutOfTime
from tests.tables.missions import CLEAR, COUNTRY_IN_SMALL, PLACES, WHOLE, Case, fly
from tests.tables.small_rescues import ENGINES, SENSES

TABLES: Final[Mapping[str, Mapping[str, Case]]] = {
    "whole-missions": WHOLE, "places": PLACES, "country-in-small": COUNTRY_IN_SMALL, "keeping-clear": CLEAR,
    "engines": ENGINES, "senses": SENSES,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=list(TABLES))
    parser.add_argument("--seconds", type=float, help="begin no mission that would end later; by default fly all")
    parser.add_argument("--by-seed", action="store_true", help="the first seeds of all cases, then the next")
    parser.add_argument("--only", default="", help="only cases whose name has this in it")
    asked = parser.parse_args()
    kept = Kept(KEPT, fly, seconds=asked.seconds)
    cases = ((name, case) for table in asked.tables for name, case in TABLES[table].items() if asked.only in name)
    pieces = [(seed, name, case) for name, case in cases for seed in case.seeds]
    if asked.by_seed:
        pieces.sort(key=lambda piece: piece[0])  # stable: cases keep their order
    for seed, name, case in pieces:
        try:
            found = case.flown(kept, seed)
        except OutOfTime:
            return
        print(
            f"{name}, seed {seed}: {found['confirmed']} of {found['survivors']} confirmed, "
            f"{found['collisions']} contacts, {found['simulated_s'] / found['cpu_s']:.1f} x real time",
            flush=True,
        )


if __name__ == "__main__":
    main()
