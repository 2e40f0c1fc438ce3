"""Real processes over real Zenoh: short, bounded, and nothing left behind."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from kit import slow
from undisturbed import LIMIT_S, undisturbed, with_time_enough

from agents.__main__ import run as run_agent
from emulator.compile_kernel import must_compile, warm_up
from fanet_mw import tlog
from fanet_mw.errors import BusError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import ProcessEnded, ProcessStarted
from fanet_mw.units import NodeId, S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.launcher.swarm import SwarmRun, launch
from sim.scenarios import catalog

FAST = [
    "duration_s=5", "warmup_s=2", "drain_s=1", "clusters.flooding_period_s=0.5", "radio.lead_ms=150", "nodes.count=5",
    "clusters.count=1",
]  # fmt: skip
"""The lead is long, because these tests ask what happens and not whether a busy machine is on time."""
FEW = ("--set", "nodes.count=3", "--set", "clusters.count=1")
NINE = ("nodes.count=9", "clusters.count=2")
PATIENCE_S = 90
"""How long to wait for what ends soon by itself: longer than any machine needs, shorter than a test may take."""


def scenario(*overrides: str) -> Scenario:
    return catalog.find("quick", [*FAST, *overrides])


def run(
    chosen: Scenario, *, swarm: str = "test", at_s: float | None = None, act: Any = None, **options: Any
) -> tuple[Outcome, list[str]]:
    """Launch; when `at_s` wall seconds after the start of the run have passed, do `act(swarm)`."""
    events: list[str] = []

    def started(swarm: SwarmRun) -> None:
        async def later() -> None:
            while swarm._clock is None or swarm._clock.now_ns() < at_s * 1e9:  # noqa: ASYNC110  (real time passes)
                await asyncio.sleep(0.02)
            act(swarm)

        if act is not None:
            swarm.task = asyncio.ensure_future(later())  # type: ignore[attr-defined]  # kept from the collector

    outcome = asyncio.run(launch(chosen, swarm=swarm, on_event=events.append, on_started=started, **options))
    return outcome, events


def kill(name: str) -> Any:
    return lambda swarm: os.kill(swarm.processes.pid(name), signal.SIGKILL)


def _left_behind() -> list[list[str]]:
    listing = subprocess.run(["ps", "-eo", "pid,ppid,stat,args"], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 3) for line in listing.splitlines()]
    ours = ("multiprocessing.forkserver", "fanet test ")  # a server of children, and what a child calls itself
    forked = [row for row in rows if any(name in row[3] for name in ours) and not row[2].startswith("Z")]
    servers = {row[0] for row in forked if int(row[1]) == os.getpid()}  # ours: they stay; their children are swarms
    return [row for row in forked if row[1] in servers or row[1] == "1"]  # other people's runs are their own affair


@pytest.fixture(autouse=True)
def _nothing_left_behind() -> Iterator[None]:
    yield
    ends_s = time.monotonic() + 10.0  # a server that still starts finds only then that its launcher was killed
    while (left := _left_behind()) and time.monotonic() < ends_s:
        time.sleep(0.2)
    assert left == []


@pytest.mark.timeout(LIMIT_S)
def test_turns_announced_ahead_are_kept_by_real_processes() -> None:
    """Collision-free floods leave no time between hops but the lead: what is late is lost."""
    keys = ["nodes.count=9", "nodes.layout=grid", "traffic.sources=8", "clusters.count=8", "radio.lead_ms=150"]
    times = ["duration_s=11", "warmup_s=7.5", "drain_s=1", "clusters.relay=scheduled"]
    _, summary = undisturbed(lambda slower: run(catalog.find("clusters", [*keys, *times, slower]))[0])
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.9
    bound = summary["bound"]  # a packet whose frame is late is lost, and counts as never there
    assert bound.get("violations", 0) == bound.get("never", 0)


@pytest.mark.slow
def test_links_are_measured_and_a_timetable_made_of_them_by_real_processes() -> None:
    """Hellos are counted, told in joins, put together by the leader and announced; what each process then states holds
    wherever the machine was on time, which the verdict says.
    """
    keys = ["nodes.count=6", "nodes.layout=grid", "nodes.columns=3", "clusters.count=5", "traffic.sources=5"]
    lossy = [
        "radio.channel=log_distance",
        "radio.fading=rician",
        "radio.scatterer_speed_m_s=100",
        "routing.hello_interval_s=0.4",
        "radio.lead_ms=100",
    ]
    times = ["duration_s=25", "warmup_s=17", "drain_s=5", "traffic.payload_bytes=200", "seed=3"]
    outcome, _ = run(catalog.find("clusters", [*keys, *lossy, *times]))
    summary = finish(outcome, out=None)
    stated_ms = {name: report["likely_ms"] for name, report in outcome.reports.items() if name.startswith("agent-")}
    assert sorted(name for name, ms in stated_ms.items() if ms is not None) == [f"agent-{n}" for n in range(2, 7)]
    assert summary["bound"] == {}, "no bound is stated where frames are lost"
    assert summary["frames"]["closes"]
    assert summary["pdr"] > 0.5
    assert summary["likely"]["stated_share"] > 0.5
    assert not summary["valid"] or summary["likely"]["within_share"] >= summary["likely"]["share"]


@pytest.mark.timeout(LIMIT_S)
def test_a_swarm_of_processes_delivers_and_accounts_for_every_frame(tmp_path: Path) -> None:
    times = ["duration_s=7", "warmup_s=4"]  # 2 s are too short for the timetable with 7 of 24 seeds
    outcome, _ = undisturbed(lambda slower: run(scenario(*times, *NINE, slower))[0])
    summary = finish(outcome, out=tmp_path / "out")
    assert summary["mode"] == "realtime"
    assert summary["frames"]["closes"]
    assert summary["frames"]["sent"] > 100
    assert summary["pdr"] > 0.7
    frames = summary["frames"]
    assert summary["lateness"]["frames"] >= frames["sent"] - frames["dropped"].get("bus", 0)
    assert {report["host"]["malformed"] for report in outcome.reports.values()} == {0}
    assert json.loads((tmp_path / "out/summary.json").read_text())["trace_sha256"] == summary["trace_sha256"]
    frames = list(tlog.read(tmp_path / "out/mavlink.tlog"))
    assert len(frames) > 50


def test_a_killed_agent_is_named_and_the_others_carry_on() -> None:
    outcome, events = run(scenario("duration_s=4"), at_s=2, act=kill("agent-4"))
    assert outcome.aborted is None
    assert outcome.ended == [("agent-4", -signal.SIGKILL)]
    assert any("agent-4 ended with signal SIGKILL" in event for event in events)
    assert [record.name for record in outcome.records if isinstance(record, ProcessEnded)] == ["agent-4"]
    summary = finish(outcome, out=None)
    assert summary["frames"]["closes"]
    assert outcome.reports["agent-5"]["final"]


@pytest.mark.timeout(LIMIT_S)
@pytest.mark.slow
def test_a_killed_agent_is_started_again_with_respawn_and_takes_part() -> None:
    outcome, events = with_time_enough(
        lambda slower: run(scenario("duration_s=6.5", *NINE, slower), at_s=2, act=kill("agent-4"), respawn=True),
        lambda found: found[0].reports["agent-4"]["role"] != "isolated",
    )
    assert outcome.aborted is None
    assert any("agent-4" in event and "started again" in event for event in events)
    report = outcome.reports["agent-4"]
    assert report["final"]
    assert report["role"] != "isolated", "it has learned its place from the schedule"
    told = [type(record) for record in outcome.records if isinstance(record, ProcessEnded | ProcessStarted)]
    assert told == [ProcessEnded, ProcessStarted]


def test_without_the_emulator_the_run_ends_at_once_with_a_partial_result() -> None:
    outcome, events = run(scenario("duration_s=1000"), at_s=1.5, act=kill("emulator"))
    assert outcome.aborted is not None
    assert outcome.ended_ns is not None
    assert outcome.ended_ns < 100 * S
    assert "emulator ended with signal SIGKILL" in outcome.aborted
    assert outcome.aborted in events
    assert not finish(outcome, out=None)["lateness"]["valid"]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "sim", *arguments]


def test_ctrl_c_ends_everything_cleanly_with_a_partial_result() -> None:
    process = subprocess.Popen(
        command("launch", "quick", *FEW, "--json"), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    for line in process.stderr:
        if b"processes up" in line:
            break
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert b"interrupted by SIGINT" in err
    assert b"Traceback" not in err
    summary = json.loads(out)
    assert summary["aborted"] == "interrupted by SIGINT"
    assert 1 < summary["simulated_s"] < summary["duration_s"]


@pytest.mark.parametrize("number", [signal.SIGTERM, *slow(signal.SIGHUP)])
def test_a_signal_to_all_processes_of_a_swarm_leaves_a_partial_result_that_closes(number: int, tmp_path: Path) -> None:
    """As `timeout`, systemd and `docker stop` send it; and as a terminal does that is closed, where nothing more can be
    said.
    """
    out = tmp_path / "out"
    process = subprocess.Popen(
        command("launch", "quick", *FEW, "--set", "radio.lead_ms=150", "--out", str(out)), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, process_group=0,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stderr is not None
    for line in process.stderr:
        if b"processes up" in line:
            break
    time.sleep(2.5)
    if number == signal.SIGHUP:
        process.stdout.close()
        process.stderr.close()
    os.killpg(process.pid, number)
    process.wait(PATIENCE_S)
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    assert summary["aborted"] == f"interrupted by {signal.Signals(number).name}"
    assert 2 < summary["simulated_s"] < summary["duration_s"]
    assert not summary["processes"]["ended"]
    assert not summary["absent"]
    assert summary["frames"]["closes"], summary["frames"]
    assert summary["copies"]["closes"]
    with pytest.raises(ProcessLookupError):  # nobody of the group is left
        os.killpg(process.pid, 0)
    for stream in (process.stdout, process.stderr):
        stream.close()


def wait_until_signals_are_handled(pid: int) -> None:
    """Python itself catches SIGINT from its first moment on, SIGTERM only a program that wants to."""
    caught = 0
    while not caught >> (signal.SIGTERM - 1) & 1:
        time.sleep(0.01)
        status = Path(f"/proc/{pid}/status").read_text("ascii")
        caught = int(next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")), 16)


def at_start(number: int, *, services: bool, after_s: float = 0.0) -> tuple[int, str]:
    """The exit code and words of a launch that is interrupted while it starts, as by Ctrl-C: all its processes hear it.

    With `services` that is some time after it has begun to start them, and else after its first moment.
    """
    process = subprocess.Popen(
        command("launch", "quick", *FEW), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0
    )
    assert process.stderr is not None
    wait_until_signals_are_handled(process.pid)
    begun = process.stderr.readline() if services else ""
    while begun.startswith("the scenario states no radio.lead_ms"):
        begun = process.stderr.readline()
    assert begun.startswith("swarm quick on") is services
    time.sleep(after_s)
    os.killpg(process.pid, number)
    _, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, begun + err


@pytest.mark.slow
def test_ctrl_c_while_a_swarm_starts_ends_it_without_a_traceback() -> None:
    """Wherever it comes: in the imports, when the server of children starts, between children, before the clock."""
    moments = ((False, 0.0), (False, 0.4), (True, 0.0), (True, 0.2))
    with ThreadPoolExecutor() as pool:  # the four launches have nothing in common
        ended = list(pool.map(lambda at: at_start(signal.SIGINT, services=at[0], after_s=at[1]), moments))
    for at, (code, said) in zip(moments, ended, strict=True):
        assert code == 130, (at, said)
        assert "Traceback" not in said, (at, said)
        assert len(said.splitlines()) <= 3, (at, said)


@pytest.mark.parametrize("services", [False, True])
def test_a_launcher_that_is_terminated_while_it_starts_says_so_once_and_in_its_exit_code(services: bool) -> None:
    code, said = at_start(signal.SIGTERM, services=services)
    assert code == 143, said
    assert "Traceback" not in said
    assert said.count("SIGTERM") == 1, said


def late_agent(*, node: int, **arguments: Any) -> int:
    """Node 2 finds no router when it is started for the first time, as on a machine that has other things to do; node 3
    takes its time."""
    there = Path(tempfile.gettempdir()) / f"{arguments['address'].swarm}-agent-2"
    if node == 2 and not there.exists():
        there.touch()
        raise BusError("no Zenoh router")
    if node == 3:
        time.sleep(2)
    return run_agent(node=NodeId(node), **arguments)


def test_an_agent_that_is_late_to_start_is_waited_for_and_one_that_found_no_router_is_started_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sim.run.launcher.services.run_agent", late_agent)
    monkeypatch.setattr("sim.run.launcher.swarm.WORD_EVERY_S", 1.0)
    name = f"late-{uuid.uuid4().hex}"
    try:
        outcome, events = run(scenario("duration_s=1", "warmup_s=0.2", "drain_s=0.2"), swarm=name)
    finally:
        (Path(tempfile.gettempdir()) / f"{name}-agent-2").unlink(missing_ok=True)
    assert outcome.aborted is None
    assert outcome.ended == [], "it has missed nothing"
    assert outcome.reports["agent-2"]["final"]
    assert any("agent-2 ended with exit code 3 before the start; started again" in event for event in events)
    assert any("waiting for" in event and "agent-3" in event for event in events)


@pytest.mark.parametrize("service", ["simulate", "emulator"])
def test_who_has_to_compile_says_so_first_and_can_be_interrupted(service: str, tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    process = subprocess.Popen(
        command(service, "quick"), env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert "compiling the emulator's kernel, once" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, err) == (130, "")


def test_nobody_has_to_compile_twice() -> None:
    warm_up()
    assert not must_compile()


def test_a_launched_swarm_is_found_by_other_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    process = subprocess.Popen(
        command("launch", "quick", *FEW, "--duration", "60", "--swarm", "test"), stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    words = [process.stderr.readline()]
    while "processes up" not in words[-1]:
        words.append(process.stderr.readline())
    links = subprocess.Popen(
        command("links", "--reports", "1"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )  # it waits for a report while the other commands are tried
    listed = subprocess.run(command("swarms", "--json"), capture_output=True, text=True, check=True)
    (entry,) = json.loads(listed.stdout)
    assert (entry["swarm"], entry["pid"]) == ("test", process.pid)
    assert f"swarm test on {entry['endpoint']}\n" in words
    for arguments in (("air", "cut", "3"), ("air", "restore", "--swarm", "test")):
        done = subprocess.run(command(*arguments), capture_output=True, text=True, check=False, timeout=60)
        assert (done.returncode, done.stderr) == (0, ""), arguments
    assert (links.communicate(timeout=PATIENCE_S)[1], links.returncode) == ("", 0)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE_S)
    assert list((tmp_path / "fanet-mw").iterdir()) == []


def refused(*arguments: str) -> str:
    """What a command that cannot work says; it must be one message, quickly, without a traceback."""
    done = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=110, check=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    return " ".join(done.stderr.split())


def test_a_port_in_use_is_one_message() -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        endpoint = f"tcp/127.0.0.1:{holder.getsockname()[1]}"
        assert f"cannot serve on {endpoint}: it is already in use" in refused("launch", "quick", "--listen", endpoint)


@pytest.mark.slow
def test_no_router_is_one_message_that_names_the_endpoint() -> None:
    services = [["emulator"], ["world"], ["agent", "--id", "3"], ["launch"]]
    with ThreadPoolExecutor() as pool:  # each waits 2.5 s for an answer
        messages = list(
            pool.map(
                lambda service: refused(service[0], "quick", *service[1:], "--connect", "tcp/127.0.0.1:1"), services
            )
        )
    assert [message for message in messages if "no Zenoh router at tcp/127.0.0.1:1" not in message] == []


def test_an_unknown_scenario_and_a_bad_one_are_one_message_each(tmp_path: Path) -> None:
    assert "unknown scenario 'recsue'; did you mean rescue?" in refused("simulate", "recsue")
    bad = tmp_path / "bad.toml"
    bad.write_text('duration_s = -1\n[nodes]\ncuont = 4\nlayout = "hexagon"\n')
    message = refused("launch", str(bad))
    assert "duration_s = -1" in message
    assert "nodes.cuont: unknown key; did you mean count?" in message
    assert "nodes.layout = 'hexagon'" in message


def test_services_started_one_by_one_make_a_swarm() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    small = ["--set", "nodes.count=3", "--set", "clusters.count=1", "--duration", "2", "--set", "warmup_s=0",
             "--set", "drain_s=0"]  # fmt: skip
    router = subprocess.Popen(command("router", "quick", "--listen", endpoint, *small), stderr=subprocess.PIPE)
    assert router.stderr is not None
    assert b"serving" in router.stderr.readline()
    services = [["emulator", "quick"], ["world", "quick"], *(["agent", "quick", "--id", str(i)] for i in (1, 2, 3))]
    children = [
        subprocess.Popen([*command(*service), "--connect", endpoint, *small], stderr=subprocess.PIPE)
        for service in services
    ]
    for child in children:
        _, err = child.communicate(timeout=PATIENCE_S)
        assert child.returncode == 0, err.decode()
    router.communicate(timeout=PATIENCE_S)
    assert router.returncode == 0


def test_a_swarm_that_does_not_come_up_names_who_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    from sim.run.launcher import swarm as module

    monkeypatch.setattr(module, "READY_TIMEOUT_S", 1.0)
    monkeypatch.setattr(module, "expected_names", lambda _: ["emulator", "nobody"])
    with pytest.raises(BusError, match="nobody"):
        run(scenario())
