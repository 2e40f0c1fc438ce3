"""A swarm of real processes in which one agent is replaced by an attacker of the air."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from air_attacks import ATTACKS, EVIL
from attacker import Attacker

from agents.__main__ import run as run_agent
from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS
from sim.results.outcome import Outcome
from sim.run.launcher import services, swarm

AHEAD_NS = 100 * MS


def agent_or_attacker(
    names: tuple[str, ...], *, scenario: Scenario, address: SwarmAddress, node: int, **others: Any
) -> int:
    """What runs in the place of an agent; the attacks of these names, all at once."""
    if node != EVIL:
        return run_agent(scenario, address, node=node, **others)
    plan = [frame for name in names for frame in ATTACKS[name].plan()]
    service.live(Attacker(EVIL, address.swarm, plan, ahead_ns=AHEAD_NS), scenario, address)
    return 0


def attacked_in_real_time(scenario: Scenario, *names: str) -> Outcome:
    """Run it as processes."""
    with _in_place_of_agents(names):
        return asyncio.run(swarm.launch(scenario, swarm="test"))


@contextmanager
def _in_place_of_agents(names: tuple[str, ...]) -> Iterator[None]:
    genuine = services.run_agent
    services.run_agent = partial(agent_or_attacker, names)  # type: ignore[assignment]
    try:
        yield
    finally:
        services.run_agent = genuine
