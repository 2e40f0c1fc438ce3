"""The world as a process (`fanet world`)."""

from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario
from sim.world.flight_recorder import SwarmFlight
from sim.world.world import WorldActor


def run(scenario: Scenario, address: SwarmAddress, *, flight: SwarmFlight | None = None) -> int:
    """Run the world against a router until the scenario is over, from the state `flight` if given; raises BusError."""
    service.live(WorldActor(scenario, address.swarm, flight=flight), scenario, address)
    return 0
