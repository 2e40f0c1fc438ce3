"""`fanet replay`: a finished run again, as a page that plays in a browser, or as text for one instant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from fanet_mw.errors import ConfigError
from sim.cli.command_groups import RUN
from sim.cli.console import Console

if TYPE_CHECKING:
    from sim.results.replay import Replay


def add_to(app: App) -> None:
    """Register the command."""
    app.command(replay, group=RUN)


def replay(folder: Path, *, out: Path | None = None, at: Annotated[float | None, Parameter(name="--at")] = None) -> int:
    """Play a finished run again: writes replay.html, a map for the browser that needs no network.

    Parameters
    ----------
    folder
        What `fanet simulate --out` or `fanet launch --out` has written.
    out
        The page; by default FOLDER/replay.html.
    at
        Print the state at this instant [s] as text instead, and write nothing.

    """
    from sim.report.names import REPLAY
    from sim.report.replay_page import REPLAYED, write
    from sim.results.replay import Replay

    found = Replay.read(folder, *REPLAYED)
    if at is not None:
        if not 0 <= at <= found.scenario.duration_s:
            raise ConfigError(f"--at {at:g}: must be within 0 and duration_s = {found.scenario.duration_s:g}")
        _show(found, at)
        return 0
    path = out or folder / REPLAY
    write(found, path)
    Console().print(f"written: {path}; open it in a browser", highlight=False, soft_wrap=True)
    return 0


def _show(run: "Replay", t_s: float) -> None:
    """Print tables of the UAVs and of the survivors at an instant."""
    from rich.table import Table

    from fanet_mw.units import S

    uavs = run.at(t_s)
    console = Console()
    console.print(f"{run.scenario.name}, seed {run.scenario.seed}, at {t_s:g} s: {len(uavs)} UAVs, "
                  f"{run.coverage(t_s):.1%} of the area covered", highlight=False)  # fmt: skip
    table = Table("UAV", "east [m]", "north [m]", "up [m]", "flight", "mission", "survivor", "role", "head", box=None,
                  header_style="bold", padding=(0, 2, 0, 0))  # fmt: skip
    for node, state in uavs.items():
        place = (f"{value:.0f}" for value in state.position)
        table.add_row(str(node), *place, state.flight, state.mission, str(state.survivor or ""), state.role,
                      str(state.head or ""))  # fmt: skip
    console.print(table)
    if not run.survivors:
        return
    people = Table("survivor", "east [m]", "north [m]", "state", "since [s]", "by UAV", box=None, header_style="bold",
                   padding=(0, 2, 0, 0))  # fmt: skip
    for (survivor, found), at in zip(run.found(t_s).items(), run.survivors, strict=True):
        since = f"{found.t_ns / S:.1f}" if found.node else ""
        people.add_row(str(survivor), f"{at.east:.0f}", f"{at.north:.0f}", found.status, since, str(found.node or ""))
    console.print(people)
