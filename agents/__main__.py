"""One UAV as a process: `python -m agents SCENARIO.toml --id N`, or `fanet agent`. Needs neither numpy nor physics."""

import json
import sys
from collections.abc import Mapping

from agents.clock.clocked_uav import make_uav
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.program.attached import OnAir
from fanet_mw.errors import ConfigError
from fanet_mw.hosts import interrupts, loop, service
from fanet_mw.hosts.clock import START_PATIENCE_S
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.radios.udp import PORT
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId


def run(
    scenario: Scenario, address: SwarmAddress, *, node: NodeId, position: Enu, onboard_map: OnboardMap = NO_MAP
) -> int:
    """Run one UAV, with a map on board, against a router until the scenario is over; raises BusError."""
    service.live(make_uav(scenario, node, address.swarm, position=position, onboard_map=onboard_map), scenario, address)
    return 0


def fly(scenario: Scenario, on_air: OnAir, *, node: NodeId) -> Mapping[str, object]:
    """Run one UAV on a real radio until the scenario is over; returns its report. Raises BusError."""
    return loop.run(_fly(scenario, on_air, node))


async def _fly(scenario: Scenario, on_air: OnAir, node: NodeId) -> Mapping[str, object]:
    uav = make_uav(scenario, node, on_air.swarm or scenario.name, position=on_air.position)
    async with on_air.opened(uav, scenario, node) as (host, radio):
        await host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S)
    return {**uav.report(), "radio": dict(sorted(radio.counts.items()))}


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    flags = service.parser("agents", "Run one UAV against a router.")
    flags.add_argument("--id", type=int, required=True, help="node id, from 1 to the number of nodes")
    flags.add_argument(
        "--at", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("E", "N", "U"),
        help="where it starts, until its first fix: east, north and up [m]",
    )  # fmt: skip
    flags.add_argument("--radio-address", help="send and hear frames on the interface with this address, not emulated")
    flags.add_argument("--radio-broadcast", help="the broadcast address of that interface's network")
    flags.add_argument("--radio-port", type=int, default=PORT, help="UDP port of the swarm (%(default)s)")
    flags.add_argument("--epoch", type=float, help="unix time of swarm instant 0 [s]: no router, clocks by GPS or NTP")
    given = flags.parse_args()

    def start(scenario: Scenario, address: SwarmAddress) -> int:
        node, at = NodeId(given.id), Enu(*given.at)
        if node not in scenario.node_ids:
            raise ConfigError(f"--id {node}: must be in [1, {scenario.last_id}]")
        if (given.radio_address is None) != (given.radio_broadcast is None):
            raise ConfigError("--radio-address and --radio-broadcast: both or none")
        if given.radio_address is None:
            if given.epoch is not None:
                raise ConfigError(
                    f"--epoch {given.epoch:g}: needs --radio-address; the emulated radio is on the router"
                )
            return run(scenario, address, node=node, position=at)
        on_air = OnAir(
            given.radio_address, given.radio_broadcast, given.radio_port, epoch_unix_s=given.epoch,
            endpoint=None if given.epoch is not None else address.endpoint, swarm=address.swarm,
            zenoh_config=address.zenoh_config, position=at,
        )  # fmt: skip
        sys.stdout.write(json.dumps(fly(scenario, on_air, node=node)) + "\n")
        return 0

    return service.serve(given, start)


if __name__ == "__main__":
    interrupts.leave(main())
