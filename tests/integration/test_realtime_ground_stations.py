"""Ground stations of others fly a swarm: MAVSDK, MAVProxy, and pymavlink's tools on what they have recorded.

With FANET_TRANSCRIPTS=1 what they say is written to docs/how-to/transcripts/.
"""

import asyncio
import importlib.util
import itertools
import os
import pty
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fanet_mw.autopilot.link import AutopilotLink
from fanet_mw.autopilot.serving import Autopilot
from fanet_mw.bus.messages import Battery, FlightState, Gps
from fanet_mw.errors import ConfigError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.connections import Address
from fanet_mw.mavlink import ORIGIN
from fanet_mw.results import records
from fanet_mw.trace import Posed
from sim.cli.app import app

HERE = Path(__file__).resolve().parent
TRANSCRIPTS = HERE.parent.parent / "docs" / "how-to" / "transcripts"
MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent))
PATIENCE_S = 90
FIELD = """
duration_s = 3600
time_scale = 4.0
[nodes]
count = 3
layout = "line"
spacing_m = 60
on_ground = true
altitude_m = 20
[traffic]
arrivals = "none"
[routing]
protocol = "direct"
[radio]
lead_ms = 500
[mobility]
model = "onboard"
speed_m_s = 12
[world]
area_m = 1000
engine = "kinematic"
"""
pytestmark = pytest.mark.timeout(280)


def keep(name: str, said: str) -> None:
    """Write a transcript, if they are wanted."""
    if os.environ.get("FANET_TRANSCRIPTS"):
        TRANSCRIPTS.mkdir(exist_ok=True)
        (TRANSCRIPTS / f"{name}.txt").write_text(said, encoding="utf-8")


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


_NUMBERS = itertools.count(1)


class Field:
    """A swarm that stands on the ground, with its doors."""

    def __init__(self, folder: Path, text: str = FIELD, *more: str) -> None:
        self.udp, self.tcp = free_port(socket.SOCK_DGRAM), free_port()
        self.name = f"field-{os.getpid()}-{next(_NUMBERS)}"
        scenario = folder / "field.toml"
        scenario.write_text(text, encoding="utf-8")
        self.log = folder / "launch.log"
        self._processes: list[subprocess.Popen[bytes]] = []
        words = [str(scenario), "--swarm", self.name, "--mavlink", f"udpout:127.0.0.1:{self.udp}", *more]
        try:
            self._start("launch", *words)
            self.await_("processes up")
            self._start("gateway", self.name, "--mavlink", f"tcpin:127.0.0.1:{self.tcp}", "--flavor", "ardupilot")
            self.await_(f" on tcpin:127.0.0.1:{self.tcp}")
        except BaseException:
            self.end()
            raise

    def _start(self, *words: str) -> None:
        with self.log.open("ab") as file:
            command = [sys.executable, "-m", "fanet_mw", *words]
            self._processes.append(subprocess.Popen(command, stdout=file, stderr=file))

    def await_(self, text: str) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while text not in self.log.read_text():
            assert time.monotonic() < end_s, f"{text!r} is not in {self.log.read_text()}"
            time.sleep(0.1)

    def end(self) -> None:
        for process in reversed(self._processes):
            process.send_signal(signal.SIGINT)
            process.wait(30)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Field]:
    swarm = Field(tmp_path_factory.mktemp("field"))
    yield swarm
    swarm.end()


@pytest.mark.skipif(importlib.util.find_spec("mavsdk") is None, reason="MAVSDK is not installed")
def test_mavsdk_flies_a_uav_from_parameters_to_the_landing(field: Field) -> None:
    command = [sys.executable, str(HERE / "mavsdk_pilot.py"), f"udpin://127.0.0.1:{field.udp}", "3"]
    flown = subprocess.run(command, capture_output=True, text=True, check=False, timeout=250)
    said = "".join(line for line in flown.stdout.splitlines(keepends=True) if "[0m" not in line)
    assert flown.returncode == 0, said + flown.stderr + field.log.read_text()
    keep("mavsdk", said)
    assert "uploaded 3 items, downloaded 3" in said
    assert said.rstrip().endswith("disarmed")


