"""One style for all figures: sizes, lines and colors that stay apart for the color-blind and in print.

Colors are those of Okabe and Ito (2008). No line is told by its color alone: each has a marker and a dash of its own.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.figures.statistics import Interval


class Look(NamedTuple):
    """How one line is drawn, in every figure in which it is."""

    label: str
    color: str
    marker: str
    dash: str | tuple[int, tuple[int, ...]]


LOOKS: Final[Mapping[str, Look]] = {
    "ours": Look("fanet-mw", "#0072B2", "o", "-"),
    "paper": Look("the paper's method", "#D55E00", "s", "--"),
    "flooding": Look("plain flooding", "#009E73", "^", "-."),
    "aodv": Look("AODV", "#CC79A7", "D", (0, (5, 1))),
    "olsr": Look("OLSR", "#E69F00", "v", (0, (3, 1, 1, 1))),
    "gossip": Look("gossip", "#CC79A7", "D", (0, (5, 1))),
    "counter": Look("counter-based", "#E69F00", "v", (0, (3, 1, 1, 1))),
    "limit": Look("a path exists", "#000000", "", (0, (1, 2))),
}
"""By case of a sweep."""
SERIES: Final = (
    Look("", "#0072B2", "o", "-"),
    Look("", "#D55E00", "s", "--"),
    Look("", "#009E73", "^", "-."),
    Look("", "#CC79A7", "D", (0, (5, 1))),
    Look("", "#E69F00", "v", (0, (3, 1, 1, 1))),
)
"""For lines that are levels of a setting, in their order."""

_PARAMETERS: Final[Mapping[str, Any]] = {
    "figure.dpi": 110,
    "savefig.dpi": 150,
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.labelsize": 9.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 5,
    "errorbar.capsize": 2.5,
    "svg.hashsalt": "fanet-mw",
    "svg.fonttype": "none",
}


def applied() -> AbstractContextManager[None]:
    """The style holds for what is drawn and saved within; matplotlib's own settings are as before afterwards."""
    return mpl.rc_context(dict(_PARAMETERS))


def canvas(
    columns: int = 1, rows: int = 1, *, width: float = 4.2, height: float = 3.2, share_y: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, in reading order."""
    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=share_y)
    return figure, list(panels.flat)


def line(axes: Axes, look: Look, xs: Sequence[float], intervals: Sequence[Interval], *, shift: float = 0.0) -> None:
    """Means with their intervals, as one line; a shift keeps the bars of several lines apart."""
    low = [0.0 if item.runs < 2 else item.mean - item.low for item in intervals]
    high = [0.0 if item.runs < 2 else item.high - item.mean for item in intervals]
    axes.errorbar(
        [x + shift for x in xs], [item.mean for item in intervals], yerr=[low, high], label=look.label,
        color=look.color, marker=look.marker or None, linestyle=look.dash,
    )  # fmt: skip


def band(axes: Axes, look: Look, xs: Sequence[float], intervals: Sequence[Interval], *, least: float = 0.0) -> None:
    """The intervals about a line as a band; nothing where a mean is of one run."""
    if all(item.runs > 1 for item in intervals):
        low, high = [max(least, item.low) for item in intervals], [item.high for item in intervals]
        axes.fill_between(xs, low, high, color=look.color, alpha=0.15, linewidth=0)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write PNG and SVG; the same figure gives the same bytes."""
    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    figure.savefig(paths[0], metadata={"Software": None})
    figure.savefig(paths[1], metadata={"Date": None})
    return paths


def save_data(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """What is drawn, as a table of text beside the picture, in seven digits."""
    rows = [
        {name: float(f"{value:.7g}") if isinstance(value, float) else value for name, value in row.items()}
        for row in rows
    ]
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
