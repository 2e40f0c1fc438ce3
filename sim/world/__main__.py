"""The world as a process: `python -m sim.world.__main__ SCENARIO.toml`, or `fanet world`."""

from fanet_mw.hosts import interrupts, service
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario
from sim.world.flight_recorder import SwarmFlight
from sim.world.world import WorldActor


def run(scenario: Scenario, address: SwarmAddress, *, flight: SwarmFlight | None = None) -> int:
    """Run the world against a router until the scenario is over, from the state `flight` if given; raises BusError."""
    service.live(WorldActor(scenario, address.swarm, flight=flight), scenario, address)
    return 0


def main() -> int:
    return service.serve(service.parser("sim.world", "Run the world against a router.").parse_args(), run)


if __name__ == "__main__":
    interrupts.leave(main())
