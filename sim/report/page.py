"""The page of an evaluation: its settings beside the paper's, and each figure with claims, findings, verdicts and
commands.
"""

import os
import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import json_of, read_regular
from fanet_mw.whole_file import replace_file
from sim.figures.paper_claims import BEYOND
from sim.report.html import Block, Commands, Heading, Picture, Rows, Text, as_html, as_markdown
from sim.report.run_page import blocks_of_run
from sim.results.run_folder import checked, holds_run

_TITLE: Final = "Reliable Flying IoT Networks for UAV Disaster Rescue Operations, recreated"
_ORDER: Final = (
    "figure-8", "figure-9", "figure-10", "figure-11", "figure-12", "load", "size", "clocks", "age", "ablation",
    "reports", "mission", "realtime",
)  # fmt: skip
_HEAD: Final = ("quantity", "the paper", "here", "why it differs")
Sentence = Annotated[str, Field(max_length=10_000)]
Word = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.+-]{1,64}$")]


class _FigureShape(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class _FigureStatement(_FigureShape):
    text: Sentence


class _FigureReason(_FigureShape):
    text: Sentence
    shown: bool
    set_afterwards: Sentence = ""
    statements: list[_FigureStatement]


class _FigureClaim(_FigureShape):
    figure: int
    claim: Sentence
    verdict: Literal["agrees", "partly", "differs"]
    statements: list[_FigureStatement]
    reasons: list[_FigureReason]


class _FigureAbout(_FigureShape):
    """The file of one figure."""

    name: Word
    title: Sentence
    caption: Sentence
    sweep: Word
    variant: Word
    runs: int
    failed: int
    seeds: int
    code: list[Word]
    runs_by_code: dict[Word, int] = {}
    claims: list[_FigureClaim]


Figure = tuple[Path, dict[str, Any]]
"""The folder of a figure, and what `fanet figures` has written about it."""
_COLUMNS: Final = ("claim", "findings", "verdict", "why")
"""The columns of the table of claims; the last one is left out if no claim needs a reason."""


def write(folders: Sequence[Path], out: Path) -> list[Path]:
    for folder in folders:
        if folder.exists() and not folder.is_dir():
            raise ConfigError(f"{folder}: a file, and no folder of figures (fanet figures) or of a run (--out)")
    try:
        out.mkdir(parents=True, exist_ok=True)
        title, blocks = _blocks(folders, out)
        pages = {out / "report.html": as_html(title, blocks), out / "report.md": as_markdown(title, blocks, out)}
        for path, text in pages.items():
            replace_file(path, text.encode(errors="backslashreplace"))  # a path may be no text
    except OSError as error:
        raise ConfigError(f"{error.filename or out}: {error.strerror}") from error
    return list(pages)


def _blocks(folders: Sequence[Path], out: Path) -> tuple[str, list[Block]]:
    figures = figures_of(folders)
    runs = [folder for folder in folders if holds_run(folder)]
    for folder in folders:
        if folder not in runs and not _figures(folder):
            sweep = (
                ", but a sweep, whose table fanet_mw.results.read gives"
                if os.path.lexists(folder / "runs.parquet")
                else ""
            )
            raise ConfigError(
                f"{folder}: holds neither figures (fanet figures) nor a run (fanet simulate --out){sweep}"
            )
    blocks: list[Block] = []
    if figures:
        blocks += overview(figures)
        for page in figure_pages(figures):
            blocks += [Heading(page.title), *page.blocks]
        blocks += commands(figures)
    for folder in runs:
        blocks += blocks_of_run(folder, out)
    return _TITLE if figures else "Runs" if len(runs) > 1 else "A run", blocks


class FigurePage(NamedTuple):
    """The blocks about one figure."""

    name: str
    title: str
    blocks: list[Block]


def figures_of(folders: Sequence[Path]) -> list[Figure]:
    return [found for folder in folders for found in _figures(folder)]


def figure_pages(figures: Sequence[Figure]) -> list[FigurePage]:
    """Each figure with its claims."""
    return [FigurePage(about["name"], _title(about), _figure(folder, about)) for folder, about in figures]


def _figures(folder: Path) -> list[Figure]:
    """The figures that `fanet figures` has left in a folder, in the order of the paper."""
    names = [name for name in _ORDER if all(os.path.lexists(folder / f"{name}.{kind}") for kind in ("json", "png"))]
    return [(folder, _about(folder / f"{name}.json")) for name in names]


def _about(path: Path) -> dict[str, Any]:
    """What `fanet figures` has written about one figure; raises ConfigError."""
    about: dict[str, Any] = json_of(read_regular(path, follow=False), source=str(path))
    if checked(TypeAdapter(_FigureAbout), about, path).name != path.stem:
        raise ConfigError(f"{path}: is about another figure, {about['name']}")
    return about


def overview(figures: Sequence[Figure]) -> list[Block]:
    """The verdicts, and the settings of the paper beside those here."""
    claims = [(about["name"], claim) for _, about in figures for claim in about["claims"]]
    papers = [(str(one["figure"]), one["claim"], one["verdict"]) for _, one in claims if one["figure"]]
    ours = [(name, one["claim"], one["verdict"]) for name, one in claims if not one["figure"]]
    counts = [sum(verdict == wanted for _, _, verdict in papers) for wanted in ("agrees", "partly", "differs")]
    blocks: list[Block] = [
        Text(
            f"Of {len(papers)} claims: {counts[0]} agree, {counts[1]} partly, {counts[2]} differ. "
            "Each verdict is made by code: a claim is one or more quantities with a threshold each; it agrees when the "
            "whole 95 % interval of every quantity is on the claimed side, differs when every one is wholly on the "
            "other side, and is partly so otherwise."
        ),
        Rows(("figure", "claim", "verdict"), papers),
    ]
    if ours:
        blocks.append(Text("Beyond the paper, what might be said of fanet-mw, judged in the same way:"))
        blocks.append(Rows(("figure", "statement", "verdict"), ours))
    blocks.append(Heading("Settings"))
    settings = files("sim.report").joinpath("paper_settings.toml").read_text(encoding="utf-8")
    for table in tomllib.loads(settings)["tables"]:
        blocks += [Heading(table["title"], 3), Rows(_HEAD, table["rows"])]
    return blocks


def _figure(folder: Path, about: dict[str, Any]) -> list[Block]:
    rows = [
        (
            claim["claim"] if claim["figure"] else f"{BEYOND}{claim['claim']}",
            "\n".join(one["text"] for one in claim["statements"]),
            claim["verdict"],
            "\n".join(map(_reason, claim["reasons"])),
        )
        for claim in about["claims"]
    ]
    columns = len(_COLUMNS) if any(why for *_, why in rows) else len(_COLUMNS) - 1
    failed = f", {about['failed']} runs failed and are left out" if about["failed"] else ""
    made = f"Variant {about['variant']}: {about['runs']} runs, {about['seeds']} seeds{failed}"
    blocks: list[Block] = [
        Picture(folder / f"{about['name']}.png", about["caption"]),
        Text(f"{made}; {_made_by(about)}"),
    ]
    if rows:
        blocks.append(Rows(_COLUMNS[:columns], [row[:columns] for row in rows]))
    return blocks


def _made_by(about: Mapping[str, Any]) -> str:
    """The code of the runs; where it is not one, how many runs each has made, and how to have all of one."""
    codes: Sequence[str] = about["code"]
    if len(codes) == 1:
        return f"code {codes[0]}."
    counts: Mapping[str, int] = about.get("runs_by_code", {})  # figures drawn by earlier versions have none
    named = ", ".join(f"{code} ({counts[code]} runs)" if code in counts else code for code in codes)
    which = about["name"].removeprefix("figure-")
    again = f"fanet figures {which} --{about['variant']} --rerun-older"
    return f"the runs are of {len(codes)} codes: {named}. `{again}` makes them of one."


def _title(about: Mapping[str, Any]) -> str:
    name: str = about["name"]
    title: str = about["title"]
    return f"{name.capitalize().replace('-', ' ')}: {title}" if name.startswith("figure") else title


def _reason(reason: Mapping[str, Any]) -> str:
    """The reason of a verdict, with the experiment that shows it; what the runs do not show is marked as not shown."""
    evidence = "; ".join(one["text"] for one in reason["statements"])
    doubt = "" if reason["shown"] else "Supposed, but not shown by these runs: "
    chosen = reason.get("set_afterwards")
    return f"{doubt}{reason['text']} ({evidence}.){f' Set after such runs had been seen: {chosen}' if chosen else ''}"


def commands(figures: Sequence[Figure]) -> list[Block]:
    lines = [
        "fanet figures all --quick --out figures",
        "fanet figures all --full --out figures",
        "fanet report figures",
    ]
    lines += [
        f"fanet sweep {about['sweep']} --variant {about['variant']}    # the runs of {about['name']}"
        for _, about in figures
    ]
    return [
        Heading("Commands"),
        Commands(lines),
        Rows(
            ("figure", "variant", "runs", "seeds", "code"),
            [
                (about["name"], about["variant"], str(about["runs"]), str(about["seeds"]), ", ".join(about["code"]))
                for _, about in figures
            ],
        ),
        Text(
            "The code of a figure is the version and a digest of the sources on which its rows depend. "
            "Every row of a sweep's runs.parquet has the command that repeats its run alone. Beside each picture are "
            "the numbers in it (CSV), an SVG, and the verdicts as JSON."
        ),
    ]
