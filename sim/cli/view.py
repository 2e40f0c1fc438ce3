"""`fanet view` and `fanet top`: a running swarm in a browser, or on the terminal."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from cyclopts.validators import Number

from sim.cli.command_groups import RUNNING
from sim.cli.options import SwarmFlags, given
from sim.console import Console


def add_to(app: App) -> None:
    """Register the commands."""
    for command in (view, top):
        app.command(command, group=RUNNING)


def view(
    swarm_name: str | None = None,
    *,
    port: int | None = None,
    until_gone: Annotated[bool, Parameter(negative="")] = False,
    scenario: Path | None = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Show a swarm that runs in a browser, in 3-D, with things to do: cut, degrade, jam, crash, pause, send.

    Parameters
    ----------
    swarm_name
        Name of the swarm; by default the only one running on this machine.
    port
        Port of the page on this machine; by default 8080, or the next one that is free.
    until_gone
        End when the swarm has gone; otherwise its last state stays.
    scenario
        The scenario of the swarm, needed only if it names files (maps), which the bus does not carry.

    """
    from dataclasses import replace

    from fanet_mw.hosts import interrupts
    from sim.observation.bus_feed import BusFeed
    from sim.view.live import view as show

    chosen = replace(where, swarm=swarm_name) if swarm_name is not None else where
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    signals: list[int] = []
    endpoint, swarm = chosen.located()
    with (
        BusFeed(endpoint, swarm, zenoh_config=where.zenoh_config, scenario=given(scenario)) as feed,
        interrupts.handed_to(signals.append),
    ):
        show(feed, port=port, until_gone=until_gone, ended=signals, tell=console.print)
    return 0


def top(
    swarm_name: str | None = None,
    *,
    screens: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    scenario: Path | None = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Show a swarm that runs on the terminal: a line per UAV with mode, battery, head, neighbors and queue.

    Parameters
    ----------
    swarm_name
        Name of the swarm; by default the only one running on this machine.
    screens
        End after this many seconds of the swarm; by default when interrupted.
    scenario
        The scenario of the swarm, needed only if it names files (maps), which the bus does not carry.

    """
    from dataclasses import replace

    from fanet_mw.hosts import interrupts
    from sim.cli.top import watch
    from sim.observation.bus_feed import BusFeed

    chosen = replace(where, swarm=swarm_name) if swarm_name is not None else where
    signals: list[int] = []
    endpoint, swarm = chosen.located()
    with (
        BusFeed(endpoint, swarm, zenoh_config=where.zenoh_config, scenario=given(scenario)) as feed,
        interrupts.handed_to(signals.append),
    ):
        watch(feed, ended=signals, screens=screens, console=Console())
    return 0
