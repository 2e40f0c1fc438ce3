"""The description of a figure: its sweep, how it is drawn, the paper's claims about it; and the files made of it."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from pyarrow import Table

from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import replace_file
from sim.figures.finished_runs import Runs
from sim.figures.paper_claims import Claim
from sim.figures.statistics import Interval
from sim.figures.style import applied, save, save_data


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
    caption: str
    """The caption: what is drawn, how it was run, and what can be seen."""
    draw: Callable[[Runs], Drawing]
    claims: Callable[[Runs], list[Claim]]


def point(found: Interval, **where: object) -> dict[str, Any]:
    """One row of the data file beside a picture."""
    return {**where, **found.plain()}


def render(recipe: Recipe, table: Table, folder: Path, *, variant: str = "quick") -> list[Claim]:
    """Draw a figure from the runs of a variant of its sweep, and judge its claims; returns them."""
    runs = Runs(table)
    if not runs.rows:
        raise ConfigError(f"{recipe.name}: the sweep has no run that ended well")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with applied():
            drawing = recipe.draw(runs)
            save(drawing.figure, folder, recipe.name)
        claims = recipe.claims(runs)
        save_data(drawing.data, folder / f"{recipe.name}.csv")
        about = {
            "name": recipe.name,
            "title": recipe.title,
            "caption": recipe.caption,
            "sweep": recipe.sweep,
            "variant": variant,
            "runs": len(runs.rows),
            "failed": runs.failed,
            "seeds": len({row["seed"] for row in runs.rows}),
            "code": sorted({row["code"] for row in runs.rows}),
            "runs_by_code": dict(sorted(Counter(row["code"] for row in runs.rows).items())),
            "claims": [claim.plain() for claim in claims],
        }
        replace_file(folder / f"{recipe.name}.json", f"{json.dumps(about, indent=2)}\n".encode())
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be written: {error.strerror}") from error
    except (KeyError, IndexError, TypeError, ArithmeticError) as error:  # a table that is not of this sweep
        raise ConfigError(f"{recipe.name}: cannot be drawn from this table: {error!r}") from error
    return claims
