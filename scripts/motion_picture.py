#!/usr/bin/env python
"""Draws the table of docs/results/motion.md, four methods in motion, as docs/results/pictures/motion.png."""

import sys
from pathlib import Path
from typing import Final

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from sim.figures.colors import BLUE, GREEN, RED  # noqa: E402  (the tree's root is on the path now)
from sim.figures.style import applied, canvas  # noqa: E402

DOCUMENT, PICTURE = ROOT / "docs" / "results" / "motion.md", ROOT / "docs" / "results" / "pictures" / "motion.png"
_TABLE: Final = "methods-in-motion"
_LOOKS: Final = ((BLUE, "o"), (GREEN, "s"), (RED, "^"))
"""One per motion, told apart without colors, too."""


def rows() -> list[list[str]]:
    """The rows of the table, without its head."""
    text = DOCUMENT.read_text(encoding="utf-8")
    table = text[text.index(f"<!-- table: {_TABLE}") : text.index(f"<!-- end of {_TABLE}")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[3:]]


def main() -> None:
    found = rows()
    motions, methods = list(dict.fromkeys(row[0] for row in found)), list(dict.fromkeys(row[1] for row in found))
    with applied():
        figure, (shares, delays) = canvas(2, width=4.5, height=3.2)
        for number, (motion, (color, marker)) in enumerate(zip(motions, _LOOKS, strict=True)):
            of_motion = {row[1]: row for row in found if row[0] == motion}
            places = [index + 0.22 * (number - 1) for index in range(len(methods))]
            reached = [float(of_motion[method][3]) for method in methods]
            p50, p95 = ([float(of_motion[method][column]) for method in methods] for column in (6, 7))
            shares.plot(reached, places, marker, color=color, label=motion)
            middle = [high - low for low, high in zip(p50, p95, strict=True)]
            delays.errorbar(p50, places, xerr=[[0.0] * len(p50), middle], fmt=marker, color=color, capsize=3)
        for axes in (shares, delays):
            axes.set_yticks(range(len(methods)), [method.replace("`", "") for method in methods])
            axes.invert_yaxis()
        shares.set_xlabel("delivered, of what was reachable")
        delays.set_xlabel("delay p50 (mark) and p95 (bar) [ms]")
        delays.set_xscale("log")
        figure.legend(loc="outside upper center", ncols=len(motions))
        figure.savefig(PICTURE, dpi=150)


if __name__ == "__main__":
    main()
