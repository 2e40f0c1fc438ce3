"""One UAV as a process: `python -m agents SCENARIO.toml --id N`, or `fanet agent`. Needs neither numpy nor physics."""

import asyncio
import sys

from agents.uav import Uav
from fanet_mw.errors import ConfigError
from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


def run(scenario: Scenario, *, node: NodeId, swarm: str, endpoint: str, position: Enu) -> int:
    """Run one UAV against a router until the scenario is over; raises BusError."""
    uav = Uav(scenario, node, swarm, position=position)
    asyncio.run(run_actor(uav, swarm=swarm, endpoint=endpoint, until_ns=scenario.duration_ns))
    return 0


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    flags = service.parser("agents", "Run one UAV against a router.")
    flags.add_argument("--id", type=int, required=True, help="node id, from 1 to nodes.count")
    flags.add_argument(
        "--at", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("E", "N", "U"),
        help="where it starts, until its first fix: east, north and up [m]",
    )  # fmt: skip
    given = flags.parse_args()

    def start(scenario: Scenario, swarm: str, endpoint: str) -> int:
        if given.id not in scenario.node_ids:
            raise ConfigError(f"--id {given.id}: must be in [1, nodes.count = {scenario.nodes.count}]")
        return run(scenario, node=NodeId(given.id), swarm=swarm, endpoint=endpoint, position=Enu(*given.at))

    return service.serve(given, start)


if __name__ == "__main__":
    sys.exit(main())
