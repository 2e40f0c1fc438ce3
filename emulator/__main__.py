"""The link emulator as a process: `python -m emulator SCENARIO.toml`, or `fanet emulator`."""

from collections.abc import Callable
from pathlib import Path

from emulator.capture_file import CaptureFile, unused
from emulator.compile import warm_up
from emulator.medium import Medium
from fanet_mw.hosts import interrupts, loop, service
from fanet_mw.hosts.realtime import run_actor
from fanet_mw.scenario import Scenario


def run(scenario: Scenario, *, swarm: str, endpoint: str, pcap: Path | None = None, receptions: bool = False) -> int:
    """Run the emulator against a router until the scenario is over, with a capture if a file is named.

    Raises BusError, and ConfigError when the file cannot be opened.
    """
    warm_up()
    if pcap is None:
        _live(Medium(scenario, swarm), scenario, swarm, endpoint)
        return 0
    with CaptureFile(unused(pcap), scenario.radio, receptions=receptions) as file:

        def on_epoch(epoch_unix_ns: int) -> None:
            file.pcap.epoch_unix_ns = epoch_unix_ns

        _live(Medium(scenario, swarm, capture=file.pcap), scenario, swarm, endpoint, on_epoch)
    return 0


def _live(
    medium: Medium,
    scenario: Scenario,
    swarm: str,
    endpoint: str,
    on_epoch: Callable[[int], None] = lambda _: None,
) -> None:
    until_ns = scenario.duration_ns
    loop.run(run_actor(medium, swarm=swarm, endpoint=endpoint, until_ns=until_ns, on_epoch=on_epoch))


def main() -> int:
    """Parse the command line and run; returns the exit code."""
    parser = service.parser("emulator", "Run the link emulator against a router.")
    parser.add_argument("--pcap", type=Path, metavar="FILE", help="write every transmission to a capture file")
    parser.add_argument("--pcap-receptions", action="store_true", help="and every reception, with its RSSI")
    given = parser.parse_args()
    return service.serve(
        given,
        lambda scenario, swarm, endpoint: run(
            scenario, swarm=swarm, endpoint=endpoint, pcap=given.pcap, receptions=given.pcap_receptions
        ),
    )


if __name__ == "__main__":
    interrupts.leave(main())
