"""The page of the paper's claims is what the figures kept beside it say."""

import csv
import json
import math
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from kept_values import kept as remembered
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.figure import Figure
from test_documents import ROOT

from sim.figures.all_figures import FIGURES
from sim.figures.finished_runs import Runs, read_kept
from sim.figures.recipe import Recipe
from sim.figures.style import save_data

PICTURES = ROOT / "docs" / "results" / "pictures"
KEPT = {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(PICTURES.glob("*.json"))}


def test_the_page_is_what_the_kept_verdicts_say() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "generate_paper_page.py"))
    assert script["main"](["--check"]) == 0


@pytest.mark.parametrize("name", KEPT)
def test_every_kept_figure_has_its_picture_and_its_numbers(name: str) -> None:
    assert name in {recipe.name for recipe in FIGURES.values()}
    assert (PICTURES / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    with (PICTURES / f"{name}.csv").open() as file:
        assert sum(1 for _ in csv.DictReader(file)) > 1
    assert KEPT[name]["failed"] == 0


def kept(name: str, *, seeds: int = 10) -> tuple[Recipe, Runs]:
    (recipe,) = [recipe for recipe in FIGURES.values() if recipe.name == name]
    table = read_kept(ROOT / "docs" / "results" / "sweeps", recipe.sweep, KEPT[name]["variant"])
    assert table is not None
    return recipe, Runs(table.filter([seed <= seeds for seed in table.column("seed").to_pylist()]))


def numbers_in(axes: Axes) -> set[float]:
    """Where the lines, bars and marks of a panel are."""
    found = [*(number for line in axes.lines for number in (*line.get_xdata(), *line.get_ydata()))]
    bars = [bar for bars in axes.containers if isinstance(bars, BarContainer) for bar in bars.patches]
    return {round(float(number), 7) for number in (*found, *(bar.get_width() for bar in bars))}


def untied(numbers: Any) -> Any:
    """Numbers of which none, as a mean of decimals may, lies where the last bit says how it is rounded."""
    return np.asarray(numbers, dtype=float) * (1 + 1e-9)


def axis_of(axis: Axis) -> list[Any]:
    """Its scale and ends, and what stands at which places between them."""
    ends = sorted(axis.get_view_interval())
    ticks = [place for place in axis.get_major_locator()() if ends[0] <= place <= ends[1]]
    texts = [axis.get_major_formatter()(place) for place in ticks]
    return [axis.get_scale(), axis.get_label_text(), untied(ends), list(zip(ticks, texts, strict=True))]


def seen_in(figure: Figure) -> Iterator[Any]:
    """What tells something in a picture: axes, words, lines and marks, and areas, with their colors; no looks."""
    for legend in figure.legends:
        yield [text.get_text() for text in legend.get_texts()]
    for axes in figure.axes:
        yield axes.get_title(), axis_of(axes.xaxis), axis_of(axes.yaxis)
        yield [(text.get_text(), text.get_position()) for text in axes.texts if text.get_visible()]
        for line in axes.lines:
            look = to_hex(line.get_color()), line.get_marker(), line.get_linestyle(), to_hex(line.get_markerfacecolor())
            yield line.get_label(), look, untied(line.get_xdata()), untied(line.get_ydata())
        for area in axes.collections:
            yield type(area).__name__, [untied(path.vertices) for path in area.get_paths()]
        for patch in axes.patches:
            yield (
                to_hex(patch.get_facecolor()),
                untied(patch.get_patch_transform().transform(patch.get_path().vertices)),
            )


def worded(plain: Any) -> Any:
    """Without the last digits of means and intervals, which its texts leave out: they may be those of a machine."""
    if isinstance(plain, dict):
        return {key: worded(value) for key, value in plain.items() if key not in ("mean", "low", "high")}
    return [worded(part) for part in plain] if isinstance(plain, list) else plain


@pytest.mark.parametrize("name", KEPT)
def test_every_kept_claim_is_that_of_the_kept_table(name: str) -> None:
    """With its statements, their limits and figures, and its reasons."""
    recipe, runs = kept(name)
    found = [claim.plain() for claim in recipe.claims(runs)]
    assert [worded(claim) for claim in found] == [worded(claim) for claim in KEPT[name]["claims"]]


@pytest.mark.parametrize("name", KEPT)
def test_every_kept_picture_is_of_the_kept_table(name: str, tmp_path: Path) -> None:
    """Its numbers, each of which is in some panel; and all that one sees of it is what it was."""
    recipe, runs = kept(name)
    drawing = recipe.draw(runs)
    save_data(drawing.data, tmp_path / "drawn.csv")
    assert (tmp_path / "drawn.csv").read_text() == (PICTURES / f"{name}.csv").read_text()
    drawn = set().union(*map(numbers_in, drawing.figure.axes))
    assert [row for row in drawing.data if not math.isnan(row["mean"]) and round(row["mean"], 7) not in drawn] == []
    remembered(f"picture, {name}", seen_in(drawing.figure))


@pytest.mark.parametrize("name", KEPT)
def test_bars_of_few_seeds_end_where_a_quantity_does(name: str) -> None:
    """The interval of two shares reaches far beyond 1, and below 0."""
    recipe, runs = kept(name, seeds=2)
    drawing = recipe.draw(runs)
    with (PICTURES / f"{name}.csv").open() as file:
        assert len(drawing.data) == sum(1 for _ in csv.DictReader(file))
    for axes in drawing.figure.axes:
        low, high = axes.get_ylim()
        lines = [lines for lines in axes.containers if isinstance(lines, ErrorbarContainer)]
        bars = [bar.tolist() for found in lines for all_bars in found.lines[2] for bar in all_bars.get_segments()]
        ends = [end for (left, begin), (right, end) in bars if left == right and begin != end for end in (begin, end)]
        highest = 1.0 if (low, high) == (0, 1.05) else math.inf
        assert all(0 <= end <= highest for end in ends), axes.get_title()


@pytest.mark.parametrize(
    ("few", "many", "rest", "verdicts"),
    [
        (0.9, 0.3, 0.3, ["agrees", "agrees", "agrees"]),
        (0.3, 0.9, 0.9, ["differs", "agrees", "agrees"]),
        (0.9, 0.3, 0.9, ["agrees", "agrees", "partly"]),
    ],
)
def test_figure_9_is_judged_by_who_flies_in_formation_beside_who_is_at_rest(
    few: float, many: float, rest: float, verdicts: list[str]
) -> None:
    """The PDR falls or rises; at rest it may be another; only what is lost in flight is lost to collisions."""
    common = {"status": "ok", "code": "", "traffic.interval_s": 1.0}
    lost = {"formation": (9, 1), "at rest": (1, 9)}
    rows = [
        {
            **common, "case": case, "seed": seed, "traffic.sources": sources, "pdr": pdr + seed / 1000,
            "copies.lost.collision": lost[case][0], "copies.lost.busy": lost[case][1],
        }
        for case, last in (("formation", many), ("at rest", rest))
        for sources, pdr in ((1, few), (44, last))
        for seed in range(5)
    ]  # fmt: skip
    found = FIGURES["9"].claims(Runs(pa.Table.from_pylist(rows)))
    assert [claim.verdict for claim in found] == verdicts


@pytest.mark.parametrize("name", KEPT)
def test_where_a_kept_verdict_differs_from_the_paper_a_reason_is_shown(name: str) -> None:
    for claim in KEPT[name]["claims"]:
        assert claim["verdict"] != "differs" or any(reason["shown"] for reason in claim["reasons"]), claim["claim"]
