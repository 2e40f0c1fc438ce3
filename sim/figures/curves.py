"""Figures that are panels of quantities over one setting, a line for each case of the sweep."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from sim.figures.recipe import Drawing, point
from sim.figures.runs import Quantity, Runs
from sim.figures.style import LOOKS, SERIES, Look, canvas, line


class Panel(NamedTuple):
    """One pair of axes."""

    quantity: Quantity
    label: str
    """Of the vertical axis, with its unit."""
    log: bool = False


def curves(
    setting: str,
    label: str,
    panels: Sequence[Panel],
    *,
    place: Callable[[float], float] = float,
    log: bool = True,
) -> Callable[[Runs], Drawing]:
    """How to draw the panels over a setting; `place` says where on the horizontal axis one of its values stands."""

    def draw(runs: Runs) -> Drawing:
        figure, all_axes = canvas(len(panels), height=3.5)
        cases = list(dict.fromkeys(row["case"] for row in runs.rows))
        levels = runs.levels(setting)
        data = []
        for axes, panel in zip(all_axes, panels, strict=True):
            for number, case in enumerate(cases):
                found = [runs.of(panel.quantity, case=case, **{setting.replace(".", "__"): level}) for level in levels]
                line(axes, _look(case, number), [place(level) for level in levels], found)
                data += [
                    point(one, panel=panel.label, series=case, at=place(level))
                    for one, level in zip(found, levels, strict=True)
                ]
            if log:
                axes.set_xscale("log")
            axes.set_xlabel(label)
            axes.set_ylabel(panel.label)
            if panel.log:
                axes.set_yscale("log")
            else:
                axes.set_ylim(bottom=0)
        handles, labels = all_axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return Drawing(figure, data)

    return draw


def _look(case: str, number: int) -> Look:
    """A protocol has its look in all figures; other cases have theirs by their order."""
    return LOOKS[case] if case in LOOKS else SERIES[number % len(SERIES)]._replace(label=case)
