"""The link emulator as a process (`fanet emulator`)."""

from pathlib import Path

from emulator.compile_kernel import warm_up
from emulator.medium import Medium
from emulator.pcap_file import PcapFile, unused
from fanet_mw.hosts import service
from fanet_mw.hosts.realtime import SwarmAddress
from fanet_mw.scenario import Scenario


def run(scenario: Scenario, address: SwarmAddress, *, pcap: Path | None = None, receptions: bool = False) -> int:
    """Run the emulator against a router until the scenario is over. Raises BusError; ConfigError for the capture."""
    warm_up()
    if pcap is None:
        service.live(Medium(scenario, address.swarm), scenario, address)
        return 0
    with PcapFile(unused(pcap), scenario.radio, receptions=receptions) as file:

        def on_epoch(epoch_unix_ns: int) -> None:
            file.pcap.epoch_unix_ns = epoch_unix_ns

        service.live(Medium(scenario, address.swarm, capture=file.pcap), scenario, address, on_epoch=on_epoch)
    return 0
