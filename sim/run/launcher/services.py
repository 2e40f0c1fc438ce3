"""The processes that the launcher starts for a swarm, and their arguments.

What they do is imported in the server from which they are forked; the launcher itself starts in half the time without.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId
from sim.run.launcher.child_processes import Entry
from sim.world.environment.layout import positions


def run_emulator(**arguments: Any) -> int:  # noqa: ANN401
    from emulator.process import run

    return run(**arguments)


def run_world(**arguments: Any) -> int:  # noqa: ANN401
    from sim.world.process import run

    return run(**arguments)


def run_agent(**arguments: Any) -> int:  # noqa: ANN401
    from agents.__main__ import run

    return run(**arguments)


class Service(NamedTuple):
    """One process: `entry(**arguments)`."""

    name: str
    entry: Entry
    arguments: Mapping[str, Any]
    gives_way: bool = False
    """True for UAVs: they run with lower priority than the emulator, because all of them wait for it."""


class Services(NamedTuple):
    """The processes of one swarm."""

    scenario: Scenario
    address: SwarmAddress
    own_world: bool = True
    """False if another program plays the world; it then sends no report."""
    leave_out: frozenset[int] = frozenset()
    """The nodes whose processes the user starts."""
    emulator_options: Mapping[str, Any] = {}
    """Additional arguments of the emulator's process."""

    def each(self) -> Iterator[Service]:
        """The emulator, the world, and the UAVs in the order of their ids."""
        common = {"scenario": self.scenario, "address": self.address}
        yield Service("emulator", run_emulator, {**common, **self.emulator_options})
        if self.own_world:
            yield Service("world", run_world, common)
        from sim.world.environment.map_on_board import map_on_board

        onboard_map = map_on_board(self.scenario)
        for node, position in zip(self.scenario.node_ids, positions(self.scenario), strict=True):
            if node not in self.leave_out:
                arguments = {**common, "node": NodeId(node), "position": position, "onboard_map": onboard_map}
                yield Service(f"agent-{node}", run_agent, arguments, gives_way=True)
