"""`fanet simulate`, `launch` and `plan`: run a scenario in virtual time or in real time, or judge it beforehand.

A command parses, shows progress and returns an exit code. It imports the function that does the work when it is called.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from fanet_mw.errors import ConfigError, FanetError
from sim.cli.companions import Companions
from sim.cli.memory import compile_kernel
from sim.cli.options import DoorFlags, OutputFlags, ScenarioFlags, ScenarioName, print_notes, warn_of
from sim.cli.watching import ERR, say, watched
from sim.console import Console

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from fanet_mw.scenario import Scenario
    from sim.observation.observer import Observer
    from sim.recording.mcap_recording import McapRecording
    from sim.results.outcome import Outcome
    from sim.run.collecting.running_tally import Progress
    from sim.run.launcher.swarm import SwarmRun

_WORD_EVERY_S = 10.0
"""The interval of the lines that say how a run fares where no terminal shows a progress bar."""


def simulate(
    scenario: ScenarioName, *, choice: ScenarioFlags = ScenarioFlags(), output: OutputFlags = OutputFlags()
) -> int:
    """Run a scenario in virtual time: deterministic, as fast as it goes.

    Args:
        scenario: A shipped scenario's name (see `fanet scenarios`) or a .toml file.

    """
    from fanet_mw.scenario.foreign_modules import modules_of
    from sim.cli.foreign_parts import in_own_process
    from sim.world.possible_world import require_possible

    chosen = choice.scenario(scenario)
    require_possible(chosen)  # before the result of another run gives way
    parts = modules_of(chosen)
    return in_own_process(partial(_simulate, chosen, output), parts) if parts else _simulate(chosen, output)


def _simulate(chosen: "Scenario", output: OutputFlags) -> int:
    from emulator.pcap_file import PcapFile
    from fanet_mw.hosts import interrupts
    from sim.cli.foreign_parts import own_output
    from sim.run.virtual import EPOCH_UNIX_NS
    from sim.run.virtual import simulate as run

    with output.prepared() as folder:
        print_notes(chosen)
        compile_kernel(say)
        signals: list[int] = []
        with folder.held():
            folder.start()
            path = output.capture_path()
            capture = PcapFile(path, chosen.radio, receptions=output.pcap_receptions) if path else nullcontext()
            with (
                own_output(json=output.json),
                _simulated(chosen, quiet=output.json) as (tell, watcher),
                capture as file,
                _recording(chosen, output.record, epoch_unix_ns=EPOCH_UNIX_NS) as recording,
                interrupts.handed_to(signals.append),
            ):
                if file is not None:
                    file.pcap.epoch_unix_ns = EPOCH_UNIX_NS

                def follow(seconds: float) -> None:
                    folder.replace()
                    tell(seconds)

                outcome = run(
                    chosen,
                    on_progress=follow,
                    capture=file.pcap if file else None,
                    signals=signals,
                    spool_folder=output.out,
                    observer=_together(watcher, recording),
                    on_failure=_say_failure,
                )
        why = None if recording is None else recording.failure
        return finish(outcome, output, {} if why is None else {str(output.record): why})


def launch(
    scenario: ScenarioName,
    *,
    choice: ScenarioFlags = ScenarioFlags(),
    output: OutputFlags = OutputFlags(),
    respawn: Annotated[bool, Parameter(negative="")] = False,
    slow_down_to: Annotated[float | None, Parameter(validator=Number(gte=1e-3, lte=100))] = None,
    no_world: Annotated[bool, Parameter(negative="")] = False,
    autopilots: str | None = None,
    view: Annotated[bool, Parameter(negative="")] = False,
    view_port: int | None = None,
    listen: str | None = None,
    connect: str | None = None,
    swarm: str | None = None,
    zenoh_config: Path | None = None,
    doors: DoorFlags = DoorFlags(),
) -> int:
    """Run a scenario in real time: one process per UAV, the link emulator and the world, over Zenoh.

    Args:
        scenario: A shipped scenario's name (see `fanet scenarios`) or a .toml file.
        respawn: Start a process again when it dies.
        slow_down_to: Let the swarm's clock slow down while this machine cannot keep up with it, at most to this share
            of real time, and speed up again afterwards; by default it does not, and the run says that it is not valid.
        no_world: Start no world: another program says where all UAVs are (how is in the documentation, reference/bus).
        autopilots: With --no-world: flight controllers (PX4's or ArduPilot's, by --flavor) fly the UAVs and say where
            they are; the connection of UAV 1, whose port is counted up for the others: udpin:127.0.0.1:14540+.
        view: Show the swarm in a browser: `fanet view` beside it, until it ends.
        view_port: The port of that page; by default 8080, or the next one that is free.
        listen: Zenoh endpoint to serve on, for example tcp/127.0.0.1:7447; by default a free port of the loopback
            interface.
        connect: Zenoh endpoint of an existing router to use instead of serving one.
        swarm: Name of the swarm on the bus; by default the scenario's name.
        zenoh_config: Zenoh's own configuration, JSON5 (TLS, access lists): a file, or a folder of `fanet keys`.

    """
    import asyncio

    from fanet_mw.bus.topics import Topics
    from sim.cli.foreign_parts import own_output
    from sim.run.launcher.leads import fitted
    from sim.run.launcher.swarm import launch as run
    from sim.world.possible_world import require_possible

    chosen = choice.realtime_scenario(scenario) if no_world else choice.scenario(scenario)
    name = Topics(swarm or chosen.name).swarm
    # what is wrong is said before the result of another run gives way
    require_possible(chosen)
    doors.doors()
    beside = [] if output.record is None else [["record", str(output.record.absolute()), "--quiet", "--force"]]
    if view or view_port is not None:
        import viser  # noqa: F401

        beside.append(["view", "--until-gone", *([] if view_port is None else ["--port", str(view_port)])])
    if (words := doors.command()) is not None:
        beside.append(words)
    if autopilots is not None:
        if not no_world:
            raise ConfigError("--autopilots: needs --no-world, because flight controllers are the world then")
        beside.append(["autopilots", autopilots, "--flavor", doors.flavor])
    with output.prepared() as folder:
        # another's world has the scenario as it is
        chosen, leads = (chosen, None) if no_world else fitted(chosen, say)
        print_notes(chosen)
        warn_of(listen, listens=True)
        warn_of(connect, listens=False)
        with (
            own_output(json=output.json),
            folder.held(),
            Companions(beside) as companions,
            _watched(chosen, bar=not output.json) as tell,
        ):

            def start(run: "SwarmRun") -> None:
                folder.start()
                companions.start(run.address, chosen)

            def follow(at: "Progress") -> None:
                folder.replace()
                tell(at)

            outcome = asyncio.run(
                run(
                    chosen,
                    swarm=name,
                    listen=listen,
                    connect=connect,
                    respawn=respawn,
                    slow_down_to=slow_down_to,
                    own_world=not no_world,
                    zenoh_config=zenoh_config,
                    emulator_options={"pcap": output.capture_path(), "receptions": output.pcap_receptions},
                    spool_folder=output.out,
                    on_progress=follow,
                    on_event=say,
                    leads=leads,
                    on_started=start,
                    awaited=companions.awaited,
                )
            )
        failed = {name: f"fanet {name} ended with {how}" for name, how in companions.failed.items()}
        for sentence in failed.values():
            say(sentence)
        return finish(outcome, output, {str(output.record): failed["record"]} if "record" in failed else {})


def plan(
    scenario: ScenarioName,
    *,
    choice: ScenarioFlags = ScenarioFlags(),
    deadline: float | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Say before take-off whether a scenario is feasible and what it guarantees, or else what to change.

    Exit code 0: feasible; 1: not feasible; 2: the scenario or a flag is wrong.

    Args:
        scenario: A shipped scenario's name (see `fanet scenarios`) or a .toml file.
        deadline: Every packet must reach all nodes within this time [s]; by default traffic.deadline_s, if that is set.
        json: Print the plan as JSON.

    """
    from sim.planner.answer import show

    return show(choice.scenario(scenario), deadline=deadline, as_json=json)


