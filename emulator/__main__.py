"""The link emulator as a process: `python -m emulator SCENARIO.toml`, or `fanet emulator`."""

import sys
from pathlib import Path

from emulator.compile_kernel import COMPILING_NOTICE, must_compile, warm_up
from emulator.medium import Medium
from emulator.pcap_file import PcapFile, unused
from fanet_mw.hosts import interrupts, service
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


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    parser = service.parser("emulator", "Run the link emulator against a router.")
    parser.add_argument("--pcap", type=Path, metavar="FILE", help="write every transmission to a capture file")
    parser.add_argument("--pcap-receptions", action="store_true", help="and every reception, with its RSSI")
    given = parser.parse_args()

    def start(scenario: Scenario, address: SwarmAddress) -> int:
        if must_compile():
            sys.stderr.write(f"{COMPILING_NOTICE}\n")
        return run(scenario, address, pcap=given.pcap, receptions=given.pcap_receptions)

    return service.serve(given, start)


if __name__ == "__main__":
    interrupts.leave(main())
