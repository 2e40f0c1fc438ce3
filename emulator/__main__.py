"""The link emulator as a process: `python -m emulator SCENARIO.toml`, or `fanet emulator`."""

import asyncio
import sys

from emulator.compile import warm_up
from emulator.medium import Medium
from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario


def run(scenario: Scenario, *, swarm: str, endpoint: str) -> int:
    """Run the emulator against a router until the scenario is over; raises BusError."""
    warm_up()
    medium = Medium(scenario, swarm)
    asyncio.run(run_actor(medium, swarm=swarm, endpoint=endpoint, until_ns=scenario.duration_ns))
    return 0


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    given = service.parser("emulator", "Run the link emulator against a router.").parse_args()
    return service.serve(given, lambda scenario, swarm, endpoint: run(scenario, swarm=swarm, endpoint=endpoint))


if __name__ == "__main__":
    sys.exit(main())
