"""The `fanet` command. Parsing, progress and exit codes; everything it does is a function elsewhere."""

import asyncio
import gzip
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter
from cyclopts.validators import Number
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from emulator.capture_file import CaptureFile
from fanet_mw import __version__
from fanet_mw.errors import ConfigError, FanetError
from fanet_mw.hosts import interrupts, loop
from fanet_mw.installation import missing_extra
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId
from sim.cli import scenario_files
from sim.cli.air import app as air_app
from sim.cli.completion import ScenarioName
from sim.cli.console import Console, nobody_reads
from sim.cli.figures import figures
from sim.cli.figures import report as report_command
from sim.cli.options import Choice, Join, Output, warn_of, with_engine
from sim.cli.sweep import sweep
from sim.results import report
from sim.run.running import locate, running
from sim.scenarios import catalog
from sim.world.mobility.layout import positions

if TYPE_CHECKING:
    from sim.run.outcome import Outcome  # needs numpy, which a machine without the emulator has not

app = App(
    name="fanet",
    help="Middleware for swarms of UAVs, and the network emulator it is developed and proven on.",
    version=__version__,
    console=Console(),
    suppress_keyboard_interrupt=False,
)
app.command(air_app)
scenario_files.add_to(app)
app.register_install_completion_command()
app.command(sweep)
app.command(figures)
app.command(report_command, name="report")
_err = Console(stderr=True)


@app.command
def simulate(scenario: ScenarioName, *, choice: Choice = Choice(), output: Output = Output()) -> int:
    """Run a scenario in virtual time: deterministic, as fast as it goes.

    Parameters
    ----------
    scenario
        A shipped scenario's name (see `fanet scenarios`) or a .toml file.

    """
    from emulator.kernel.compile import COMPILING_NOTICE, must_compile, warm_up
    from sim.run.virtual import EPOCH_UNIX_NS
    from sim.run.virtual import simulate as run

    chosen = with_engine(choice.scenario(scenario))
    output.prepare()
    if must_compile():
        _err.print(COMPILING_NOTICE, highlight=False)
        warm_up()
    signals: list[int] = []
    path = output.capture_path()
    capture = CaptureFile(path, chosen.radio, receptions=output.pcap_receptions) if path else nullcontext()
    with _progress(chosen, quiet=output.json) as tell, capture as file, interrupts.handed_to(signals.append):
        if file is not None:
            file.pcap.epoch_unix_ns = EPOCH_UNIX_NS
        outcome = run(chosen, on_progress=tell, capture=file.pcap if file else None, signals=signals)
    return _finish(outcome, output)


