"""The command line of a service that is started on its own: `python -m agents rescue.toml --id 3 --connect ENDPOINT`.

It uses the standard library only, for machines that carry one UAV and not the whole of `fanet`. Exit codes: 0 the
swarm's time is over or its clock was stopped, 2 the request was wrong, 3 the bus could not be used or was lost, 130
SIGINT, 143 SIGTERM, 129 SIGHUP.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from fanet_mw.actor import Actor
from fanet_mw.errors import ConfigError, FanetError
from fanet_mw.hosts import interrupts, loop
from fanet_mw.hosts.bus import exposure
from fanet_mw.hosts.realtime import SwarmAddress, run_actor
from fanet_mw.scenario import Scenario, config

BUS_EXIT_CODE: Final = 3
_DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"


def parser(program: str, description: str) -> argparse.ArgumentParser:
    """The arguments that every service has; a service adds its own."""
    flags = argparse.ArgumentParser(prog=f"python -m {program}", description=description)
    flags.add_argument("scenario", type=Path, help="scenario file, the same for all services of a swarm")
    flags.add_argument("--connect", default=_DEFAULT_ENDPOINT, help="Zenoh endpoint of the router (%(default)s)")
    flags.add_argument(
        "--zenoh-config", type=Path, metavar="FILE", help="Zenoh's own configuration, JSON5: TLS and the like"
    )
    flags.add_argument("--swarm", help="name of the swarm; by default the scenario's")
    flags.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change one scenario key")
    return flags


def serve(given: argparse.Namespace, run: Callable[[Scenario, SwarmAddress], int]) -> int:
    """Load the scenario and call `run(scenario, address)`; expected errors become one message and an exit code."""
    interrupts.install()
    try:
        scenario = config.load(given.scenario, given.set)
        if (warning := exposure(given.connect, listens=False)) is not None:
            sys.stderr.write(f"{warning}\n")
        return run(scenario, SwarmAddress(given.swarm or scenario.name, given.connect, given.zenoh_config))
    except FanetError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, ConfigError) else BUS_EXIT_CODE
    except KeyboardInterrupt as interrupt:
        return interrupts.exit_code(interrupt)


def live(
    actor: Actor, scenario: Scenario, address: SwarmAddress, *, on_epoch: Callable[[int], None] = lambda _: None
) -> None:
    """Run one actor against a router until the scenario is over; raises BusError."""
    loop.run(run_actor(actor, address, until_ns=scenario.duration_ns, scenario=scenario, on_epoch=on_epoch))
