"""One UAV as a process: `python -m agents SCENARIO.toml --id N`, or `fanet agent`. Needs neither numpy nor physics."""

import argparse
import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from agents.clock.clocked_uav import ClockedUav, make_uav
from agents.mission.navigation.onboard_map import NO_MAP, OnboardMap
from agents.program.attached import OnAir
from agents.uav import Uav
from fanet_mw.autopilot.link import AutopilotLink
from fanet_mw.autopilot.serving import Autopilot, AutopilotBus
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError, FanetError, LocalProtocolError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.connections import Address, address_of
from fanet_mw.geodesy import Geodetic
from fanet_mw.hosts import interrupts, loop, service
from fanet_mw.hosts.bus import Bus, HostBus, config_of, exposure
from fanet_mw.hosts.clock import START_PATIENCE_S
from fanet_mw.hosts.realtime import RealtimeHost, SwarmAddress
from fanet_mw.radios.udp import PORT
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import Enu, NodeId

_DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"


class FlightController(NamedTuple):
    """The flight controller at the end of a MAVLink connection."""

    address: Address
    flavor: Flavor

    def beside(self, host: Callable[[], RealtimeHost], scenario: Scenario, node: NodeId) -> Autopilot:
        """Its link, in the time of a host."""
        link = AutopilotLink(flavor=self.flavor, origin=Geodetic(*scenario.world.origin_deg, 0.0))

        return Autopilot(
            f"UAV {node}", link, self.address, now_ns=lambda: host().now_ns(), tell=_tell, hears=lambda: host().running
        )


def _tell(text: str) -> None:
    sys.stderr.write(f"{text}\n")


def run(
    scenario: Scenario, address: SwarmAddress, *, node: NodeId, position: Enu, onboard_map: OnboardMap = NO_MAP,
    controller: FlightController | None = None,
) -> int:  # fmt: skip
    """Run one UAV until the scenario is over; `controller` None: the world flies it. Raises BusError."""
    uav = make_uav(scenario, node, address.swarm, position=position, onboard_map=onboard_map)
    if controller is None:
        service.live(uav, scenario, address)
    else:
        loop.run(_run(uav, scenario, address, node, controller))
    return 0


async def _run(
    uav: Uav | ClockedUav, scenario: Scenario, address: SwarmAddress, node: NodeId, controller: FlightController
) -> None:
    names = Topics(address.swarm)
    config = config_of(address.zenoh_config, uav.name)
    with await Bus.join_on_loop(address.endpoint, config, patience_s=address.patience_s) as inner:
        bus = AutopilotBus(inner, names, node)
        host = RealtimeHost(uav, bus, names)
        async with _beside(bus, controller, host, scenario, node):
            await host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S, scenario=scenario)


@contextlib.asynccontextmanager
async def _beside(
    bus: AutopilotBus | None, controller: FlightController | None, host: RealtimeHost, scenario: Scenario, node: NodeId
) -> AsyncIterator[Mapping[str, int]]:
    if bus is None or controller is None:
        yield {}
        return
    autopilot = controller.beside(lambda: host, scenario, node)
    task = asyncio.ensure_future(bus.serve(autopilot, lambda: host.running))
    try:
        await asyncio.sleep(0)
        yield autopilot.link.counts
        if task.done():
            task.result()
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def fly(
    scenario: Scenario, on_air: OnAir, *, node: NodeId, controller: FlightController | None = None
) -> Mapping[str, object]:
    """Run one UAV on a real radio until the scenario is over; returns its report. Raises BusError."""
    return loop.run(_fly(scenario, on_air, node, controller))


async def _fly(
    scenario: Scenario, on_air: OnAir, node: NodeId, controller: FlightController | None
) -> Mapping[str, object]:
    uav = make_uav(scenario, node, on_air.swarm or scenario.name, position=on_air.position)
    names = Topics(on_air.swarm or scenario.name)
    between: list[AutopilotBus] = []

    def through(bus: HostBus) -> HostBus:
        if controller is None:
            return bus
        between.append(AutopilotBus(bus, names, node))
        return between[0]

    async with on_air.opened(uav, scenario, node, through=through) as (host, radio):
        bus = between[0] if between else None
        async with _beside(bus, controller, host, scenario, node) as counts:
            await host.run(until_ns=scenario.duration_ns, clock_timeout_s=START_PATIENCE_S)
    heard = {"autopilot": dict(sorted(counts.items()))} if controller is not None else {}
    return {**uav.report(), "radio": dict(sorted(radio.counts.items())), **heard}


class Radio(NamedTuple):
    """A real radio, as the command line names it; without an address the radio is emulated."""

    address: str | None = None
    broadcast: str | None = None
    port: int = PORT
    epoch_unix_s: float | None = None


