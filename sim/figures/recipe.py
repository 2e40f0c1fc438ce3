"""The description of a figure: its sweep, how it is drawn, and the paper's claims about it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from sim.figures.finished_runs import Runs
from sim.figures.paper_claims import Claim
from sim.figures.statistics import Interval


class Drawing(NamedTuple):
    """A picture and its numbers."""

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
    """The caption: what is drawn, how it was run, and what can be seen."""
    draw: Callable[[Runs], Drawing]
    claims: Callable[[Runs], list[Claim]] = lambda _: []


def point(found: Interval, **where: object) -> dict[str, Any]:
    """One row of the data file beside a picture."""
    return {**where, "mean": found.mean, "low": found.low, "high": found.high, "seeds": found.runs}
