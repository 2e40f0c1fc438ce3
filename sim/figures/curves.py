"""Figures with panels that show quantities over one setting, with a line for each case of the sweep."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from matplotlib.axes import Axes

from sim.figures.finished_runs import Quantity, Row, Runs
from sim.figures.recipe import Drawing, point
from sim.figures.statistics import Interval
from sim.figures.style import Look, beside, canvas, legend_above, line, look_of, plain_log, spaced, ticks_at

_APART: Final = 0.025
"""The distance of the marks of two lines at the same value, on a logarithmic axis: a share of that value."""
_APART_LINEAR: Final = 0.01
"""The same on a linear axis: a share of its length."""
_ROOM: Final = 0.06
"""The room that the label of a value needs on a linear axis, as a share of its length."""
_ABOVE: Final = 1.08
"""Where a linear axis ends, over the highest bar."""
_ARROW: Final = 0.09
"""The length of an arrow at what never ended, over the mark."""


class Panel(NamedTuple):
    """One pair of axes: the quantity drawn, and its label."""

    quantity: Quantity
    label: str
    """The label of the vertical axis, with its unit."""
    log: bool = False
    factor: float = 1.0
    """The factor that converts the quantity into the unit of its axis."""
    share: bool = False
    """True if the quantity lies between 0 and 1."""
    least: float = 0.0
    """The beginning of a linear axis."""
    most: float = math.inf
    """The greatest possible value, if the quantity is not a share."""
    cut: Callable[[Row], bool] | None = None
    """Whether a run ended before what is measured did, so that its value is too small."""


PDR: Final = Panel("pdr", "packet delivery ratio", share=True)
P95: Final = Panel("delay_ms.p95", "95th percentile of the delay [s]", log=True, factor=1e-3)
PAPERS: Final = "the paper's method, 8 clusters, 0.5 s"
"""The variant of the paper's method that stands beside others over load and age."""


def curves(
    setting: str,
    label: str,
    panels: Sequence[Panel],
    *,
    value: Callable[[Any], float] = float,
    linear: bool = False,
    variants: Mapping[str, str] | None = None,
) -> Callable[[Runs], Drawing]:
    """A function that draws the panels over a setting; `value` converts a value of the setting into a number on the
    horizontal axis, `variants` names the variant of a protocol that a case shows. A mark is hollow where some runs were
    cut, and has an arrow where all were.
    """

    def draw(runs: Runs) -> Drawing:
        figure, all_axes = canvas(len(panels), height=3.5)
        cases = list(dict.fromkeys(row["case"] for row in runs.rows))
        levels = sorted(runs.levels(setting), key=value)
        values = [value(level) for level in levels]
        apart = _APART_LINEAR * (values[-1] - values[0]) if linear else _APART
        data = []
        for axes, panel in zip(all_axes, panels, strict=True):
            highest = 0.0
            for number, case in enumerate(cases):
                look = look_of(case, variants or {}, number)
                at = {key: runs.of(panel.quantity, case=case, **{_column(setting): key}) for key in levels}
                found = [(value(key), one.scaled(panel.factor)) for key, one in at.items() if one.runs]
                xs = [beside(x, number, len(cases), log=not linear, apart=apart) for x, _ in found]
                line(axes, look, xs, [one for _, one in found], most=1.0 if panel.share else panel.most)
                highest = max([highest, *(min(one.high if one.runs > 1 else one.mean, panel.most) for _, one in found)])
                for (x, one), place in zip(found, xs, strict=True):
                    row = point(one, panel=panel.label, series=case, at=x)
                    if panel.cut is not None:
                        seen = [one_run for one_run in runs.where(case=case) if value(one_run[setting]) == x]
                        row["cut"] = _mark_cut(axes, look, place, one, [panel.cut(one_run) for one_run in seen])
                    data.append(row)
            if not linear:
                axes.set_xscale("log")
            ticks_at(axes.xaxis, {place: f"{place:g}" for place in (spaced(values, least=_ROOM) if linear else values)})
            axes.set_xlabel(label)
            axes.set_ylabel(panel.label)
            if panel.log:
                axes.set_yscale("log")
                plain_log(axes.yaxis)
            elif panel.share:
                axes.set_ylim(panel.least, 1.0 + 0.05 * (1.0 - panel.least))
            else:
                axes.set_ylim(panel.least, (_ABOVE + (_ARROW if panel.cut else 0.0)) * highest)
        legend_above(figure, all_axes[0])
        return Drawing(figure, data)

    return draw


def _column(setting: str) -> str:
    return setting.replace(".", "__")


def _mark_cut(axes: Axes, look: Look, x: float, found: Interval, cut: Sequence[bool]) -> float:
    """Mark a mean of which some runs were cut; returns their share."""
    share = sum(cut) / len(cut)
    if share > 0:
        axes.plot(x, found.mean, marker=look.marker, color=look.color, markerfacecolor="white", zorder=3)
    if share == 1:
        axes.annotate(
            "", (x, found.mean * (1 + _ARROW)), (x, found.mean), arrowprops={"arrowstyle": "->", "color": look.color}
        )
    return share
