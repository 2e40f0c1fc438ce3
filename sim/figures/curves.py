"""Figures that are panels of quantities over one setting, a line for each case of the sweep."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from sim.figures.recipe import Drawing, point
from sim.figures.runs import Quantity, Runs
from sim.figures.style import LOOKS, SERIES, Look, beside, canvas, legend_above, line, plain_log, ticks_at

_APART: Final = 0.025
"""The marks of two lines at one value stand so far apart, as a share of it, or of half the axis where it is linear."""


class Panel(NamedTuple):
    """One pair of axes."""

    quantity: Quantity
    label: str
    """Of the vertical axis, with its unit."""
    log: bool = False
    factor: float = 1.0
    """What the quantity is multiplied by for its unit on the axis."""
    share: bool = False
    """True for what lies between 0 and 1."""


def curves(
    setting: str,
    label: str,
    panels: Sequence[Panel],
    *,
    place: Callable[[Any], float] = float,
    log: bool = True,
) -> Callable[[Runs], Drawing]:
    """How to draw the panels over a setting; `place` says where on the horizontal axis one of its values stands."""

    def draw(runs: Runs) -> Drawing:
        figure, all_axes = canvas(len(panels), height=3.5)
        cases = list(dict.fromkeys(row["case"] for row in runs.rows))
        levels = runs.levels(setting)
        places = sorted(place(level) for level in levels)
        apart = _APART if log else _APART * (places[-1] - places[0]) / 2
        data = []
        for axes, panel in zip(all_axes, panels, strict=True):
            for number, case in enumerate(cases):
                at = {key: runs.of(panel.quantity, case=case, **{setting.replace(".", "__"): key}) for key in levels}
                found = [(place(key), one.scaled(panel.factor)) for key, one in at.items() if one.runs]
                xs = [beside(x, number, len(cases), log=log, apart=apart) for x, _ in found]
                line(axes, _look(case, number), xs, [one for _, one in found], most=1.0 if panel.share else math.inf)
                data += [point(one, panel=panel.label, series=case, at=x) for x, one in found]
            if log:
                axes.set_xscale("log")
            ticks_at(axes.xaxis, {x: f"{x:g}" for x in places})
            axes.set_xlabel(label)
            axes.set_ylabel(panel.label)
            if panel.log:
                axes.set_yscale("log")
                plain_log(axes.yaxis)
            else:
                axes.set_ylim(0, 1.05 if panel.share else None)
        legend_above(figure, all_axes[0])
        return Drawing(figure, data)

    return draw


def _look(case: str, number: int) -> Look:
    """A protocol has its look in all figures; other cases have theirs by their order."""
    return LOOKS[case] if case in LOOKS else SERIES[number % len(SERIES)]._replace(label=case)
