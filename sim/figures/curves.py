"""Figures that are panels of quantities over one setting, a line for each case of the sweep."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from sim.figures.recipe import Drawing, point
from sim.figures.runs import Quantity, Runs
from sim.figures.style import LOOKS, SERIES, Look, beside, canvas, legend_above, line, plain_log, ticks_at

_APART: Final = 0.025
"""The marks of two lines at one value stand so far apart: as a share of it, or of the way to the next value."""


class Panel(NamedTuple):
    """One pair of axes: the quantity drawn, and its label."""

    quantity: Quantity
    label: str
    """The label of the vertical axis, with its unit."""
    log: bool = False
    factor: float = 1.0
    """What the quantity is multiplied by for its unit on the axis."""
    share: bool = False
    """True for what lies between 0 and 1."""
    least: float = 0.0
    """Where a linear axis begins."""
    most: float = math.inf
    """The greatest value that there can be, if it is no share."""


def curves(
    setting: str,
    label: str,
    panels: Sequence[Panel],
    *,
    value: Callable[[Any], float] = float,
    even: bool = False,
) -> Callable[[Runs], Drawing]:
    """How to draw the panels over a setting; `value` says what number on the horizontal axis one of its values is.

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
    """A protocol has its look in all figures; other cases have theirs by their order."""
    return LOOKS[case] if case in LOOKS else SERIES[number % len(SERIES)]._replace(label=case)
