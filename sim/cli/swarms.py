"""`fanet swarms`, `links`, `view`, `top` and `gateway`: the swarms that run on this machine, and looking into one."""

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from sim.bus.running_swarms import running
from sim.cli.options import DoorFlags, SwarmFlags
from sim.console import Console, table, tell


def links(
    *,
    node: int | None = None,
    reports: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Show the links of a swarm that runs, the busiest first, renewed every second.

    Args:
        node: Only links from and to this node.
        reports: End after this many reports; by default when interrupted.

    """
    from sim.cli.links import watch

    return watch(*where.located(), node=node, reports=reports, console=Console(), zenoh_config=where.zenoh_config)


def swarms(*, json_: Annotated[bool, Parameter(name="--json", negative="")] = False) -> int:
    """List the swarms that run on this machine, started by `fanet launch` or `fanet router`.

    Args:
        json_: Print JSON instead of a table.

    """
    entries = running()
    if json_:
        rows = [{"swarm": e.swarm, "endpoint": e.endpoint, "pid": e.pid} for e in entries]
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
        return 0
    shown = table(("swarm", "endpoint", "process"), ((one.swarm, one.endpoint, str(one.pid)) for one in entries))
    Console().print(shown if entries else "no swarm runs on this machine")
    return 0


def gateway(
    swarm: str | None = None,
    *,
    doors: DoorFlags = DoorFlags(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Connect ground stations (QGroundControl, MAVProxy, MAVSDK) to a swarm that runs, until it ends.

    Args:
        swarm: Name of the swarm; by default the only one running.

    """
    import asyncio

    from sim.run.gateway import run

    located = where.located(swarm)
    return asyncio.run(run(*located, doors.doors(default=True), zenoh_config=where.zenoh_config, tell=tell))


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
