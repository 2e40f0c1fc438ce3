"""`fanet router`, `emulator`, `world` and `agent`: the services of a swarm, each started on its own."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fanet_mw.errors import ConfigError, FanetError
from sim.bus.running_swarms import DEFAULT_ENDPOINT
from sim.cli.options import OutputFlags, ScenarioFlags, ScenarioName, ServiceFlags, SwarmFlags, warn_of
from sim.cli.runs import finish
from sim.console import tell


def router(
    scenario: ScenarioName,
    *,
    choice: ScenarioFlags = ScenarioFlags(),
    listen: str = DEFAULT_ENDPOINT,
    swarm: str | None = None,
    out: Path | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    zenoh_config: Path | None = None,
) -> int:
    """Serve the bus (Zenoh) and keep the time of a swarm whose services are started one by one.

    It says every five seconds which services are missing, there twice, or run another scenario.

    Args:
        scenario: The scenario that the services will run: it says which of them to wait for.
        listen: Zenoh endpoint to serve on.
        swarm: Name of the swarm on the bus; by default the scenario's name.
        out: Folder for the result of the services, as `fanet launch --out` writes it.
        force: Replace the result of another run in that folder.
        zenoh_config: Zenoh's own configuration, JSON5 (TLS, access lists): a file, or a folder of `fanet keys`.

    """
    from fanet_mw.hosts import loop
    from sim.run.router import serve

    chosen = choice.realtime_scenario(scenario)
    output = OutputFlags(out=out, force=force)
    with output.prepared() as folder:
        warn_of(listen, listens=True)

        def begin() -> None:
            folder.start()
            folder.replace()

        with folder.held():
            outcome = loop.run(
                serve(
                    chosen,
                    swarm=swarm or chosen.name,
                    listen=listen,
                    out=out,
                    zenoh_config=zenoh_config,
                    on_event=tell,
                    on_begun=begin,
                )
            )
        return 0 if outcome is None else finish(outcome, output)


def emulator(
    scenario: ScenarioName,
    *,
    choice: ScenarioFlags = ScenarioFlags(),
    join: ServiceFlags = ServiceFlags(),
    pcap: Path | None = None,
    pcap_receptions: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Run the link emulator alone; it joins a swarm that fanet router serves.

    Args:
        scenario: The scenario of the swarm.
        pcap: Capture file for every transmission, for Wireshark; if there is one already, the new one gets a number.
        pcap_receptions: Write every reception too, with its RSSI.

    """
    from emulator.compile_kernel import COMPILING_NOTICE, must_compile
    from emulator.process import run

    if pcap_receptions and pcap is None:
        raise ConfigError("--pcap-receptions: needs --pcap FILE")
    chosen = choice.realtime_scenario(scenario)
    if must_compile():
        tell(COMPILING_NOTICE)
    return run(chosen, join.address(chosen), pcap=pcap, receptions=pcap_receptions)


def world(
    scenario: ScenarioName, *, choice: ScenarioFlags = ScenarioFlags(), join: ServiceFlags = ServiceFlags()
) -> int:
    """Run the world alone; it joins a swarm that fanet router serves.

    Args:
        scenario: The scenario of the swarm.

    """
    from sim.world.process import run

    chosen = choice.realtime_scenario(scenario)
    return run(chosen, join.address(chosen))


def agent(
    scenario: ScenarioName,
    *,
    id: int,  # noqa: A002
    choice: ScenarioFlags = ScenarioFlags(),
    join: ServiceFlags = ServiceFlags(),
    radio_address: str | None = None,
    radio_broadcast: str | None = None,
    radio_port: int | None = None,
    epoch: float | None = None,
    autopilot: str | None = None,
    flavor: Literal["px4", "ardupilot"] = "px4",
) -> int:
    """Run one UAV alone; it joins a swarm that fanet router serves, or speaks over a real radio.

    Args:
        scenario: The scenario of the swarm.
        id: Node id, from 1 to the number of nodes.
        radio_address: Send and hear frames on the interface with this address, not emulated.
        radio_broadcast: The broadcast address of that interface's network.
        radio_port: UDP port of the swarm; by default 14560.
        epoch: Unix time of swarm instant 0 [s]: no router, clocks by GPS or NTP.
        autopilot: Its flight controller, which flies it and says where it is: udpin:127.0.0.1:14540, tcpout:,
            serial:DEVICE:BAUD.
        flavor: Of the flight controller.

    """
    from agents.__main__ import Radio
    from agents.__main__ import start as begin
    from fanet_mw.units import NodeId
    from sim.world.environment.layout import positions
    from sim.world.environment.map_on_board import map_on_board

    chosen = choice.realtime_scenario(scenario)
    if id not in chosen.node_ids:
        raise FanetError(f"--id {id}: must be in [1, {chosen.last_id}]")
    where = positions(chosen)[id - 1]
    return begin(
        chosen,
        join.address(chosen),
        node=NodeId(id),
        position=where,
        onboard_map=map_on_board(chosen),
        radio=Radio(radio_address, radio_broadcast, Radio().port if radio_port is None else radio_port, epoch),
        autopilot=autopilot,
        flavor=flavor,
    )


def autopilots(
    connection: str,
    *,
    flavor: Literal["px4", "ardupilot"] = "px4",
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Play the world of a swarm by flight controllers, each at the end of a MAVLink connection; for launch --no-world.

    Args:
        connection: The connection of UAV 1, whose port is counted up for the others: udpin:127.0.0.1:14540+.
        flavor: Of the flight controllers.

    """
    import asyncio

    from fanet_mw.flavors import Flavor
    from sim.run.autopilots import run

    endpoint, swarm = where.located()
    return asyncio.run(
        run(endpoint, swarm, connection, flavor=Flavor(flavor), zenoh_config=where.zenoh_config, tell=tell)
    )
