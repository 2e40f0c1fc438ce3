"""A figure: the sweep it is made of, how it is drawn, and what the paper claims of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from sim.figures.claims import Claim
from sim.figures.runs import Runs
from sim.figures.statistics import Interval


class Drawing(NamedTuple):
    """A picture and the numbers in it."""

    figure: Figure
    data: Sequence[Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Recipe:
    """One figure: its sweep, its drawing and the claims about it."""

    name: str
    """The name of its files, for example `figure-9`."""
    title: str
    sweep: str
    """The shipped sweep that it is made of."""
    caption: str
    """What is drawn, how it was run, and what to see."""
    draw: Callable[[Runs], Drawing]
    claims: Callable[[Runs], list[Claim]] = lambda _: []


def point(found: Interval, **where: object) -> dict[str, Any]:
    """One row of the data beside a picture."""
    return {**where, "mean": found.mean, "low": found.low, "high": found.high, "seeds": found.runs}
