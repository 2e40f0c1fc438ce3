"""The world as a process: `fanet world`, which has all the flags."""

import asyncio

from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario
from sim.world import World


def run(scenario: Scenario, *, swarm: str, endpoint: str) -> int:
    """Run the world against a router until the scenario is over; raises BusError."""
    world = World(scenario, swarm)
    asyncio.run(run_actor(world, swarm=swarm, endpoint=endpoint, until_ns=scenario.duration_ns))
    return 0
