"""A gateway to ground stations as a process beside a swarm that runs."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.gateway.gateway import Doors, serve
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.hosts.loop import heeding
from sim.bus.operator_commands import find_swarm
from sim.bus.rights import GATEWAY

_WENT: Final = "is gone"


async def run(
    endpoint: str, swarm: str | None, doors: Doors, *, zenoh_config: Path | None, tell: Callable[[str], None]
) -> int:
    """Serve ground stations until the swarm is over or a signal comes; returns the exit code."""
    over = asyncio.Event()
    with Bus.join(endpoint, config_of(zenoh_config, GATEWAY)) as bus:
        names = Topics(swarm or find_swarm(bus))
        try:
            with heeding(lambda _: over.set()):  # the loop stands still above, where a signal must interrupt
                await serve(bus, names, doors, tell=tell, over=over)
        except BusError as error:
            if _WENT not in str(error):
                raise
            tell(f"swarm {names.swarm} is over")
    return 0
