"""Children of a launcher: whichever process is killed, its end is reported by name and no process is left running."""

import asyncio
import os
import re
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from kit import slow

from fanet_mw.bus.messages import ClockEpoch, ClockState
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts.bus import Bus
from fanet_mw.hosts.clock import SwarmClock
from fanet_mw.hosts.realtime import SwarmAddress
from sim.cli.companions import Companions
from sim.run.launcher import child_processes
from sim.run.launcher.child_processes import Processes, end_servers
from sim.run.launcher.services import Services
from sim.run.launcher.swarm import SwarmRun, free_endpoint
from sim.scenarios import catalog

MARK = "FANET_TEST_MARK"
SMALL = "nodes = {count = 2}\nclusters = {count = 1}\nduration_s = %s\nwarmup_s = 0\ndrain_s = 0\n"

TERMINATED = "fanet: ended by SIGTERM before there was a result\n"


def marked(mark: str) -> list[int]:
    """Live processes that were started with this mark in their environment, by whomever."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        try:
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue  # ended meanwhile
    return sorted(found)


def ignores(pid: int, number: int) -> bool:
    (mask,) = re.findall(r"^SigIgn:\s*(\w+)$", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    return bool(int(mask, 16) >> (number - 1) & 1)


def parent(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[1])


def exists(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


PATIENCE_S = 90
"""How long to wait for what happens soon by itself: longer than any machine needs, shorter than a test may take."""


def eventually(condition: Callable[[], bool]) -> bool:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        if condition():
            return True
        time.sleep(0.05)
    return condition()


@pytest.fixture
def mark() -> Iterator[str]:
    """Marks whatever a test starts as a command; none of it may outlive the test."""
    mark = uuid.uuid4().hex
    yield mark
    left = marked(mark)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert left == []


def start(mark: str, *arguments: str, deaf: bool = False) -> subprocess.Popen[str]:
    """Start a command; a `deaf` one inherits an ignored SIGINT, as the line `command &` of a script does."""
    command = [sys.executable, "-m", *arguments]
    if deaf:
        command = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *command]
    environment = {**os.environ, MARK: mark}
    return subprocess.Popen(command, text=True, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment)


def said(process: subprocess.Popen[str], words: str) -> None:
    """Wait until a command has said this."""
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        lines.append(line)
        if words in line:
            return
    pytest.fail(f"{words!r} was never said: {lines}")


# --- Processes --------------------------------------------------------------------------------------------------------


def sleeper(*, seconds: float) -> int:
    time.sleep(seconds)
    return 0


def crash() -> int:
    raise RuntimeError("on purpose")


def lose_the_bus() -> int:
    raise BusError("the router is gone")


def leave() -> int:
    end_servers()
    return 0


async def test_a_child_leaves_the_helper_processes_of_multiprocessing_to_its_parent() -> None:
    """From Python 3.13 on, children run what was registered for the exit; here it is called as they call it."""
    ended: dict[str, int] = {}
    processes = Processes(ended.__setitem__)
    processes.start("child", leave, {})
    assert await processes.wait(PATIENCE_S)
    assert ended == {"child": 0}


async def test_a_child_that_gives_way_is_nicer_than_others_and_interrupts_none_of_its_kind() -> None:
    processes = Processes(lambda _name, _code: None)
    processes.start("emulator", sleeper, {"seconds": 300})
    processes.start("agent-1", sleeper, {"seconds": 300}, gives_way=True)
    emulator, agent = processes.pid("emulator"), processes.pid("agent-1")
    assert eventually(lambda: os.sched_getscheduler(agent) == os.SCHED_BATCH)
    assert os.sched_getscheduler(emulator) == os.SCHED_OTHER
    niceness = os.getpriority(os.PRIO_PROCESS, emulator)
    assert os.getpriority(os.PRIO_PROCESS, agent) == min(19, niceness + 4)
    await processes.end_all()


async def test_every_end_is_told_with_its_name_and_exit_code() -> None:
    ended: dict[str, int] = {}
    processes = Processes(ended.__setitem__)
    processes.start("good", sleeper, {"seconds": 0.1})
    processes.start("bad", crash, {})
    processes.start("busless", lose_the_bus, {})
    processes.start("victim", sleeper, {"seconds": 300})
    os.kill(processes.pid("victim"), signal.SIGKILL)
    assert await processes.wait(PATIENCE_S)
    assert ended == {"good": 0, "bad": 1, "busless": 3, "victim": -signal.SIGKILL}
    assert processes.names() == []


async def test_a_server_that_was_stopped_keeps_no_launcher_from_ending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_processes, "_KILLED_S", 0.2)
    ended: dict[str, int] = {}
    processes = Processes(ended.__setitem__)
    processes.start("sleeper", sleeper, {"seconds": 300})
    pid = processes.pid("sleeper")
    server = parent(pid)
    os.kill(server, signal.SIGSTOP)
    try:
        await processes.end_all()
        assert await processes.wait(PATIENCE_S)
    finally:
        os.kill(server, signal.SIGCONT)
    assert ended == {"sleeper": -signal.SIGKILL}


async def test_a_server_that_is_killed_is_why_its_children_ended_and_each_can_be_started_again() -> None:
    ended: list[tuple[str, int, int | None]] = []

    def on_end(name: str, code: int) -> None:
        ended.append((name, code, processes.end_of_server(name)))
        if len(ended) <= 2:
            processes.restart(name)

    processes = Processes(on_end)
    for name in ("one", "two"):
        processes.start(name, sleeper, {"seconds": 300})
    os.kill(parent(processes.pid("one")), signal.SIGKILL)
    assert not await processes.wait(1), "both run again"
    assert sorted(ended) == [(name, -signal.SIGKILL, -signal.SIGKILL) for name in ("one", "two")]
    os.kill(processes.pid("one"), signal.SIGKILL)
    await processes.end_all()
    assert sorted(ended[2:]) == [("one", -signal.SIGKILL, None), ("two", -signal.SIGKILL, None)]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
async def test_a_child_waits_for_its_launcher_whatever_signal_all_of_them_are_sent(number: int) -> None:
    ended: dict[str, int] = {}
    processes = Processes(ended.__setitem__)
    processes.start("sleeper", sleeper, {"seconds": 300})
    pid = processes.pid("sleeper")
    os.kill(pid, number)  # before the child has said that it ignores the signal, and after
    assert eventually(lambda: ignores(pid, number))
    os.kill(pid, number)
    await asyncio.sleep(0.2)
    assert ended == {}, "the signal is the launcher's to hear"
    await processes.end_all()
    assert ended == {"sleeper": -signal.SIGKILL}, "it would have slept on"
    assert not exists(pid)


async def test_a_child_is_called_by_its_name_wherever_processes_are_listed() -> None:
    processes = Processes(lambda *_: None, title="fanet test")
    processes.start("agent-1234567890", sleeper, {"seconds": 300})
    folder = Path(f"/proc/{processes.pid('agent-1234567890')}")
    assert eventually(lambda: folder.joinpath("comm").read_text() == "agent-123456789\n")
    title = b"fanet test agent-1234567890"
    assert eventually(lambda: folder.joinpath("cmdline").read_bytes().rstrip(b"\0") == title)
    processes.start(long := "x" * 5000, sleeper, {"seconds": 300})
    folder = Path(f"/proc/{processes.pid(long)}")
    assert eventually(lambda: folder.joinpath("cmdline").read_bytes().startswith(b"fanet"))
    assert folder.joinpath("comm").read_text() == "x" * 15 + "\n"
    shown = folder.joinpath("cmdline").read_bytes()
    assert shown[-1:] == b"\0", "what follows is the environment"
    assert f"fanet test {long}".encode().startswith(shown[:-1])
    assert len(shown) > 40
    await processes.end_all()


async def test_a_restarted_child_is_the_same_with_a_new_pid() -> None:
    ended: list[tuple[str, int]] = []
    processes = Processes(lambda name, code: ended.append((name, code)))
    processes.start("child", sleeper, {"seconds": 300})
    first = processes.pid("child")
    os.kill(first, signal.SIGKILL)
    assert await processes.wait(PATIENCE_S)
    processes.restart("child")
    assert processes.pid("child") != first
    await processes.end_all()
    assert ended[0] == ("child", -signal.SIGKILL)
    assert [name for name, _ in ended] == ["child", "child"]


# --- commands ---------------------------------------------------------------------------------------------------------


def test_a_launcher_that_is_killed_takes_all_its_processes_with_it(mark: str, tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(SMALL % 1000)
    launcher = start(mark, "sim.cli.app", "launch", str(path))
    said(launcher, "processes up")
    assert len(marked(mark)) >= 2 + 2 + 1 + 1  # agents, emulator and world, the fork server, the launcher
    launcher.kill()
    launcher.communicate()
    assert eventually(lambda: marked(mark) == []), "children notice that their parent is gone"


LAUNCHER_OF_A_SLEEPER = """
import asyncio, runpy, sys
from sim.run.launcher.child_processes import Processes

