"""Options that several commands of `fanet` share, and what follows from them.

The names of the fields are the flags and their docstrings the help text; the command line reads both at run time. How
`--set KEY=VALUE` changes a file's values is in `fanet_mw/scenario/config.py`.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

from cyclopts import Group, Parameter, Token
from cyclopts.completion import CompletionContext

from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import writing
from sim.bus.running_swarms import DEFAULT_ENDPOINT, locate
from sim.console import Console, tell
from sim.scenarios.shipped import shipped

if TYPE_CHECKING:
    from fanet_mw.gateway.gateway import Doors
    from fanet_mw.hosts.realtime import SwarmAddress
    from fanet_mw.scenario import Scenario
    from sim.cli.out_folder import OutFolder
    from sim.observation.bus_feed import BusFeed

_err = Console(stderr=True)
RUN: Final = Group("Run a swarm", sort_key=1)
SCENARIO: Final = Group("Scenarios", sort_key=2)
STUDY: Final = Group("Many runs, figures and reports", sort_key=3)
RUNNING: Final = Group("While a swarm runs", sort_key=4)
SERVICE: Final = Group("Services one by one (instead of fanet launch)", sort_key=5)
TOOLS: Final = Group("For other tools", sort_key=6)
OPTIONS: Final = Group("Options", sort_key=7)
"""The groups in which `fanet --help` lists the commands, in the order in which a newcomer meets them."""
_LEAD_MS: Final = 40
"""The lead in real time of a scenario without one: timers of asyncio and the bus are late by some milliseconds."""


def scenario_names(context: CompletionContext) -> list[str]:
    """Shipped scenarios; the shell itself offers files."""
    return [entry.name for entry in shipped() if entry.name.startswith(context.incomplete)]


def keys(context: CompletionContext) -> list[str]:
    from fanet_mw.scenario.reference import dotted_keys

    return [f"{key}=" for key in dotted_keys() if key.startswith(context.incomplete)]


ScenarioName: TypeAlias = Annotated[str, Parameter(completer=scenario_names)]
"""A shipped scenario's name, or a .toml file."""


def key_of(override: str) -> str:
    return override.partition("=")[0].strip()


def require_said_once(overrides: Sequence[str]) -> None:
    """Raise ConfigError where one key is given two values: the last would silently be in force."""
    known: dict[str, str] = {}
    for override in overrides:
        before = known.setdefault(key_of(override), override)
        if before.replace(" ", "") != override.replace(" ", ""):
            raise ConfigError(f"--set {before} and {override}: one key has one value")


def _seconds(_type: object, tokens: Sequence[Token]) -> float:
    """A number of seconds, or a time with a unit."""
    from fanet_mw.scenario.quantities import in_unit_of

    text = tokens[0].value
    given = in_unit_of("duration_s", text)
    return float(text) if given is None else given


@Parameter(name="*")
@dataclass(frozen=True)
class ScenarioFlags:
    """The scenario to run, and the changes to it."""

    set: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set",
            negative="",
            consume_multiple=True,
            completer=keys,
            help="Change scenario keys, KEY=VALUE ..., for example --set nodes.count=20 duration_s=2min.",
        ),
    ] = ()
    """Repeatable; each --set may be followed by several KEY=VALUE."""
    seed: int | None = None
    """Seed of every random stream of the run."""
    duration: Annotated[float | None, Parameter(converter=_seconds)] = None
    """Simulated time to run [s]; or with a unit, for example 2min."""
    faults: str | None = None
    """random:N lets N UAVs crash, fall mute, or lose their program, drawn by the seed; added to the scenario's."""

    def scenario(self, name: str) -> "Scenario":
        from sim.scenarios import catalog

        overrides = list(self.set)
        if self.seed is not None:
            overrides.append(f"seed={self.seed}")
        if self.duration is not None:
            overrides.append(f"duration_s={self.duration}")
        require_said_once(overrides)
        found = catalog.find(name, overrides)
        if self.faults is None:
            return found
        from fanet_mw.scenario.drawn_faults import with_drawn_faults

        return with_drawn_faults(found, self.faults)

    def realtime_scenario(self, name: str) -> "Scenario":
        """The scenario for real processes. They cannot announce frames without a lead, so a lead of 0 is replaced."""
        chosen = self.scenario(name)
        if chosen.radio.lead_ms:
            return chosen
        _err.print(f"radio.lead_ms = 0 is for virtual time; {_LEAD_MS} here, --set radio.lead_ms to choose")
        others = [one for one in self.set if key_of(one) != "radio.lead_ms"]
        return replace(self, set=(*others, f"radio.lead_ms={_LEAD_MS}")).scenario(name)