EMULATED: Final = Radio()


def start(
    scenario: Scenario,
    address: SwarmAddress,
    *,
    node: NodeId,
    position: Enu,
    onboard_map: OnboardMap = NO_MAP,
    radio: Radio = EMULATED,
    autopilot: str | None = None,
    flavor: str = "px4",
) -> int:
    """Run one UAV as a command line asks for it; raises ConfigError and BusError."""
    if node not in scenario.node_ids:
        raise ConfigError(f"--id {node}: must be in [1, {scenario.last_id}]")
    if (radio.address is None) != (radio.broadcast is None):
        raise ConfigError("--radio-address and --radio-broadcast: both or none")
    if flavor not in tuple(Flavor):
        raise ConfigError(f"--flavor {flavor}: must be {' or '.join(Flavor)}")
    controller = None
    if autopilot is not None:
        controller = FlightController(address_of(autopilot, flag="--autopilot"), Flavor(flavor))
    if radio.address is None or radio.broadcast is None:
        given = (
            f"--epoch {radio.epoch_unix_s:g}" if radio.epoch_unix_s is not None
            else f"--radio-port {radio.port}" if radio.port != PORT else None
        )  # fmt: skip
        if given is not None:
            raise ConfigError(f"{given}: needs --radio-address; the emulated radio is on the router")
        return run(scenario, address, node=node, position=position, onboard_map=onboard_map, controller=controller)
    on_air = OnAir(
        radio.address, radio.broadcast, radio.port, epoch_unix_s=radio.epoch_unix_s,
        endpoint=None if radio.epoch_unix_s is not None else address.endpoint, swarm=address.swarm,
        zenoh_config=address.zenoh_config, position=position,
    )  # fmt: skip
    sys.stdout.write(json.dumps(fly(scenario, on_air, node=node, controller=controller)) + "\n")
    return 0


def main() -> int:
    """Exit codes: 0 the swarm's time is over or its clock was stopped, 2 the request was wrong, 3 the bus could not be
    used or was lost, 130 SIGINT, 143 SIGTERM, 129 SIGHUP.
    """
    flags = argparse.ArgumentParser(prog="python -m agents", description="Run one UAV against a router.")
    flags.add_argument("scenario", type=Path, help="scenario file, the same for all services of a swarm")
    flags.add_argument("--connect", default=_DEFAULT_ENDPOINT, help="Zenoh endpoint of the router (%(default)s)")
    flags.add_argument(
        "--zenoh-config", type=Path, metavar="FILE", help="Zenoh's own configuration, JSON5: TLS and the like"
    )
    flags.add_argument("--swarm", help="name of the swarm; by default the scenario's")
    flags.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change one scenario key")
    flags.add_argument("--id", type=int, required=True, help="node id, from 1 to the number of nodes")
    flags.add_argument(
        "--at", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("E", "N", "U"),
        help="where it starts, until its first fix: east, north and up [m]",
    )  # fmt: skip
    flags.add_argument("--radio-address", help="send and hear frames on the interface with this address, not emulated")
    flags.add_argument("--radio-broadcast", help="the broadcast address of that interface's network")
    flags.add_argument("--radio-port", type=int, default=PORT, help="UDP port of the swarm (%(default)s)")
    flags.add_argument("--epoch", type=float, help="unix time of swarm instant 0 [s]: no router, clocks by GPS or NTP")
    flags.add_argument("--autopilot", help="its flight controller: udpin:HOST:PORT, tcpout:, serial:DEVICE:BAUD ...")
    flags.add_argument("--flavor", choices=[*Flavor], default="px4", help="of the flight controller (%(default)s)")
    given = flags.parse_args()
    interrupts.install()
    try:
        scenario = config.load(given.scenario, given.set)
        if (warning := exposure(given.connect, listens=False)) is not None:
            _tell(warning)
        return start(
            scenario,
            SwarmAddress(given.swarm or scenario.name, given.connect, given.zenoh_config),
            node=NodeId(given.id),
            position=Enu(*given.at),
            radio=Radio(given.radio_address, given.radio_broadcast, given.radio_port, given.epoch),
            autopilot=given.autopilot,
            flavor=given.flavor,
        )
    except LocalProtocolError:
        raise  # a bug, perhaps of a part of another package: where it is says the traceback
    except FanetError as error:
        _tell(str(error))
        return 2 if isinstance(error, ConfigError) else service.BUS_EXIT_CODE
    except KeyboardInterrupt as interrupt:
        return interrupts.exit_code(interrupt)


if __name__ == "__main__":
    interrupts.leave(main())