@app.command
def plan(
    scenario: ScenarioName,
    *,
    choice: Choice = Choice(),
    deadline: float | None = None,
    search: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Say before take-off whether a clustered scenario is feasible, what it guarantees, and what would make it so.

    Exit code 0: feasible; 1: not feasible; 2: the scenario or a flag is wrong.

    Parameters
    ----------
    scenario
        A shipped scenario's name (see `fanet scenarios`) or a .toml file.
    deadline
        Every packet must be with everyone within this time [s]; by default traffic.deadline_s, if that is set.
    search
        Find the cluster count, flooding period and slots that meet the deadline with the least airtime per packet.
    json
        Print the plan as JSON.

    """
    from sim.cli.plan import show

    return show(choice.scenario(scenario), deadline=deadline, search=search, as_json=json)


@app.command
def launch(
    scenario: ScenarioName,
    *,
    choice: Choice = Choice(),
    output: Output = Output(),
    respawn: Annotated[bool, Parameter(negative="")] = False,
    no_world: Annotated[bool, Parameter(negative="")] = False,
    listen: str | None = None,
    connect: str | None = None,
    swarm: str | None = None,
    zenoh_config: Path | None = None,
) -> int:
    """Run a scenario in real time: one process per UAV, the link emulator and the world, over Zenoh.

    Parameters
    ----------
    scenario
        A shipped scenario's name (see `fanet scenarios`) or a .toml file.
    respawn
        Start a process again when it dies.
    no_world
        Start no world: somebody else's process says where everyone is (see docs/reference/bus.md).
    listen
        Zenoh endpoint to serve on, for example tcp/127.0.0.1:7447; by default a free port of the loopback interface.
    connect
        Zenoh endpoint of an existing router to use instead of serving one.
    swarm
        Name of the swarm on the bus; by default the scenario's name.
    zenoh_config
        Zenoh's own configuration, JSON5 (TLS, access lists): a file, or a folder of `fanet keys`.

    """
    from sim.run.swarm import launch as run

    chosen = with_engine(choice.realtime_scenario(scenario))
    output.prepare()
    warn_of(listen, listens=True)
    warn_of(connect, listens=False)
    with _progress(chosen, quiet=output.json) as tell:
        outcome = asyncio.run(
            run(
                chosen,
                swarm=swarm or chosen.name,
                listen=listen,
                connect=connect,
                respawn=respawn,
                own_world=not no_world,
                zenoh_config=zenoh_config,
                emulator_options={"pcap": output.capture_path(), "receptions": output.pcap_receptions},
                spool_folder=output.out,
                on_progress=tell,
                on_event=lambda text: _err.print(text, highlight=False),
            )
        )
    return _finish(outcome, output)


@app.command
def scenarios(*, json_: Annotated[bool, Parameter(name="--json", negative="")] = False) -> int:
    """List the shipped scenarios.

    Parameters
    ----------
    json_
        Print JSON instead of a table.

    """
    entries = catalog.shipped()
    if json_:
        sys.stdout.write(json.dumps([{"name": e.name, "description": e.description} for e in entries], indent=2) + "\n")
        return 0
    table = Table("scenario", "what it is", box=None, header_style="bold", padding=(0, 2, 0, 0))
    for entry in entries:
        table.add_row(entry.name, entry.description)
    Console().print(table)
    return 0


@app.command
def router(
    scenario: ScenarioName,
    *,
    choice: Choice = Choice(),
    listen: str = "tcp/127.0.0.1:7447",
    swarm: str | None = None,
    out: Path | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    zenoh_config: Path | None = None,
) -> int:
    """Serve the bus and keep the swarm clock, for services that are started one by one.

    It says every five seconds who is missing, there twice, or runs another scenario.

    Parameters
    ----------
    scenario
        The scenario that the services will run: it says which of them to wait for.
    listen
        Zenoh endpoint to serve on.
    swarm
        Name of the swarm on the bus; by default the scenario's name.
    out
        Folder for the result of the services, as `fanet launch --out` writes it.
    force
        Replace the result of another run in that folder.
    zenoh_config
        Zenoh's own configuration, JSON5 (TLS, access lists): a file, or a folder of `fanet keys`.

    """
    from sim.run.router import serve

    chosen = choice.realtime_scenario(scenario)
    Output(out=out, force=force).prepare()
    warn_of(listen, listens=True)
    code: int = loop.run(
        serve(
            chosen,
            swarm=swarm or chosen.name,
            listen=listen,
            out=out,
            zenoh_config=zenoh_config,
            on_event=lambda text: _err.print(text, highlight=False, soft_wrap=True, markup=False),
        )
    )
    if out is not None:
        report.show(json.loads((out / "summary.json").read_text(encoding="utf-8")), Console())
    return code


@app.command
def emulator(
    scenario: ScenarioName,
    *,
    choice: Choice = Choice(),
    join: Join = Join(),
    pcap: Path | None = None,
    pcap_receptions: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Run the link emulator alone, against a router.

    Parameters
    ----------
    scenario
        The scenario of the swarm.
    pcap
        Capture file for every transmission, for Wireshark; if there is one already, the new one gets a number.
    pcap_receptions
        Write every reception too, with its RSSI.

    """
    from emulator.__main__ import run
    from emulator.kernel.compile import COMPILING_NOTICE, must_compile

    chosen = choice.realtime_scenario(scenario)
    if must_compile():
        _err.print(COMPILING_NOTICE, highlight=False)
    return run(
        chosen,
        swarm=join.swarm or chosen.name,
        endpoint=join.connect,
        pcap=pcap,
        receptions=pcap_receptions,
        zenoh_config=join.zenoh_config,
    )


@app.command
def world(scenario: ScenarioName, *, choice: Choice = Choice(), join: Join = Join()) -> int:
    """Run the world alone, against a router.

    Parameters
    ----------
    scenario
        The scenario of the swarm.

    """
    from sim.world.__main__ import run

    chosen = with_engine(choice.realtime_scenario(scenario))
    return run(chosen, swarm=join.swarm or chosen.name, endpoint=join.connect, zenoh_config=join.zenoh_config)


@app.command
def agent(scenario: ScenarioName, *, id: int, choice: Choice = Choice(), join: Join = Join()) -> int:  # noqa: A002
    """Run one UAV alone, against a router.

    Parameters
    ----------
    scenario
        The scenario of the swarm.
    id
        Node id, from 1 to nodes.count.

    """
    from agents.__main__ import run

    chosen = choice.realtime_scenario(scenario)
    if id not in chosen.node_ids:
        raise FanetError(f"--id {id}: must be in [1, nodes.count = {chosen.nodes.count}]")
    start = positions(chosen)[id - 1]
    return run(
        chosen,
        node=NodeId(id),
        swarm=join.swarm or chosen.name,
        endpoint=join.connect,
        position=start,
        zenoh_config=join.zenoh_config,
    )


@app.command
def links(
    *,
    connect: str | None = None,
    swarm: str | None = None,
    node: int | None = None,
    reports: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    zenoh_config: Path | None = None,
) -> int:
    """Show the links of a swarm that runs, the busiest first, renewed every second.

    Parameters
    ----------
    connect
        Zenoh endpoint of the swarm's router; by default that of a swarm that runs on this machine.
    swarm
        Name of the swarm; by default the only one there.
    node
        Only links from and to this node.
    reports
        End after so many; by default when interrupted.
    zenoh_config
        Zenoh's own configuration, JSON5 (TLS and the like): a file, or a folder of `fanet keys`.

    """
    from sim.cli.links import watch

    warn_of(connect, listens=False)
    return watch(*locate(connect, swarm), node=node, reports=reports, console=Console(), zenoh_config=zenoh_config)


@app.command
def swarms(*, json_: Annotated[bool, Parameter(name="--json", negative="")] = False) -> int:
    """List the swarms that run on this machine, started by `fanet launch` or `fanet router`.

    Parameters
    ----------
    json_
        Print JSON instead of a table.

    """
    entries = running()
    if json_:
        rows = [{"swarm": e.swarm, "endpoint": e.endpoint, "pid": e.pid} for e in entries]
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
        return 0
    table = Table("swarm", "endpoint", "process", box=None, header_style="bold", padding=(0, 2, 0, 0))
    for entry in entries:
        table.add_row(entry.swarm, entry.endpoint, str(entry.pid))
    Console().print(table if entries else "no swarm runs on this machine")
    return 0


@app.command
def keys(
    scenario: ScenarioName,
    *,
    out: Path,
    choice: Choice = Choice(),
    swarm: str | None = None,
    host: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    days: int = 365,
) -> int:
    """Make certificates and access lists for a swarm: one file per participant, for --zenoh-config. Needs openssl.

    Parameters
    ----------
    scenario
        The scenario of the swarm: it says which UAVs there are.
    out
        Folder for router.json5, emulator.json5, world.json5, operator.json5 and agent-1.json5 and so on.
    swarm
        Name of the swarm on the bus; by default the scenario's name.
    host
        Name or address at which the router is reached, besides localhost; repeatable.
    days
        How long the certificates are valid [days].

    """
    from sim.run.keys import make

    chosen = choice.scenario(scenario)
    made = make(chosen, out, swarm=swarm or chosen.name, hosts=host, days=days)
    Console().print(f"{made} files written to {out}; each holds a private key", highlight=False, soft_wrap=True)
    return 0


@app.command
def dialect(folder: Path | None = None, *, definitions: Annotated[bool, Parameter(negative="")] = False) -> int:
    """Print the path of our MAVLink dialect, fanet.xml, with the definitions that it includes beside it.

    Parameters
    ----------
    folder
        Where to write them; by default `fanet-mw/message_definitions` in the user's folder of data.
    definitions
        Print the folder of definitions instead, which pymavlink wants in MDEF.

    """
    from fanet_mw.dialect.definitions import write

    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    path = write(folder or Path(data) / "fanet-mw" / "message_definitions")
    sys.stdout.write(f"{path.parents[1] if definitions else path}\n")
    return 0


@app.command
def dissector(folder: Path) -> int:
    """Install Wireshark's dissector for MAVLink with our messages: writes mavlink.lua.

    Parameters
    ----------
    folder
        Wireshark's folder of personal Lua plugins: see Help, About Wireshark, Folders.

    """
    path = folder / "mavlink.lua"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.decompress(files("emulator.wireshark").joinpath("mavlink.lua.gz").read_bytes()))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}") from error
    Console().print(f"written to {path}; restart Wireshark", highlight=False, soft_wrap=True)
    return 0