@Parameter(name="*")
@dataclass(frozen=True)
class OutputFlags:
    """Where the result of a run is written, and in what form."""

    out: Path | None = None
    """Folder for scenario.toml, summary.json, reports.json, links.json, trace.jsonl and mavlink.tlog."""
    force: Annotated[bool, Parameter(negative="")] = False
    """Replace the result of another run in that folder."""
    json: Annotated[bool, Parameter(negative="")] = False
    """Print the summary as JSON, and nothing else, on standard output."""
    pcap: Annotated[bool, Parameter(negative="")] = False
    """Write every transmission to air.pcap in that folder, for Wireshark."""
    pcap_receptions: Annotated[bool, Parameter(negative="")] = False
    """Write every reception too, with its RSSI."""

    record: Path | None = None
    """A file, FILE.mcap, to record the swarm in, for Foxglove and PlotJuggler."""
    report: Annotated[bool, Parameter(negative="")] = False
    """Write a page of the run with pictures into that folder, report.html and report.md."""

    @contextmanager
    def prepared(self) -> "Iterator[OutFolder]":
        """Check before a run that its result can be written, and keep its folder; raises ConfigError."""
        if self.out is None and self.report:
            raise ConfigError("--report: needs --out DIR, the folder that report.html goes to")
        if self.report:
            import sim.report.page  # noqa: F401  what is missing is said before the run, not after it
        if self.out is None and (self.pcap or self.pcap_receptions):
            raise ConfigError("--pcap: needs --out DIR, the folder that air.pcap goes to")
        if self.record is not None:
            self._prepare_recording(self.record)
        from sim.cli.out_folder import OutFolder, alone

        with alone(self.out):
            yield OutFolder(self.out, force=self.force)

    def _prepare_recording(self, path: Path) -> None:
        from sim.recording.mcap_recording import opened_alone  # what is missing is said before the run, not after it

        if path.suffix != ".mcap":
            raise ConfigError(f"--record {path}: must be a file whose name ends in .mcap")
        if os.path.lexists(path) and not self.force:
            raise ConfigError(f"--record {path}: exists; choose another file, or replace it with --force")
        require_file_or_nothing(path)
        with writing(f"--record {path}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            opened_alone(path).close()

    def capture_path(self) -> Path | None:
        from emulator.pcap_file import NAME

        wanted = self.pcap or self.pcap_receptions
        return self.out / NAME if wanted and self.out is not None else None


@Parameter(name="*")
@dataclass(frozen=True)
class ServiceFlags:
    """How a single service finds its swarm."""

    connect: str = DEFAULT_ENDPOINT
    """Zenoh endpoint of the swarm's router."""
    swarm: str | None = None
    """Name of the swarm; by default the scenario's name."""
    zenoh_config: Path | None = None
    """Zenoh's own configuration, JSON5 (TLS and the like): a file, or a folder of `fanet keys`."""

    def address(self, scenario: "Scenario") -> "SwarmAddress":
        """The address for the service itself; warns if others can reach the endpoint."""
        from fanet_mw.hosts.realtime import SwarmAddress

        warn_of(self.connect, listens=False)
        return SwarmAddress(self.swarm or scenario.name, self.connect, self.zenoh_config)


@Parameter(name="*")
@dataclass(frozen=True)
class SwarmFlags:
    """Which of the running swarms is meant."""

    connect: str | None = None
    """Zenoh endpoint of the swarm's router; by default that of a swarm running on this machine."""
    swarm: str | None = None
    """Name of the swarm; by default the only one running."""
    zenoh_config: Path | None = None
    """Zenoh's own configuration, JSON5 (TLS and the like): a file, or a folder of `fanet keys`."""

    def located(self, swarm: str | None = None) -> tuple[str, str | None]:
        """The endpoint and, if it is known, the name of the swarm; warns if others can reach the endpoint.

        `swarm` is a name that was given otherwise.
        """
        warn_of(self.connect, listens=False)
        return locate(self.connect, swarm or self.swarm)

    @contextmanager
    def heard(self, scenario: Path | None, swarm: str | None = None) -> "Iterator[tuple[BusFeed, list[int]]]":
        """What is heard of the swarm, and the signals that come meanwhile; `scenario`: its file, if that names maps."""
        from fanet_mw.hosts import interrupts
        from sim.observation.bus_feed import BusFeed
        from sim.scenarios import catalog

        signals: list[int] = []
        endpoint, name = self.located(swarm)
        known = None if scenario is None else catalog.find(scenario)
        with (
            BusFeed(endpoint, name, zenoh_config=self.zenoh_config, scenario=known) as feed,
            interrupts.handed_to(signals.append),
        ):
            yield feed, signals


@Parameter(name="*")
@dataclass(frozen=True)
class DoorFlags:
    """The connections to ground stations."""

    mavlink: Annotated[tuple[str, ...], Parameter(negative="")] = ()
    """A connection for ground stations, repeatable: udpout:127.0.0.1:14550, udpin:, tcpin:, tcpout: or
    serial:DEVICE:BAUD."""
    mavlink_per_uav: str | None = None
    """A connection for each UAV, its ports counted up from UAV 1's: udpin:127.0.0.1:14540+."""
    flavor: Literal["px4", "ardupilot"] = "px4"
    """Whose flight modes ground stations see."""
    mavlink_key: Path | None = None
    """File of a key for MAVLink 2 signatures; what is not signed by it is refused."""
    in_band: Annotated[bool | None, Parameter(negative="--tap")] = None
    """Over the air by the post on the ground, as is the default if there is one; --tap: from the bus, past the air."""

    def doors(self, *, default: bool = False) -> "Doors":
        """The connections, checked; by default the one where ground stations listen, if `default` is set."""
        from fanet_mw.flavors import Flavor
        from fanet_mw.gateway.connections import DEFAULT
        from fanet_mw.gateway.gateway import Doors

        given = self.mavlink or ((DEFAULT,) if default and self.mavlink_per_uav is None else ())
        return Doors(given, self.mavlink_per_uav, Flavor(self.flavor), self.mavlink_key, self.in_band).checked()

    def command(self) -> list[str] | None:
        """The words of `fanet gateway` with these connections; None if there are none."""
        if not self.mavlink and self.mavlink_per_uav is None:
            return None
        words = [word for text in self.mavlink for word in ("--mavlink", text)]
        words += [] if self.mavlink_per_uav is None else ["--mavlink-per-uav", self.mavlink_per_uav]
        words += [] if self.mavlink_key is None else ["--mavlink-key", str(self.mavlink_key.absolute())]
        words += [] if self.in_band is None else ["--in-band" if self.in_band else "--tap"]
        return ["gateway", *words, "--flavor", self.flavor]


def print_notes(scenario: "Scenario") -> None:
    """Say what in a scenario was guessed, or will have no effect."""
    from sim.scenarios.notes import notes

    for note in notes(scenario):
        tell(f"note: {note}")


def warn_of(endpoint: str | None, *, listens: bool) -> None:
    """Warn if others can reach an endpoint, or forge messages on it."""
    if endpoint is None:
        return
    from fanet_mw.hosts.bus import exposure

    if (warning := exposure(endpoint, listens=listens)) is not None:
        tell(warning)


def require_file_or_nothing(path: Path) -> None:
    """Raises ConfigError for a pipe, which would be waited for without end, and for whatever else is no file."""
    if path.exists() and not path.is_file():
        raise ConfigError(f"{path}: cannot be written: not a regular file")
