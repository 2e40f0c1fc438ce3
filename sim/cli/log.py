"""`fanet record` and `fanet log`: recordings of swarms, and what is in the folder of a run, for other tools."""

import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import App, Parameter

from fanet_mw.errors import ConfigError
from sim.cli.options import TOOLS, SwarmFlags, require_file_or_nothing
from sim.console import Console, table

if TYPE_CHECKING:
    from sim.results.result import Result

_TARGETS: Final = {
    "parquet": "tables", "csv": "tables", "mcap": "recording.mcap", "gpx": "tracks", "kml": "tracks.kml",
}  # fmt: skip
"""The formats of `fanet log export`, and where each is written in the folder of the run."""
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
        force: Replace a file that exists and is not empty.
        quiet: Say nothing.
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
    console.print(table(content.columns, content.rows))
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
    from sim.results.result import load_result

    if to not in _TARGETS:
        raise ConfigError(f"--to {to}: must be one of {', '.join(_TARGETS)}")
    path = out or folder / _TARGETS[to]
    if out is None and path.is_symlink():
        raise ConfigError(f"{path}: is a link, which might lead anywhere; name a place by --out")
    if path.exists() and not force and (path.is_file() or any(path.glob(f"*.{to}"))):
        raise ConfigError(f"{path}: exists; choose another --out, or replace it with --force")
    console = Console(highlight=False, soft_wrap=True)
    for written, what in _written(to, load_result(folder), folder, path).items():
        console.print(f"{written}: {what}")
    return 0


@app.command
def layout() -> int:
    """Print a layout for Foxglove (JSON): save it, and import it there under Layouts."""
    sys.stdout.write(files("sim.recording").joinpath("foxglove-layout.json").read_text("utf-8"))
    return 0


def _written(to: str, run: "Result", folder: Path, out: Path) -> Mapping[Path, str]:
    """Write a run in one of the formats; returns how much each file has."""
    counts: Mapping[Path, int]
    if to in ("parquet", "csv"):
        from sim.recording.tables import write_csv, write_parquet

        write = write_csv if to == "csv" else write_parquet
        counts, what = write(run.outcome, folder, out), "rows"
    elif to == "mcap":
        from sim.recording.from_result import write_mcap

        counts, what = {out: write_mcap(run.outcome, out)}, "messages"
    else:
        from sim.recording.tracks import write_gpx, write_kml

        counts = write_gpx(run.outcome, out) if to == "gpx" else {out: write_kml(run.outcome, out)}
        what = "points"
    return {path: f"{count:,} {what}" for path, count in counts.items()}
