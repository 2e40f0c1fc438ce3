"""The common style of all figures: sizes, lines and colors that can be distinguished by the color-blind and in print.

The colors are in `colors.py`. No line differs from others by its color alone: each has a marker and a
dash pattern of its own.
"""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from fanet_mw.whole_file import replace_file
from sim.figures.colors import BLUE, GRAY, GREEN, ORANGE, PINK, RED
from sim.figures.statistics import Interval


class Look(NamedTuple):
    """The look of one line, in all figures that have it."""

    label: str
    color: str
    marker: str
    dash: str | tuple[int, tuple[int, ...]]


CONTROL: Final = "flooding, cw_min 1"
"""The case that floods with the contention window of the timetable's runs: it tells what the window makes of them."""
LOOKS: Final[Mapping[str, Look]] = {
    "ours": Look("fanet-mw", BLUE, "o", "-"),
    "paper": Look("the paper's method", RED, "s", "--"),
    "flooding": Look("plain flooding", GREEN, "^", "-."),
    "aodv": Look("AODV", PINK, "D", (0, (5, 1))),
    "olsr": Look("OLSR", ORANGE, "v", (0, (3, 1, 1, 1))),
    "gossip": Look("gossip", PINK, "D", (0, (5, 1))),
    "counter": Look("counter-based", ORANGE, "v", (0, (3, 1, 1, 1))),
    CONTROL: Look("plain flooding, cw_min 1", GRAY, "x", (0, (2, 1))),
    "limit": Look("a path exists", "#000000", "", (0, (1, 2))),
}
SERIES: Final = (
    Look("", BLUE, "o", "-"),
    Look("", RED, "s", "--"),
    Look("", GREEN, "^", "-."),
    Look("", PINK, "D", (0, (5, 1))),
    Look("", ORANGE, "v", (0, (3, 1, 1, 1))),
)
"""The looks of lines for the values of a setting, in their order."""

_LONG_AXIS: Final = 2_000.0
"""The labels of an axis whose ends differ by a greater factor than this are decades."""
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


def look_of(case: str, variants: Mapping[str, str], number: int = 0) -> Look:
    """The look of a case: of a protocol the same in all figures, which name its variant; of others by their order."""
    look = LOOKS[case] if case in LOOKS else SERIES[number % len(SERIES)]._replace(label=case)
    return look._replace(label=variants.get(case, look.label))


def applied() -> AbstractContextManager[None]:
    """The style, for what is drawn and saved within the context."""
    return mpl.rc_context(dict(_PARAMETERS))


def canvas(
    columns: int = 1, rows: int = 1, *, width: float = 4.2, height: float = 3.2, share_y: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure with this number of panels, in reading order."""
    figure = Figure(figsize=(width * columns, height * rows), layout=ConstrainedLayoutEngine(w_pad=0.12))
    panels = figure.subplots(rows, columns, squeeze=False, sharey=share_y)
    return figure, list(panels.flat)


def line(
    axes: Axes,
    look: Look,
    xs: Sequence[float],
    intervals: Sequence[Interval],
    *,
    most: float = math.inf,
) -> None:
    """Means with their intervals, as one line; bars end at 0 and the greatest possible value."""
    axes.errorbar(
        xs, [item.mean for item in intervals], yerr=reaches(intervals, most=most), label=look.label,
        color=look.color, marker=look.marker or None, linestyle=look.dash, elinewidth=1.0,
    )  # fmt: skip


def crosses(axes: Axes, look: Look, points: Sequence[tuple[float, float]]) -> None:
    """Points of the same setting at rest, beside a line of it in motion."""
    axes.plot(
        [x for x, _ in points], [y for _, y in points],
        color=look.color, linestyle="none", marker="x", markersize=7, markeredgewidth=1.6, zorder=5,
    )  # fmt: skip


def reaches(intervals: Sequence[Interval], *, most: float = math.inf) -> tuple[list[float], list[float]]:
    """How far the bars of these means reach down and up, within possible values; a single run has no bar."""
    down = [0.0 if item.runs < 2 else item.mean - max(0.0, item.low) for item in intervals]
    up = [0.0 if item.runs < 2 else min(most, item.high) - item.mean for item in intervals]
    return down, up


def beside(place: float, number: int, of: int, *, log: bool, apart: float) -> float:
    """The position of several marks; `apart`: to the next one, a difference, or a share on a logarithmic axis."""
    steps = number - (of - 1) / 2
    return place * math.pow(1 + apart, steps) if log else place + apart * steps


def ticks_at(axis: Axis, places: Mapping[float, str]) -> None:
    """Put ticks where something was measured, and nowhere else."""
    axis.set_major_locator(FixedLocator(list(places)))
    axis.set_major_formatter(FuncFormatter(lambda at, _: places[min(places, key=lambda place: abs(place - at))]))
    axis.set_minor_locator(NullLocator())


def spaced(places: Sequence[float], *, least: float = 0.04) -> list[float]:
    """The places whose labels have room on a linear axis: at least this share of its length apart."""
    kept = list(places[:1])
    for place in places[1:]:
        if place - kept[-1] >= least * (places[-1] - places[0]):
            kept.append(place)
    return kept


def plain_log(axis: Axis) -> None:
    """A logarithmic axis with plain numbers: 1, 2, 5, 10, 20 and so on, or only decades if it is long."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < _LONG_AXIS else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda at, _: f"{at:g}"))
    axis.set_minor_locator(NullLocator())


def legend_above(figure: Figure, axes: Axes) -> None:
    """One legend for all panels, above them, where it covers nothing; in as many rows as it needs to be seen whole."""
    handles, labels = axes.get_legend_handles_labels()
    for rows in range(1, len(labels) + 1):
        legend = figure.legend(handles, labels, loc="outside upper center", ncols=math.ceil(len(labels) / rows))
        if legend.get_window_extent().width <= figure.bbox.width or rows == len(labels):
            break
        legend.remove()


def band(axes: Axes, look: Look, xs: Sequence[float], shares: Sequence[Interval]) -> None:
    """The intervals of a line of shares as a band; there is none where a mean is of one run."""
    if all(item.runs > 1 for item in shares):
        low, high = [max(0.0, item.low) for item in shares], [min(1.0, item.high) for item in shares]
        axes.fill_between(xs, low, high, color=look.color, alpha=0.15, linewidth=0)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write PNG and SVG; the same figure always gives the same bytes."""
    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    for path, unnamed in zip(paths, ("Software", "Date"), strict=True):
        content = BytesIO()
        figure.savefig(content, format=path.suffix[1:], metadata={unnamed: None})
        replace_file(path, content.getvalue())
    return paths


def save_data(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write the drawn numbers as a text table beside the picture, with seven digits."""
    rows = [
        {name: float(f"{value:.7g}") if isinstance(value, float) else value for name, value in row.items()}
        for row in rows
    ]
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    replace_file(path, text.getvalue().encode())
