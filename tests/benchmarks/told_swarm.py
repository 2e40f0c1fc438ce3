"""Runs a swarm whose UAVs are made by the caller, with the world and the medium of the true scenario."""

from collections.abc import Sequence

from emulator.medium import Medium
from fanet_mw.actor import Actor
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from sim.results.outcome import Outcome
from sim.world.world import WorldActor


def run_of(scenario: Scenario, actors: Sequence[Actor]) -> Outcome:
    """A whole run of these actors in virtual time; the outcome has its records and no reports."""
    records: list[Record] = []
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    return Outcome(scenario=scenario, mode="virtual", wall_s=0.0, records=records, reports={})


def run_with(scenario: Scenario, uavs: Sequence[Actor]) -> Outcome:
    """A whole run of UAVs that may be told another scenario than that of their world and their air."""
    return run_of(scenario, [WorldActor(scenario, scenario.name), Medium(scenario, scenario.name), *uavs])
