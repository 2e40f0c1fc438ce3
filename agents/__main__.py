"""One UAV as a process: `fanet agent --id N`, which has all the flags. Needs neither numpy nor physics."""

import asyncio

from agents.uav import Uav
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


def run(scenario: Scenario, *, node: NodeId, swarm: str, endpoint: str, position: Enu) -> int:
    """Run one UAV against a router until the scenario is over; raises BusError."""
    uav = Uav(scenario, node, swarm, position=position)
    asyncio.run(run_actor(uav, swarm=swarm, endpoint=endpoint, until_ns=scenario.duration_ns))
    return 0
