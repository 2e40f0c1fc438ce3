"""All figures, by the names that `fanet figures` accepts."""

from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.errors import ConfigError
from sim.figures import ablation, beyond_paper, figure8, figure9, figure10, figure11, figure12, realtime, rescue
from sim.figures.recipe import Recipe

FIGURES: Final[Mapping[str, Recipe]] = {
    "8": figure8.FIGURE,
    "9": figure9.FIGURE,
    "10": figure10.FIGURE,
    "11": figure11.FIGURE,
    "12": figure12.FIGURE,
    "load": beyond_paper.LOAD,
    "size": beyond_paper.SIZE,
    "clocks": beyond_paper.CLOCKS,
    "age": beyond_paper.AGE,
    "ablation": ablation.FIGURE,
    "reports": rescue.REPORTS,
    "mission": rescue.MISSION,
    "realtime": realtime.REALTIME,
}


def chosen(names: Sequence[str]) -> list[Recipe]:
    """The figures of these names, each once; raises ConfigError for a name that does not exist."""
    wanted = [name for given in names or ("all",) for name in (FIGURES if given == "all" else (given,))]
    for name in wanted:
        if name not in FIGURES:
            raise ConfigError(f"figure {name!r}: must be one of {', '.join(FIGURES)}, or all")
    return [FIGURES[name] for name in dict.fromkeys(wanted)]
