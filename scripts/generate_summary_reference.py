"""Generate the table of figures in docs/reference/results.md; `--check` compares.

What each figure means stands in `sim/results/summary_figures.toml`.
"""

import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent
DOCUMENT: Final = ROOT / "docs" / "reference" / "results.md"
FIGURES: Final = ROOT / "sim" / "results" / "summary_figures.toml"
BEGIN: Final = "<!-- figures: summary by scripts/generate_summary_reference.py -->\n"
END: Final = "<!-- end of summary -->\n"


def table() -> str:
    """One row for each group of figures."""
    figures = tomllib.loads(FIGURES.read_text(encoding="utf-8"))
    rows = (f"| `{keys.replace(', ', '`, `')}` | {meaning} |\n" for keys, meaning in figures.items())
    return f"| key | definition |\n|---|---|\n{''.join(rows)}"


def main(arguments: Sequence[str], *, document: Path = DOCUMENT) -> int:
    """Write the table between its marks, or with --check say whether it is the one checked in."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write(f"usage: generate_summary_reference.py [--check]; got {' '.join(arguments)}\n")
        return 2
    text = document.read_text(encoding="utf-8")
    found = re.findall(f"{re.escape(BEGIN)}.*?{re.escape(END)}", text, re.DOTALL)
    if len(found) != 1:
        sys.stderr.write(f"{document}: must hold {BEGIN.strip()!r} and {END.strip()!r} once, in this order\n")
        return 1
    wanted = text.replace(found[0], f"{BEGIN}{table()}{END}")
    if not arguments:
        document.write_text(wanted, encoding="utf-8")
    elif text != wanted:
        sys.stderr.write(f"{document}: not what the source says; run scripts/generate_summary_reference.py\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
