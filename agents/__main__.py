"""One UAV as a process: `python -m agents SCENARIO.toml --id N`, or `fanet agent`. Needs neither numpy nor physics."""

import json
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import NamedTuple

from agents.clocked import make_uav
from agents.mission.chart import NO_CHART, Chart
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.hosts import interrupts, loop, service
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.hosts.clock import START_PATIENCE_S
from fanet_mw.hosts.realtime import Joining, RealtimeHost
from fanet_mw.radios.field_bus import FieldBus, joined
from fanet_mw.radios.udp import PORT, UdpRadio
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, NodeId, S


def run(scenario: Scenario, joining: Joining, *, node: NodeId, position: Enu, chart: Chart = NO_CHART) -> int:
    """Run one UAV, with a map on board, against a router until the scenario is over; raises BusError."""
    service.live(make_uav(scenario, node, joining.swarm, position=position, chart=chart), scenario, joining)
    return 0


class OnAir(NamedTuple):
    """A real interface, and the unix time of swarm instant 0 for a UAV without a router [s]."""

    address: str
    broadcast: str
    port: int
    epoch_unix_s: float | None


def fly(scenario: Scenario, on_air: OnAir, joining: Joining, *, node: NodeId, position: Enu) -> Mapping[str, object]:
    """Run one UAV on a real radio until the scenario is over; returns its report. Raises BusError.

    A UAV that was told the epoch joins no router.
    """
    endpoint = None if on_air.epoch_unix_s is not None else joining.endpoint
    router = joined(endpoint, config_of(joining.zenoh_config, f"agent-{node}"))
    return loop.run(_fly(scenario, on_air, node, Topics(joining.swarm), router, position))


async def _fly(
    scenario: Scenario,
    on_air: OnAir,
    node: NodeId,
    names: Topics,
    router: AbstractContextManager[Bus | None],
    position: Enu,
) -> Mapping[str, object]:
    epoch_unix_ns = None if on_air.epoch_unix_s is None else round(on_air.epoch_unix_s * S)
    uav = make_uav(scenario, node, names.swarm, position=position)
    with router as inner:
        bus = FieldBus(names, node, inner=inner, epoch_unix_ns=epoch_unix_ns)
        host = RealtimeHost(uav, bus, names)
        radio = UdpRadio(
            node, address=on_air.address, broadcast=on_air.broadcast, port=on_air.port,
            max_frame_bytes=scenario.radio.max_frame_bytes, now_ns=host.now_ns, on_message=bus.on_radio,
        )  # fmt: skip
        bus.use(radio)
        await radio.open()
        try:
            await host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S)
        finally:
            radio.close()
    return {**uav.report(), "radio": dict(sorted(radio.counts.items()))}


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    flags = service.parser("agents", "Run one UAV against a router.")
    flags.add_argument("--id", type=int, required=True, help="node id, from 1 to nodes.count")
    flags.add_argument(
        "--at", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("E", "N", "U"),
        help="where it starts, until its first fix: east, north and up [m]",
    )  # fmt: skip
    flags.add_argument("--radio-address", help="send and hear frames on the interface with this address, not emulated")
    flags.add_argument("--radio-broadcast", help="the broadcast address of that interface's network")
    flags.add_argument("--radio-port", type=int, default=PORT, help="UDP port of the swarm (%(default)s)")
    flags.add_argument("--epoch", type=float, help="unix time of swarm instant 0 [s]: no router, clocks by GPS or NTP")
    given = flags.parse_args()

    def start(scenario: Scenario, joining: Joining) -> int:
        node, at = NodeId(given.id), Enu(*given.at)
        if node not in scenario.node_ids:
            raise ConfigError(f"--id {node}: must be in [1, nodes.count = {scenario.nodes.count}]")
        if (given.radio_address is None) != (given.radio_broadcast is None):
            raise ConfigError("--radio-address and --radio-broadcast: both or none")
        if given.radio_address is None:
            if given.epoch is not None:
                raise ConfigError(
                    f"--epoch {given.epoch:g}: needs --radio-address; the emulated radio is on the router"
                )
            return run(scenario, joining, node=node, position=at)
        on_air = OnAir(given.radio_address, given.radio_broadcast, given.radio_port, given.epoch)
        sys.stdout.write(json.dumps(fly(scenario, on_air, joining, node=node, position=at)) + "\n")
        return 0

    return service.serve(given, start)


if __name__ == "__main__":
    interrupts.leave(main())
