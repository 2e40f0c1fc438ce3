"""`fanet figures` and `fanet report`: recreate the paper's evaluation by shipped sweeps, with a
verdict on each claim.
"""

import shlex
from collections import Counter
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number
from rich.text import Text

from fanet_mw.errors import ConfigError
from sim.cli.sweep import carry_out, runs_of_other_code
from sim.console import Console, table


def figures(
    *which: str,
    quick: Annotated[bool, Parameter(negative="")] = False,
    full: Annotated[bool, Parameter(negative="")] = False,
    out: Path = Path("figures"),
    jobs: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    scheduler: str | None = None,
    retry: Annotated[bool, Parameter(negative="")] = False,
    rerun_older: Annotated[bool, Parameter(negative="")] = False,
    draw_only: Annotated[bool, Parameter(negative="")] = False,
    kept: Path | None = None,
) -> int:
    """Recreate the paper's figures 8 to 12, and figures beyond it, and say which of its claims hold.

    Runs that are finished in the folder are not repeated; an interrupted command goes on where it was.

    Args:
        which: 8, 9, 10, 11, 12, load, size, clocks, age, ablation, reports, mission, realtime, or all, the default.
        quick: Few seeds and short runs, all figures within 15 minutes on two cores; the default.
        full: 10 seeds and long runs: hours.
        out: Folder for the figures (PNG, SVG, CSV, verdicts as JSON) and, under sweeps/, the runs.
        jobs: Processes of this machine; by default one per core.
        scheduler: A Dask scheduler whose workers carry out the runs.
        retry: Repeat runs that failed, among them those in real time for which the machine was too busy.
        rerun_older: Repeat runs that code other than the present one has finished, so that each figure is of one code.
        draw_only: Draw from the runs that are finished, and run nothing.
        kept: With --draw-only: a folder of kept tables of sweeps, for example docs/results/sweeps; those are drawn
            alone.

    """
    from sim.figures.all_figures import chosen
    from sim.figures.finished_runs import read_kept
    from sim.figures.paper_claims import BEYOND
    from sim.figures.recipe import render
    from sim.results.run_table import read
    from sim.sweep import spec

    if quick and full:
        raise ConfigError("--quick and --full exclude each other")
    if rerun_older and draw_only:
        raise ConfigError("--rerun-older and --draw-only exclude each other: --draw-only runs nothing")
    if kept is not None and not draw_only:
        raise ConfigError("--kept is for --draw-only: kept tables are drawn, and never added to")
    variant = "full" if full else "quick"
    verdicts = []
    missing: list[str] = []
    notices: list[str] = []
    code = 0
    for recipe in chosen(which):
        runs = out / "sweeps" / f"{recipe.sweep}-{variant}"
        if not draw_only:
            found = spec.find(recipe.sweep).variant(variant)
            code |= carry_out(
                recipe.sweep, found, out=runs, jobs=jobs, scheduler=scheduler, retry=retry,
                rerun_older=rerun_older,
            )  # fmt: skip
        results = read(runs) if kept is None else read_kept(kept, recipe.sweep, variant)
        if results is None:
            missing.append(recipe.sweep)
            continue
        if draw_only and (others := runs_of_other_code(Counter(results.column("code").to_pylist()))):
            notices.append(f"{recipe.name}: {others}")
        verdicts += [(recipe.name, claim) for claim in render(recipe, results, out, variant=variant)]
    console = Console()
    shown = table(("figure", "claim", "verdict"))
    for name, claim in verdicts:
        shown.add_row(name, claim.claim if claim.figure else f"{BEYOND}{claim.claim}", claim.verdict.value)
        for statement in claim.statements:
            shown.add_row("", Text(statement.text(), style="dim"), "")
    console.print(shown)
    for notice in notices:
        console.print(notice, highlight=False, soft_wrap=True)
    if missing:
        console.print(f"not drawn, because {kept} has no table of it: {', '.join(missing)}", highlight=False)
        code = 1
    console.print(
        f"figures, data and verdicts in {out}; fanet report {shlex.quote(str(out))} makes a page of them",
        highlight=False,
    )
    return code


def report(*folders: Path, out: Path | None = None) -> int:
    """Make one page of figures and verdicts: report.html, which needs nothing else, and report.md.

    Args:
        folders: Folders of `fanet figures`, and of single runs (`fanet simulate --out`).
        out: Folder for the page; by default the first of the folders.

    """
    from sim.report.page import write

    if not folders:
        raise ConfigError("fanet report: needs at least one folder")
    paths = write(folders, out or folders[0])
    Console().print(f"written: {', '.join(map(str, paths))}", highlight=False, soft_wrap=True)
    return 0
