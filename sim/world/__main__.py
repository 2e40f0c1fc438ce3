"""The world as a process: `python -m sim.world.__main__ SCENARIO.toml`, or `fanet world`."""

from pathlib import Path

from fanet_mw.hosts import interrupts, loop, service
from fanet_mw.hosts.bus import JOIN_PATIENCE_S
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario
from sim.world.flight_recorder import Flight
from sim.world.world import World


def run(
    scenario: Scenario,
    *,
    swarm: str,
    endpoint: str,
    zenoh_config: Path | None = None,
    join_patience_s: float = JOIN_PATIENCE_S,
    flight: Flight | None = None,
) -> int:
    """Run the world against a router until the scenario is over, on from `flight` if given; raises BusError."""
    loop.run(
        run_actor(
            World(scenario, swarm, flight=flight),
            swarm=swarm,
            endpoint=endpoint,
            until_ns=scenario.duration_ns,
            zenoh_config=zenoh_config,
            scenario=scenario,
            join_patience_s=join_patience_s,
        )
    )
    return 0


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    given = service.parser("sim.world", "Run the world against a router.").parse_args()
    return service.serve(
        given,
        lambda scenario, swarm, endpoint: run(
            scenario, swarm=swarm, endpoint=endpoint, zenoh_config=given.zenoh_config
        ),
    )


if __name__ == "__main__":
    interrupts.leave(main())
