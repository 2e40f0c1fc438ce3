"""`fanet replay`: a finished run again, as a page that plays in a browser, or as text for one instant."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from fanet_mw.errors import ConfigError
from sim.console import Console, table

if TYPE_CHECKING:
    from sim.results.replay import Replay


def replay(
    folder: Path,
    *,
    html: Path | None = None,
    map_: Annotated[Path | None, Parameter(name="--map")] = None,
    at: Annotated[float | None, Parameter(name="--at")] = None,
    start: float = 0.0,
    port: int | None = None,
) -> int:
    """Play a finished run again in a browser, in 3-D, with time to go through; or write it as one file.

    Args:
        folder: What `fanet simulate --out` or `fanet launch --out` has written.
        html: Write the scene to this file instead, which plays without a network; it needs WebGL.
        map_: Write a map that plays to this file instead, with modes and events; it needs no WebGL, and is a tenth the
            size.
        at: Print the state at this instant [s] as text instead, and write nothing.
        start: Begin at this instant [s], in the browser.
        port: Port of the page on this machine; by default 8080, or the next one that is free.

    """
    asked = {"--html": html, "--map": map_, "--at": at}
    if len(given := [name for name, value in asked.items() if value is not None]) > 1:
        raise ConfigError(f"{' and '.join(given)}: one of them at a time")
    for name, page in (("--html", html), ("--map", map_)):
        if page is not None and page.suffix.lower() not in (".html", ".htm"):
            raise ConfigError(f"{name} {page}: must be a file whose name ends in .html")
    if given and start:
        raise ConfigError(f"--start and {given[0]}: only a replay in the browser begins later than at 0 s")
    if given and port is not None:
        raise ConfigError(f"--port and {given[0]}: only a replay in the browser has a port")
    if not 0 <= start < math.inf:
        raise ConfigError(f"--start {start:g}: must be 0 or more")
    if at is None and map_ is None:
        return _in_3d(folder, html=html, start_s=start, port=port)
    from sim.report.replay_page import REPLAYED, write
    from sim.results.replay import Replay

    found = Replay.read(folder, *REPLAYED)
    if at is not None:
        if not 0 <= at <= found.scenario.duration_s:
            raise ConfigError(f"--at {at:g}: must be within 0 and duration_s = {found.scenario.duration_s:g}")
        _show(found, at)
        return 0
    assert map_ is not None, "that is what is left"
    write(found, map_)
    Console().print(f"written to {map_}", highlight=False, soft_wrap=True)
    return 0


def _in_3d(folder: Path, *, html: Path | None, start_s: float, port: int | None) -> int:
    from fanet_mw.hosts import interrupts
    from sim.view.replayed import serve, write_html

    console = Console(stderr=html is None, highlight=False, soft_wrap=True)
    if html is not None:
        write_html(folder, html, tell=console.print)
        return 0
    signals: list[int] = []
    with interrupts.handed_to(signals.append):
        serve(folder, port=port, start_s=start_s, ended=signals, tell=console.print)
    return 0


def _show(run: "Replay", t_s: float) -> None:
    from fanet_mw.units import S

    uavs = run.at(t_s)
    console = Console()
    console.print(f"{run.scenario.name}, seed {run.scenario.seed}, at {t_s:g} s: {len(uavs)} UAVs, "
                  f"{run.coverage(t_s):.1%} of the area covered", highlight=False)  # fmt: skip
    swarm = table(("UAV", "east [m]", "north [m]", "up [m]", "flight", "mission", "survivor", "role", "head"))
    for node, state in uavs.items():
        place = (f"{value:.0f}" for value in state.position)
        swarm.add_row(str(node), *place, state.flight, state.mission, str(state.survivor or ""), state.role,
                      str(state.head or ""))  # fmt: skip
    console.print(swarm)
    if not run.survivors:
        return
    people = table(("survivor", "east [m]", "north [m]", "state", "since [s]", "by UAV"))
    for (survivor, found), at in zip(run.found(t_s).items(), run.survivors, strict=True):
        since = f"{found.t_ns / S:.1f}" if found.node else ""
        people.add_row(str(survivor), f"{at.east:.0f}", f"{at.north:.0f}", found.status, since, str(found.node or ""))
    console.print(people)