async def main():
    processes = Processes(lambda *_: None)
    processes.start("sleeper", runpy.run_path, {"path_name": sys.argv[1]})
    await asyncio.sleep(300)

asyncio.run(main())
"""


def test_a_launcher_that_is_killed_takes_a_child_with_it_that_hears_nothing(mark: str, tmp_path: Path) -> None:
    """No bus tells this child that the launcher has gone."""
    sleeps = tmp_path / "sleeps.py"
    sleeps.write_text("import sys, time; print('asleep', file=sys.stderr, flush=True); time.sleep(300)")
    launcher = subprocess.Popen(
        [sys.executable, "-c", LAUNCHER_OF_A_SLEEPER, str(sleeps)],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, MARK: mark, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    said(launcher, "asleep")
    launcher.kill()
    launcher.communicate()
    assert eventually(lambda: marked(mark) == [])


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """The exit code and the last words of a command that must end."""
    _, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, last_words(err)


def last_words(err: str) -> str:
    """What a process said at its end: who is still missing it says every few seconds before."""
    return "".join(line for line in err.splitlines(keepends=True) if "missing: " not in line)


@pytest.mark.parametrize(
    ("number", "deaf"),
    [
        pytest.param(signal.SIGINT, True, id="SIGINT, ignored before"),
        pytest.param(signal.SIGTERM, False, id="SIGTERM"),
    ],
)
@pytest.mark.slow
def test_a_router_that_is_interrupted_stops_the_services_it_kept_time_for(
    mark: str, tmp_path: Path, number: int, deaf: bool
) -> None:
    path, endpoint = tmp_path / "small.toml", free_endpoint()
    path.write_text(SMALL % 1000)
    router = start(mark, "sim.cli.app", "router", str(path), "--listen", endpoint, deaf=deaf)
    said(router, "serving")
    common = (str(path), "--connect", endpoint)
    services = [
        start(mark, "sim.cli.app", "emulator", *common, deaf=deaf),
        start(mark, "sim.cli.app", "world", *common, deaf=deaf),
        *(start(mark, "agents", *common, "--id", str(node), deaf=deaf) for node in (1, 2)),
    ]
    said(router, "the clock runs")
    time.sleep(1)
    assert [service.poll() for service in services] == [None] * 4
    interrupted = services.pop()
    interrupted.send_signal(number)
    assert ended(interrupted) == (128 + number, ""), "a service hears the same signals, and leaves without a traceback"
    assert router.poll() is None
    used_s = cpu_s(router.pid)
    router.send_signal(number)
    for service in services:
        assert ended(service) == (0, "")
    assert router.stderr is not None
    assert last_words(router.stderr.read()) == ("" if number == signal.SIGINT else TERMINATED)
    _, status, usage = os.wait4(router.pid, 0)
    router.returncode = os.waitstatus_to_exitcode(status)
    router.stderr.close()
    assert router.returncode == 128 + number
    assert usage.ru_utime + usage.ru_stime - used_s < 0.1, "a last garbage collection takes seconds on a busy machine"


def wait_for(name: str, *, endpoint: str) -> None:
    """Until this service has announced itself to the router, within a minute."""
    there = threading.Event()
    with Bus.join(endpoint) as bus:
        bus.watch(f"{Topics('small').alive(name)}/**", lambda _, alive: there.set() if alive else None)
        assert there.wait(60)


def cpu_s(pid: int) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("number", [signal.SIGINT, *slow(signal.SIGTERM)])
def test_a_router_or_service_that_still_waits_for_the_others_ends_when_interrupted(
    mark: str, tmp_path: Path, number: int
) -> None:
    path, endpoint = tmp_path / "small.toml", free_endpoint()
    path.write_text(SMALL % 1000)
    router = start(mark, "sim.cli.app", "router", str(path), "--listen", endpoint, deaf=True)
    said(router, "serving")
    agent = start(mark, "sim.cli.app", "agent", str(path), "--connect", endpoint, "--id", "1", deaf=True)
    wait_for("agent-1", endpoint=endpoint)
    line = "" if number == signal.SIGINT else TERMINATED
    agent.send_signal(number)
    assert ended(agent) == (128 + number, line)
    router.send_signal(number)
    assert ended(router) == (128 + number, line)


def test_services_of_a_router_that_is_killed_end_with_a_message_and_exit_code_3(mark: str, tmp_path: Path) -> None:
    path, endpoint = tmp_path / "small.toml", free_endpoint()
    path.write_text(SMALL % 1000)
    router = start(mark, "sim.cli.app", "router", str(path), "--listen", endpoint)
    said(router, "serving")
    agent = start(mark, "agents", str(path), "--connect", endpoint, "--id", "2")
    wait_for("agent-2", endpoint=endpoint)
    assert agent.poll() is None
    router.kill()
    router.communicate()
    _, err = agent.communicate(timeout=PATIENCE_S)
    assert agent.returncode == 3
    assert err.splitlines() == [f"the Zenoh router at {endpoint} is gone"]


def test_a_wrong_request_to_a_service_is_one_message_and_exit_code_2(mark: str, tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(SMALL % 1000)
    agent = start(mark, "agents", str(path), "--id", "9")
    _, err = agent.communicate(timeout=PATIENCE_S)
    assert agent.returncode == 2
    assert err == "--id 9: must be in [1, nodes.count = 2]\n"


@pytest.mark.slow
def test_a_program_that_launches_whenever_it_is_imported_is_told_so_once(tmp_path: Path) -> None:
    program = tmp_path / "unguarded.py"
    program.write_text(
        "import asyncio, fanet_mw\n"
        "async def main():\n"
        "    async with fanet_mw.launch('quick'):\n"
        "        print('inside')\n"
        "asyncio.run(main())\n",
        encoding="utf-8",
    )
    ended = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, timeout=PATIENCE_S)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.count("Traceback") == 1, "that of the program itself, and none of a child"
    assert ended.stderr.rstrip().endswith('put the launch below `if __name__ == "__main__":`')


async def test_a_child_that_cannot_be_started_again_is_lost_and_said_to_be_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    scenario = catalog.find("quick", ["nodes.count=2", "clusters.count=1"])
    with Bus.serve(endpoint := free_endpoint()) as bus:
        services = Services(scenario, SwarmAddress("test", endpoint))
        run = SwarmRun(services, bus, respawn=True, tell=said.append)
        run._clock = SwarmClock(ClockEpoch(time.time_ns(), 1.0, ClockState.RUNNING))
        for name in ("agent-1", "agent-2", "agent-3"):
            run.processes.start(name, sleeper, {"seconds": 300})
            folder = Path(f"/proc/{run.processes.pid(name)}")
            assert eventually(lambda folder=folder: folder.joinpath("comm").read_text().startswith("agent-"))
        (tmp_path / "here").rmdir()
        run._stopped.add("agent-3")
        os.kill(run.processes.pid("agent-3"), signal.SIGKILL)
        while not said:  # noqa: ASYNC110  (the process ends in real time)
            await asyncio.sleep(0.01)
        run._start_again("agent-3")
        assert "agent-3 is stopped at" in said.pop(0)
        assert said.pop(0).startswith("agent-3 cannot be started: ")
        os.kill(run.processes.pid("agent-2"), signal.SIGKILL)
        while len(said) < 2:  # noqa: ASYNC110  (the process ends in real time)
            await asyncio.sleep(0.01)
        assert run.processes.names() == ["agent-1"]
        assert [name for name, _ in run._deaths.ended] == ["agent-3", "agent-2"], "each is lost once"
        await run.processes.end_all()
    assert said[1] == (
        "agent-2 cannot be started: the working folder has been deleted, and the swarm's processes start in it; "
        "the others carry on"
    )


@pytest.mark.parametrize(
    ("set_up", "said"),
    [
        ("rmdir $PWD", "the working folder has been deleted"),
        ("echo 'raise SystemExit(9)' > numpy.py", "ready"),
        ("export NUMBA_NUM_THREADS=0", "ended with exit code 1 while it imported what they need"),
    ],
)
def test_processes_start_from_a_folder_with_anything_in_it_or_say_why_not(
    tmp_path: Path, set_up: str, said: str
) -> None:
    (tmp_path / "program.py").write_text(
        "import asyncio\n"
        "from sim.run.launcher.child_processes import Processes\n"
        "async def main():\n"
        "    processes = Processes(lambda *_: None)\n"
        "    print(await processes.warm_up(), 'ready')\n"
        "if __name__ == '__main__':\n"
        "    asyncio.run(main())\n"
    )
    (tmp_path / "here").mkdir()
    done = subprocess.run(
        ["sh", "-c", f'{set_up}; exec "$@"', "sh", sys.executable, tmp_path / "program.py"], cwd=tmp_path / "here",
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert said in (done.stdout + done.stderr).splitlines()[-1]


@pytest.mark.parametrize(("words", "gives_way"), [("record x.mcap", True), ("view", True), ("gateway", False)])
def test_who_only_listens_gives_way_to_the_swarm_and_who_serves_it_does_not(words: str, *, gives_way: bool) -> None:
    with Companions([[*words.split(), "--nonsense"]]) as companions:
        companions.start(SwarmAddress("tcp/127.0.0.1:1", "s"), catalog.find("quick"))
        niceness = os.getpriority(os.PRIO_PROCESS, companions._running[0].pid)
        assert (niceness > os.getpriority(os.PRIO_PROCESS, 0)) == gives_way
