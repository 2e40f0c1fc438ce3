"""The link emulator as a process: `python -m emulator`, or `fanet emulator`, which has all the flags."""

import asyncio

from emulator.compile import warm_up
from emulator.medium import Medium
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario


def run(scenario: Scenario, *, swarm: str, endpoint: str) -> int:
    """Run the emulator against a router until the scenario is over; raises BusError."""
    warm_up()
    medium = Medium(scenario, swarm)
    asyncio.run(run_actor(medium, swarm=swarm, endpoint=endpoint, until_ns=scenario.duration_ns))
    return 0
