"""`fanet router`: the bus and the swarm clock for services that are started one by one."""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.hosts.clock import START_PATIENCE_S, ClockKeeper, SwarmClock
from fanet_mw.scenario import Scenario
from sim.run.running import registered

ROUTER: Final = "router"
"""The name of the router's configuration in a folder of configurations."""
_STOP_HEARD_S: Final = 0.3
"""The time between telling services to stop and closing the bus on which they receive it."""


def expected_names(scenario: Scenario) -> list[str]:
    """Names of all actors of a swarm."""
    return ["emulator", "world", *(f"agent-{node}" for node in scenario.node_ids)]


async def serve(
    scenario: Scenario, *, swarm: str, listen: str, on_event: Callable[[str], None], zenoh_config: Path | None = None
) -> None:
    """Serve the bus and the clock until the scenario is over; raises BusError when it cannot listen on the endpoint."""
    with Bus.serve(listen, config_of(zenoh_config, ROUTER)) as bus, registered(swarm, listen):
        keeper = ClockKeeper(bus, Topics(swarm), time_scale=scenario.time_scale, expected=expected_names(scenario))
        on_event(f"serving {listen}, waiting for {len(keeper.missing())} services of swarm {swarm}")
        clock = SwarmClock(await keeper.start(timeout_s=START_PATIENCE_S))
        on_event("all are there: the clock runs")
        try:
            await asyncio.sleep(clock.wait_s(scenario.duration_ns) + 1)
        finally:  # interrupted or not, no service goes on running on a bus that ends
            keeper.stop()
            time.sleep(_STOP_HEARD_S)  # noqa: ASYNC251  (nothing else runs here, and a cancelled task cannot await)