LINE = """
duration_s = 900
time_scale = 2.0
[nodes]
count = 3
layout = "explicit"
positions_m = [[150.0, 0.0, 0.0], [300.0, 0.0, 0.0], [300.0, 120.0, 0.0]]
on_ground = true
altitude_m = 20
[ground]
at_m = [0.0, 0.0]
[traffic]
arrivals = "none"
[routing]
protocol = "flooding"
[radio]
channel = "range"
range_m = 220
lead_ms = 120
[mobility]
model = "onboard"
speed_m_s = 12
[world]
area_m = 2000
engine = "kinematic"
"""


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mavsdk") is None, reason="MAVSDK is not installed")
def test_mavsdk_flies_a_uav_two_hops_away_over_the_air(tmp_path: Path) -> None:
    swarm = Field(tmp_path, LINE)
    try:
        assert "MAVLink over the air by node 4" in swarm.log.read_text()
        command = [sys.executable, str(HERE / "mavsdk_pilot.py"), f"udpin://127.0.0.1:{swarm.udp}", "3", "2"]
        flown = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    finally:
        swarm.end()
    said = "".join(line for line in flown.stdout.splitlines(keepends=True) if "[0m" not in line)
    assert flown.returncode == 0, said + flown.stderr + swarm.log.read_text()
    keep("mavsdk-in-band", said)


@pytest.mark.skipif(importlib.util.find_spec("mavsdk") is None, reason="MAVSDK is not installed")
def test_what_mavsdk_tells_as_a_flight_controller_is_what_a_computer_beside_it_measures(tmp_path: Path) -> None:
    async def heard() -> set[type]:
        kinds: dict[type, Any] = {}
        link = AutopilotLink(flavor=Flavor.PX4, origin=ORIGIN)
        address = Address("udpin", "127.0.0.1", free_port(socket.SOCK_DGRAM))
        said: list[str] = []
        beside = Autopilot("UAV 1", link, address, now_ns=time.monotonic_ns, tell=said.append)
        await beside.connection.open()
        words = (str(HERE / "mavsdk_autopilot.py"), f"udpout://127.0.0.1:{address.port}", "1")
        with (tmp_path / "autopilot.log").open("wb") as file:
            flying = await asyncio.create_subprocess_exec(sys.executable, *words, stdout=file, stderr=file)
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s and not (len(kinds) == 3 and kinds[FlightState].unix_ns):
            kinds |= {type(reading): reading for reading in beside.tick()}
            await asyncio.sleep(0.05)
        flying.kill()
        await flying.wait()
        beside.connection.close()
        state = kinds[FlightState]
        assert (state.roll_rad, state.yaw_rad) == pytest.approx((0.0, 1.0), abs=1e-3)
        assert state.satellites == 12
        assert abs(link.counts["clock_behind_gps_ms"]) < 2_000
        assert not any("clock differs" in line for line in said)
        return {*kinds}

    assert asyncio.run(heard()) == {Gps, Battery, FlightState}


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mavsdk") is None, reason="MAVSDK is not installed")
def test_mavsdk_on_both_sides_and_the_swarm_in_band_between_them(tmp_path: Path) -> None:
    """Flight controllers of MAVSDK are the world; a ground station of MAVSDK flies the one that is two hops away."""
    first = free_port(socket.SOCK_DGRAM)
    logs = [tmp_path / f"autopilot-{number}.log" for number in (1, 2, 3)]
    flying = []
    for number, (log, east_m) in enumerate(zip(logs, (150, 300, 300), strict=True)):
        command = [sys.executable, str(HERE / "mavsdk_autopilot.py"), f"udpout://127.0.0.1:{first + number}"]
        with log.open("wb") as file:
            flying.append(subprocess.Popen([*command, str(number + 1), str(east_m)], stdout=file, stderr=file))
    text = LINE.replace('engine = "kinematic"\n', "").replace("time_scale = 2.0", "time_scale = 1.0")
    try:
        swarm = Field(
            tmp_path, text, "--no-world", "--autopilots", f"udpin:127.0.0.1:{first}+", "--out", str(tmp_path / "run")
        )
        try:
            command = [sys.executable, str(HERE / "mavsdk_pilot.py"), f"udpin://127.0.0.1:{swarm.udp}", "3", "2"]
            flown = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
        finally:
            swarm.end()
    finally:
        for process in flying:
            process.kill()
            process.wait()
    said = "".join(line for line in flown.stdout.splitlines(keepends=True) if "[0m" not in line)
    autopilot = "".join(line for line in logs[1].read_text().splitlines(keepends=True) if "[0m" not in line)
    assert flown.returncode == 0, said + flown.stderr + swarm.log.read_text() + autopilot
    assert "armed True" in autopilot
    assert max(one.up_m for one in records(tmp_path / "run", Posed) if one.node == 2) > 10
    assert "mode OFFBOARD" in autopilot
    assert autopilot.rstrip().endswith("landed")
    keep("closed-loop", f"The ground station:\n\n{said}\nThe flight controller, two hops away:\n\n{autopilot}")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("mavsdk") is None, reason="MAVSDK is not installed")
