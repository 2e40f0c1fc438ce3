"""Generate the table of figures in docs/reference/results.md; `--check` compares.

What each figure means stands in `sim/results/summary_figures.toml`.
"""

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # this tree, not the package that is installed

from scripts.generated import between, write_or_check  # noqa: E402  (the tree's root is on the path now)

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
    return write_or_check(arguments, script=Path(__file__).name, wanted=lambda: between(document, BEGIN, END, table()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
