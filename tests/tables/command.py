"""Measured tables of the documents: `scripts/tables` lists them, `scripts/tables NAME ...` measures and writes them.

With `--check` nothing is written: what is in the document is compared, and differences end with exit code 1. A table of
missions that are not all kept (`kept.py`) stays as it is, and those that are missing are named, with exit code 1, too.
"""

import argparse
import sys
from collections.abc import Sequence

from tests.tables.kept import Missing
from tests.tables.markdown import differences, read, replaced
from tests.tables.registry import TABLES


def check(name: str) -> list[str]:
    """Measure a table, and say where the document has something else."""
    table = TABLES[name]
    documented = read(table.path.read_text(encoding="utf-8"), name)
    return differences(documented, table.measure(), table.tolerance, machine=table.machine)


def write(name: str) -> None:
    """Measure a table, and put it into its document, as that is when the measurement is over."""
    table = TABLES[name]
    rows = table.measure()
    text = table.path.read_text(encoding="utf-8")
    table.path.write_text(replaced(text, name, rows), encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("names", nargs="*", choices=[*TABLES, []], metavar="NAME", help=", ".join(TABLES))
    flags.add_argument("--check", action="store_true", help="compare instead of writing")
    asked = flags.parse_args(arguments)
    if not asked.names:
        for name, table in TABLES.items():
            print(f"{name:16} docs/{table.document}")
    found = []
    for name in asked.names:
        try:
            if asked.check:
                found += [f"{name}: {difference}" for difference in check(name)]
            else:
                write(name)
        except Missing as missing:
            found += [f"{name}: not flown yet: {mission}" for mission in missing.missions]
    for line in found:
        print(line)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