def test_mavsdk_sees_45_uavs_on_one_port(tmp_path: Path) -> None:
    swarm = Field(tmp_path, FIELD.replace("count = 3", "count = 45").replace("time_scale = 4.0", "time_scale = 0.5"))
    try:
        command = [sys.executable, str(HERE / "mavsdk_pilot.py"), f"udpin://127.0.0.1:{swarm.udp}", "45", "--light"]
        seen = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    finally:
        swarm.end()
    assert seen.returncode == 0, seen.stdout + seen.stderr + swarm.log.read_text()
    assert "system 45: a position" in seen.stdout
    keep("mavsdk-45", "".join(line for line in seen.stdout.splitlines(keepends=True) if "[0m" not in line))


PLAN = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t37.5665\t126.978\t0\t1
1\t0\t3\t16\t0\t0\t0\t0\t37.5668\t126.978\t20\t1
2\t0\t3\t16\t0\t0\t0\t0\t37.5668\t126.9784\t22\t1
3\t0\t3\t21\t0\t0\t0\t0\t37.5665\t126.9784\t0\t1
"""

LAST_ITEM = re.compile(rb"\xfd\x01...\x02\x01\x2e\x00\x00\x03", re.DOTALL)
"""MISSION_ITEM_REACHED of system 2 with item 3, as a MAVLink 2 frame without trailing zeros."""


class Terminal:
    """A program on a pseudo-terminal, to which a person types."""

    def __init__(self, command: list[str], folder: Path) -> None:
        self.said = ""
        self.pid, self._end = pty.fork()
        if self.pid == 0:
            os.chdir(folder)
            os.execve(
                command[0], command, {**os.environ, "TERM": "dumb", "PYTHONWARNINGS": "ignore", "HOME": str(folder)}
            )

    def type(self, words: str, wait_for: str, *, seconds: float = PATIENCE_S) -> str:
        """Type something; returns what is said until a text comes."""
        before = len(self.said)
        if words:
            os.write(self._end, f"{words}\n".encode())
        end_s = time.monotonic() + seconds
        while not re.search(
            wait_for, self.said[before:].replace(f"{words}\r\n", "", 1) if words else self.said[before:]
        ):
            assert time.monotonic() < end_s, f"{wait_for!r} after {words!r} is not in {self.said}"
            ready, _, _ = select.select([self._end], [], [], 0.2)
            if ready:
                self.said += os.read(self._end, 65536).decode(errors="replace")
        return self.said[before:]

    def close(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self._end)


@pytest.mark.skipif(MAVPROXY is None, reason="MAVProxy is not installed (pip install --no-deps MAVProxy)")
@pytest.mark.slow
def test_mavproxy_links_arms_loads_waypoints_and_flies_them(field: Field, tmp_path: Path) -> None:
    assert MAVPROXY is not None
    (tmp_path / "plan.txt").write_text(PLAN, encoding="utf-8")
    terminal = Terminal([sys.executable, MAVPROXY, f"--master=tcp:127.0.0.1:{field.tcp}"], tmp_path)
    try:
        terminal.type("", "online system")
        terminal.type("", "Received 7 parameters")
        terminal.type("vehicle 2", "Set vehicle 2")
        if "mav_2_1.parm" not in terminal.said:  # it was, if MAVProxy heard vehicle 2 first
            terminal.type("", "Saved 7 parameters to mav_2_1.parm")
        terminal.type("link", "0 lost")
        terminal.type("param show MPC*", r"MPC_XY_CRUISE +12\.0")
        terminal.type("param set MPC_XY_CRUISE 9", "> ")
        for _ in range(PATIENCE_S):  # it is set when the UAV has said so
            if "9.0" in terminal.type("param show MPC*", r"MPC_XY_CRUISE +\d"):
                break
            time.sleep(0.2)
        assert "9.0" in terminal.said
        terminal.type("mode GUIDED", "Mode GUIDED")
        terminal.type("arm throttle", "ARMED")
        terminal.type("takeoff 12", "Mode LOITER")
        terminal.type("watch MISSION_ITEM_REACHED", "Watching")
        terminal.type("wp load plan.txt", "MISSION_ACK: TYPE_MISSION: ACCEPTED")
        terminal.type("wp list", "Saved 4 waypoints")
        assert re.search(r"21 3 37\.5665\d* 126\.9784\d* 0\.0", terminal.said)
        terminal.type("mode AUTO", "Mode AUTO")
        terminal.type("", r"seq : 2")
        terminal.type("", "DISARMED")
        for _ in range(PATIENCE_S):  # that the last item is reached may be told after that
            if "MISSION_ITEM_REACHED {seq : 3}" in terminal.said:
                break
            terminal.type("link", "lost")
            time.sleep(0.5)
        link = terminal.type("link", r"\d lost, .*loss")
        assert " 0 lost" in link
        log, end_s = tmp_path / "mav.tlog", time.monotonic() + PATIENCE_S
        while not LAST_ITEM.search(log.read_bytes()):  # it is written in portions of some seconds
            assert time.monotonic() < end_s, "the last item that was reached is not in the log"
            terminal.type("link", "lost")
            time.sleep(0.5)
    finally:
        terminal.close()
    keep(
        "mavproxy",
        "".join(line for line in terminal.said.replace("\r", "").splitlines(keepends=True) if "module" not in line),
    )
    check_tools(log)


def check_tools(log: Path) -> None:
    """What MAVProxy has recorded, read by pymavlink's tools."""
    tools = Path(sys.executable).parent
    lost = subprocess.run(
        [sys.executable, tools / "mavloss.py", log], capture_output=True, text=True, check=True
    ).stdout
    dump = subprocess.run(
        [sys.executable, tools / "mavlogdump.py", "--types", "COMMAND_ACK,MISSION_ITEM_REACHED", log],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    subprocess.run([sys.executable, tools / "mavtogpx.py", "--nofixcheck", log], capture_output=True, check=True)
    gpx = log.with_name(f"{log.name}.gpx").read_text()
    assert re.search(r"(\d+) packets, 0 lost 0\.0%", lost), lost
    assert not re.search(r" [1-9]\d* lost", lost), lost
    assert "MISSION_ITEM_REACHED {seq : 3}" in dump
    assert gpx.count("<trkpt") > 20
    told = [
        "$ mavloss.py mav.tlog", lost, "$ mavlogdump.py --types COMMAND_ACK,MISSION_ITEM_REACHED mav.tlog", dump,
        f"$ mavtogpx.py mav.tlog    # {gpx.count('<trkpt')} points",
    ]  # fmt: skip
    keep("tools", "\n".join(told) + "\n")


def test_topics_of_a_running_swarm_are_listed_and_measured(field: Field) -> None:
    def topic(*words: str) -> str:
        command = [sys.executable, "-m", "fanet_mw", "topic", *words, "--swarm", field.name]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout

    def until(pattern: str, *words: str) -> None:
        """Ask until the answer is as it should be: a busy machine holds back what a second should have had."""
        end_s = time.monotonic() + PATIENCE_S
        while not re.search(pattern, said := topic(*words), re.MULTILINE):
            assert time.monotonic() < end_s, f"{pattern} is not in {said}"

    until(r"^mavlink/3 +MavlinkTap +\d", "list", "--seconds", "1.5")
    until(r"^world/pose +Poses +[234]\d\.", "list", "--seconds", "1.5")  # 10 Hz, four times as fast
    until('"message": "HEARTBEAT"', "echo", "mavlink/2", "--count", "3")
    until(r"average rate: (2[5-9]|3\d|4[0-4])\.\d+", "hz", "world/pose", "--count", "2")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--mavlink", "udp"], "must be udpout:HOST:PORT"),
        (["--mavlink", "tcpin:0.0.0.0:99999"], "port 99999 must be in"),
        (["--mavlink", "serial:/dev/ttyS0:1234"], "1234 is no baud rate"),
        (["--mavlink-per-uav", "udpin:127.0.0.1:14540"], "must end with +"),
        (["--mavlink-key", "/nowhere"], "No such file"),
    ],
)
def test_a_connection_that_cannot_be_is_named(words: list[str], why: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(why)):
        app(["gateway", "nobody", *words], result_action="return_value")


def test_a_connection_that_cannot_be_is_one_message() -> None:
    command = [sys.executable, "-m", "fanet_mw", "gateway", "nobody", "--mavlink", "udp"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "must be udpout:HOST:PORT" in ended.stderr.replace("\n", " ")
    assert "Traceback" not in ended.stderr
