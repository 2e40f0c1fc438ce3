"""`fanet swarms` and `fanet links`: the swarms that run on this machine, and the links of one."""

import json
import sys
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number
from rich.table import Table

from sim.bus.running_swarms import running
from sim.cli.options import SwarmFlags
from sim.console import Console


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
    table = Table("swarm", "endpoint", "process", box=None, header_style="bold", padding=(0, 2, 0, 0))
    for entry in entries:
        table.add_row(entry.swarm, entry.endpoint, str(entry.pid))
    Console().print(table if entries else "no swarm runs on this machine")
    return 0
