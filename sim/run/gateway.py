"""A gateway to ground stations as a process beside a swarm that runs."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.gateway.gateway import Doors, serve
from fanet_mw.hosts import interrupts
from fanet_mw.hosts.bus import Bus, config_of
from sim.bus.operator_commands import find_swarm

GATEWAY: Final = "gateway"
"""The name of its process, and of its certificate."""
_WENT: Final = "is gone"


async def run(
    endpoint: str, swarm: str | None, doors: Doors, *, zenoh_config: Path | None, tell: Callable[[str], None]
) -> int:
    """Serve ground stations until the swarm is over or a signal comes; returns the exit code."""
    over, signals = asyncio.Event(), interrupts.heeded()
    running = asyncio.get_running_loop()
    for number in signals:
        running.add_signal_handler(number, over.set)
    try:
        with Bus.join(endpoint, config_of(zenoh_config, GATEWAY)) as bus:
            names = Topics(swarm or find_swarm(bus))
            try:
                await serve(bus, names, doors, tell=tell, over=over)
            except BusError as error:
                if _WENT not in str(error):
                    raise
                tell(f"swarm {names.swarm} is over")
    finally:
        for number in signals:
            running.remove_signal_handler(number)
    return 0