@contextmanager
def _progress(scenario: Scenario, *, quiet: bool) -> Iterator[Callable[[float], None]]:
    """A bar of simulated seconds on standard error, only when a person watches."""
    if quiet or not _err.is_terminal:
        yield lambda _seconds: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:.0f}/{task.total:.0f} s"))
    with Progress(*columns, TimeElapsedColumn(), console=_err, transient=True) as progress:
        task = progress.add_task(scenario.name, total=scenario.duration_s)
        yield lambda seconds: progress.update(task, completed=seconds)


def _finish(outcome: "Outcome", output: Output) -> int:
    """Write and show the result; 0 only when it may be used."""
    from sim.results.files import finish

    summary: dict[str, Any] = finish(outcome, out=output.out)
    if output.report and output.out is not None:
        from sim.report.page import write

        write([output.out], output.out)
    if output.json:
        sys.stdout.write(json.dumps(summary, indent=2) + "\n")
    else:
        console = Console()
        report.show(summary, console)
        if output.out is not None:
            console.print(f"written to {output.out}")
    for name, why in summary["unwritten"].items():
        _err.print(f"{name} in --out {output.out} ends early: {why}", highlight=False, soft_wrap=True)
    if summary["unwritten"]:
        return 1
    return 0 if summary["valid"] else 1


def main() -> None:
    """The console script."""
    interrupts.install()
    try:
        code = app(result_action="return_value")
        sys.stdout.flush()
    except BrokenPipeError:
        nobody_reads()
    except FanetError as error:
        _err.print(f"[bold red]fanet:[/] {error}", highlight=False, soft_wrap=True)
        code = 2
    except ModuleNotFoundError as error:
        if (why := missing_extra(error)) is None:
            raise
        _err.print(f"[bold red]fanet:[/] {escape(why)}", highlight=False, soft_wrap=True)
        code = 2
    except KeyboardInterrupt as interrupt:
        code = interrupts.exit_code(interrupt)
    interrupts.leave(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
