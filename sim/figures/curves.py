"""Figures with panels that show quantities over one setting, with a line for each case of the sweep."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from sim.figures.recipe import Drawing, point
from sim.figures.runs import Quantity, Runs
from sim.figures.style import LOOKS, SERIES, Look, beside, canvas, legend_above, line, plain_log, ticks_at

_APART: Final = 0.025
"""The distance of the marks of two lines at the same value: a share of that value, or of the step to the next one."""


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


def curves(
    setting: str,
    label: str,
    panels: Sequence[Panel],
    *,
    value: Callable[[Any], float] = float,
    even: bool = False,
) -> Callable[[Runs], Drawing]:
    """A function that draws the panels over a setting; `value` converts a value of the setting into a number on the
    horizontal axis.

    The axis is logarithmic, or `even`: then neighboring values are equally far apart, whatever they are.
    """

    def draw(runs: Runs) -> Drawing:
        figure, all_axes = canvas(len(panels), height=3.5)
        cases = list(dict.fromkeys(row["case"] for row in runs.rows))
        levels = sorted(runs.levels(setting), key=value)
        places = {value(level): float(rank) if even else value(level) for rank, level in enumerate(levels)}
        data = []
        for axes, panel in zip(all_axes, panels, strict=True):
            for number, case in enumerate(cases):
                at = {key: runs.of(panel.quantity, case=case, **{setting.replace(".", "__"): key}) for key in levels}
                found = [(value(key), one.scaled(panel.factor)) for key, one in at.items() if one.runs]
                xs = [beside(places[x], number, len(cases), log=not even, apart=_APART) for x, _ in found]
                line(axes, _look(case, number), xs, [one for _, one in found], most=1.0 if panel.share else panel.most)
                data += [point(one, panel=panel.label, series=case, at=x) for x, one in found]
            if not even:
                axes.set_xscale("log")
            ticks_at(axes.xaxis, {place: f"{x:g}" for x, place in places.items()})
            axes.set_xlabel(label)
            axes.set_ylabel(panel.label)
            if panel.log:
                axes.set_yscale("log")
                plain_log(axes.yaxis)
            elif panel.share:
                axes.set_ylim(panel.least, 1.0 + 0.05 * (1.0 - panel.least))
            else:
                axes.set_ylim(bottom=panel.least)
        legend_above(figure, all_axes[0])
        return Drawing(figure, data)

    return draw


def _look(case: str, number: int) -> Look:
    """The look of a line: that of a protocol is the same in all figures; other cases get theirs by their order."""
    return LOOKS[case] if case in LOOKS else SERIES[number % len(SERIES)]._replace(label=case)
