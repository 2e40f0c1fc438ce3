"""`fanet view` and `fanet top`: a running swarm in a browser, or on the terminal."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from sim.cli.options import SwarmFlags
from sim.console import Console, tell


def view(
    swarm_name: str | None = None,
    *,
    port: int | None = None,
    until_gone: Annotated[bool, Parameter(negative="")] = False,
    scenario: Path | None = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Show a swarm that runs in a browser, in 3-D, with things to do: cut, degrade, jam, crash, pause, send.

    Args:
        swarm_name: Name of the swarm; by default the only one running on this machine.
        port: Port of the page on this machine; by default 8080, or the next one that is free.
        until_gone: End when the swarm has gone; otherwise its last state stays.
        scenario: The scenario of the swarm, needed only if it names files (maps), which the bus does not carry.

    """
    from sim.view.live import view as show

    with where.heard(scenario, swarm_name) as (feed, signals):
        show(feed, port=port, until_gone=until_gone, ended=signals, tell=tell)
    return 0


def top(
    swarm_name: str | None = None,
    *,
    screens: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    scenario: Path | None = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Show a swarm that runs on the terminal: a line per UAV with mode, battery, head, neighbors and queue.

    Args:
        swarm_name: Name of the swarm; by default the only one running on this machine.
        screens: End after this many seconds of the swarm; by default when interrupted.
        scenario: The scenario of the swarm, needed only if it names files (maps), which the bus does not carry.

    """
    from sim.cli.top import watch

    with where.heard(scenario, swarm_name) as (feed, signals):
        watch(feed, ended=signals, screens=screens, console=Console())
    return 0
