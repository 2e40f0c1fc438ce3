"""`fanet gateway`: ground stations see and command the UAVs of a swarm that runs."""

from typing import TYPE_CHECKING

from sim.cli.command_groups import RUNNING
from sim.cli.options import DoorFlags, SwarmFlags
from sim.console import Console

if TYPE_CHECKING:
    from cyclopts import App

_err = Console(stderr=True)


def add_to(app: "App") -> None:
    """Register the command."""
    app.command(gateway, group=RUNNING)


def gateway(
    swarm: str | None = None,
    *,
    doors: DoorFlags = DoorFlags(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Connect ground stations (QGroundControl, MAVProxy, MAVSDK) to a swarm that runs, until it ends.

    Parameters
    ----------
    swarm
        Name of the swarm; by default the only one running.

    """
    import asyncio
    from dataclasses import replace

    from sim.run.gateway import run

    located = replace(where, swarm=swarm or where.swarm).located()
    return asyncio.run(run(*located, doors.doors(default=True), zenoh_config=where.zenoh_config, tell=_say))


def _say(text: str) -> None:
    _err.print(text, highlight=False, soft_wrap=True, markup=False)
