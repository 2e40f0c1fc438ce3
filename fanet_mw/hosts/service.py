"""A service of a swarm: a process that runs one actor against a router."""

from collections.abc import Callable
from typing import Final

from fanet_mw.actor import Actor
from fanet_mw.hosts import loop
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.scenario import Scenario

BUS_EXIT_CODE: Final = 3
"""The bus could not be used, or was lost."""


def live(
    actor: Actor, scenario: Scenario, address: SwarmAddress, *, on_epoch: Callable[[int], None] = lambda _: None
) -> None:
    """Run one actor against a router until the scenario is over; raises BusError."""
    loop.run(run_actor(actor, address, until_ns=scenario.duration_ns, scenario=scenario, on_epoch=on_epoch))