def _recording(
    scenario: "Scenario", path: Path | None, *, epoch_unix_ns: int
) -> "AbstractContextManager[McapRecording | None]":
    if path is None:
        return nullcontext()
    from sim.recording.mcap_recording import McapRecording

    return McapRecording(path, scenario, epoch_unix_ns=epoch_unix_ns)


def _together(*observers: "Observer | None") -> "Observer | None":
    from sim.observation.observer import Several

    found = [one for one in observers if one is not None]
    return Several(found) if found else None


@contextmanager
def _simulated(scenario: "Scenario", *, quiet: bool) -> "Iterator[tuple[Callable[[float], None], Observer | None]]":
    """As `_watched`, for a run that tells no more than its time; a bar says how the swarm fares, too."""
    from sim.run.collecting.running_tally import Progress, RunningTally

    began_s = monotonic()
    tally = RunningTally(scenario) if ERR.is_terminal and not quiet else None

    def progress(seconds: float) -> Progress:
        pace = seconds / max(1e-3, monotonic() - began_s)
        survivors = scenario.mission.survivors
        if tally is None:
            return Progress(seconds, scenario.duration_s, pace, None, None, None, 0, survivors)
        found = len(tally.confirmed), len(tally.without_phone)
        return Progress(seconds, scenario.duration_s, pace, tally.delivered_share(), None, *found, survivors)

    with _watched(scenario, bar=not quiet, lines=not quiet) as tell:
        yield lambda seconds: tell(progress(seconds)), tally


@contextmanager
def _watched(scenario: "Scenario", *, bar: bool, lines: bool = True) -> "Iterator[Callable[[Progress], None]]":
    """Says how a swarm fares."""
    with watched(scenario.name, scenario.duration_s, "s", every_s=_WORD_EVERY_S, bar=bar, lines=lines) as tell:
        yield lambda at: tell(at.swarm_s, at.in_words(), at.sentence())


def _say_failure(error: BaseException, what: str) -> None:
    """Say what a part of another package has raised, with the traceback from there on that its author needs."""
    from traceback import format_exception

    if not isinstance(error, FanetError):
        say("".join(format_exception(error)).rstrip())
    say(f"ended early: {what}")


def finish(outcome: "Outcome", output: OutputFlags, cut: dict[str, str] | None = None) -> int:
    """Write and show the result, in which `cut` names what else ends early; returns 0 only if it may be used."""
    from json import dumps

    from sim.results import files, printed_summary

    page = None
    if output.report and output.out is not None:
        from sim.report.page import write

        page = partial(write, [output.out], output.out)
    summary: dict[str, Any] = files.finish(outcome, out=output.out, page=page, cut=cut)
    if output.json:
        sys.stdout.write(dumps(summary, indent=2) + "\n")
    else:
        console = Console()
        printed_summary.show(summary, console)
        if output.out is not None:
            console.print(f"written to {output.out}", highlight=False, soft_wrap=True)
    for name, why in summary["unwritten"].items():
        if name not in (cut or ()):  # those were named as they ended
            say(f"{name} in --out {output.out} ends early or is missing: {why}")
    return 0 if summary["valid"] else 1
