"""`fanet record` and `fanet log`: recordings of swarms, and what is in the folder of a run, for other tools."""

import sys
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter
from rich.table import Table

from fanet_mw.errors import ConfigError
from sim.cli.command_groups import TOOLS
from sim.cli.options import SwarmFlags, require_file_or_nothing
from sim.console import Console

if TYPE_CHECKING:
    from sim.results.result import Result

app = App(name="log", group=TOOLS, help="What the folder or the recording of a run holds, and its export.")


def record(
    file: Path,
    *,
    force: Annotated[bool, Parameter(negative="")] = False,
    quiet: Annotated[bool, Parameter(negative="")] = False,
    scenario: Path | None = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Record a swarm that runs, from now until it ends, as MCAP for Foxglove and PlotJuggler.

    Args:
        file: FILE.mcap.
        force: Replace a file that exists.
        quiet: Say nothing; a file that exists and is empty is filled.
        scenario: The scenario of the swarm, needed only if it names files (maps), which the bus does not carry.

    """
    from sim.recording.from_result import record as carry_out

    if file.suffix != ".mcap":
        raise ConfigError(f"{file}: must be a file whose name ends in .mcap")
    require_file_or_nothing(file)
    if file.exists() and not force and file.stat().st_size:
        raise ConfigError(f"{file}: exists; choose another file, or replace it with --force")
    with where.heard(scenario) as (feed, signals):
        carry_out(feed, file, ended=signals)
        if not quiet:
            lost = f"; {feed.lost} puts were lost" if feed.lost else ""
            Console().print(f"written to {file}, up to {feed.now_ns() / 1e9:.1f} s{lost}", highlight=False)
    return 0


@app.command
def info(path: Path) -> int:
    """Say what a folder of a run, or a recording (.mcap), holds.

    Args:
        path: What `fanet simulate --out` or `fanet launch --out` has written, or a file of `--record`.

    """
    from sim.recording.contents import of_folder, of_recording

    content = of_recording(path) if path.suffix == ".mcap" else of_folder(path)
    console = Console(highlight=False)
    for line in content.lines:
        console.print(line)
    table = Table(*content.columns, box=None, header_style="bold", padding=(0, 2, 0, 0))
    for row in content.rows:
        table.add_row(*row)
    console.print(table)
    return 0


@app.command
def export(
    folder: Path, *, to: str, out: Path | None = None, force: Annotated[bool, Parameter(negative="")] = False
) -> int:
    """Write a run in a format of other tools.

    Args:
        folder: What `fanet simulate --out` or `fanet launch --out` has written.
        to: The format: parquet or csv (one file per table), mcap (Foxglove, PlotJuggler), gpx (a track per UAV) or kml.
        out: The folder, or the file of a format of one file; by default FOLDER/tables, FOLDER/tracks,
            FOLDER/recording.mcap, FOLDER/tracks.kml.
        force: Replace what is there.

    """
    from sim.results.stored_result import load_result

    if to not in FORMATS:
        raise ConfigError(f"--to {to}: must be one of {', '.join(FORMATS)}")
    target, write = FORMATS[to]
    path = out or folder / target
    if out is None and path.is_symlink():
        raise ConfigError(f"{path}: is a link, which might lead anywhere; name a place by --out")
    if path.exists() and not force and (path.is_file() or any(path.glob(f"*.{to}"))):
        raise ConfigError(f"{path}: exists; choose another --out, or replace it with --force")
    console = Console(highlight=False, soft_wrap=True)
    for written, what in write(load_result(folder), folder, path).items():
        console.print(f"{written}: {what}")
    return 0


@app.command
def layout() -> int:
    """Print a layout for Foxglove (JSON): save it, and import it there under Layouts."""
    sys.stdout.write(files("sim.recording").joinpath("foxglove-layout.json").read_text("utf-8"))
    return 0


def _parquet(run: "Result", folder: Path, out: Path) -> Mapping[Path, str]:
    from sim.recording.tables import write_parquet

    return {path: f"{count:,} rows" for path, count in write_parquet(run.outcome, folder, out).items()}


def _csv(run: "Result", folder: Path, out: Path) -> Mapping[Path, str]:
    from sim.recording.tables import write_csv

    return {path: f"{count:,} rows" for path, count in write_csv(run.outcome, folder, out).items()}


def _mcap(run: "Result", _: Path, out: Path) -> Mapping[Path, str]:
    from sim.recording.from_result import write_mcap

    return {out: f"{write_mcap(run.outcome, out):,} messages"}


def _gpx(run: "Result", _: Path, out: Path) -> Mapping[Path, str]:
    from sim.recording.tracks import write_gpx

    return {path: f"{count:,} points" for path, count in write_gpx(run.outcome, out).items()}


def _kml(run: "Result", _: Path, out: Path) -> Mapping[Path, str]:
    from sim.recording.tracks import write_kml

    return {out: f"{write_kml(run.outcome, out):,} points"}


FORMATS: Final[dict[str, tuple[str, Callable[["Result", Path, Path], Mapping[Path, Any]]]]] = {
    "parquet": ("tables", _parquet),
    "csv": ("tables", _csv),
    "mcap": ("recording.mcap", _mcap),
    "gpx": ("tracks", _gpx),
    "kml": ("tracks.kml", _kml),
}
"""The formats of `fanet log export`: where each is written in the folder of the run, and by what."""
