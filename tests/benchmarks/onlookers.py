"""What looking at a swarm costs it: its lateness without and with onlookers, in turns, and what each of them takes.

    python tests/benchmarks/onlookers.py [SECONDS] [TURNS] [--only view gateway inspect] [--of SCENARIO]
                                      the demo of 45 UAVs, SECONDS each (40), TURNS times (3): nobody, view, doors;
                                      `--only flood`: a ground station that says 4,000 commands a second
    python tests/benchmarks/onlookers.py virtual [SECONDS]     200 UAVs in virtual time: CPU per frame, bytes a second

view     `fanet view` at 10 Hz, and a browser: a websocket client in this process that takes all that comes
doors    `fanet gateway` with a ground station that listens to all UAVs, and `fanet inspect` on a terminal of its own

A row is printed per flight, and at the end a table of medians.
"""

import argparse
import contextlib
import json
import os
import pty
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

from fanet_mw.mavlink import common
from fanet_mw.units import S
from sim.observation.swarm_state import SwarmState
from sim.run.virtual import Observed
from sim.scenarios import catalog
from sim.view.panels import Panels
from sim.view.scene import Scene
from sim.view.server import HOST, look_over, served

ROOT: Final = Path(__file__).parents[2]
PORT: Final = 8765
GROUND: Final = 14599
TICKS: Final = os.sysconf("SC_CLK_TCK")
STEP_S: Final = 0.5


class Taker:
    """Takes all that comes, on a thread, and counts its bytes."""

    def __init__(self, run: Callable[["Taker"], None]) -> None:
        self.bytes = 0
        self.ends = False
        self._thread = threading.Thread(target=run, args=(self,), daemon=True)
        self._thread.start()


def browse(taker: Taker) -> None:
    """Be a browser."""
    import viser
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    while not taker.ends:
        try:
            with connect(
                f"ws://{HOST}:{PORT}",
                subprotocols=[f"viser-v{viser.__version__}"],
                max_size=None,  # type: ignore[list-item]
            ) as server:
                for message in server:
                    taker.bytes += len(message)
        except (OSError, EOFError, WebSocketException):
            time.sleep(STEP_S)


def stand_on_ground(taker: Taker, *, floods: bool = False) -> None:
    """Be a ground station: say a heartbeat each second, and hear all UAVs. `floods`: and say commands without end."""
    voice = common.MAVLink(None, srcSystem=255, srcComponent=190)
    said_s = 0.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(0.001 if floods else STEP_S)
        while not taker.ends:
            if time.monotonic() >= said_s + 1:
                said_s = time.monotonic()
                beat = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(voice)
                voice.seq = (voice.seq + 1) % 256
                with contextlib.suppress(OSError):
                    sock.sendto(beat, (HOST, GROUND))
            for number in range(40 if floods else 0):
                order = common.MAVLink_command_long_message(1 + number, 1, 400, 0, 1, voice.seq, 0, 0, 0, 0, 0)
                with contextlib.suppress(OSError):
                    sock.sendto(order.pack(voice), (HOST, GROUND))
                voice.seq = (voice.seq + 1) % 256
            with contextlib.suppress(OSError):
                taker.bytes += len(sock.recv(65_536))
            if floods:
                time.sleep(0.01)


@contextlib.contextmanager
def onlooker(name: str, swarm: str) -> Iterator[tuple[int, Taker]]:
    """A process that looks at a swarm: its id, and who takes what it says."""
    words = {
        "view": ["view", swarm, "--port", str(PORT), "--until-gone"],
        "gateway": ["gateway", swarm, "--mavlink", f"udpin:{HOST}:{GROUND}"],
        "flood": ["gateway", swarm, "--mavlink", f"udpin:{HOST}:{GROUND}"],
        "inspect": ["inspect", swarm],
    }[name]
    master, terminal = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "fanet_mw", *words], stdin=terminal, stdout=terminal, stderr=terminal,
        env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "160", "LINES": "48"}, start_new_session=True,
    )  # fmt: skip
    os.close(terminal)

    def read(taker: Taker) -> None:
        with contextlib.suppress(OSError):
            while chunk := os.read(master, 65_536):
                taker.bytes += len(chunk)

    screen = Taker(read)
    taker = {"view": browse, "gateway": stand_on_ground, "flood": partial(stand_on_ground, floods=True)}.get(name)
    takes = screen if taker is None else Taker(taker)
    try:
        yield process.pid, takes
    finally:
        takes.ends = True
        process.terminate()
        process.wait()
        os.close(master)


def cpu_s(pid: int) -> float | None:
    """The processor time that a process has used; None when it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return None if fields[0] == "Z" else (int(fields[11]) + int(fields[12])) / TICKS


def flight(seconds: float, who: tuple[str, ...], *, of: str) -> dict[str, Any]:
    """One flight of the demo, or of a scenario, with these onlookers."""
    swarm = f"looked-at-{os.getpid()}"
    demo = of == "demo"
    words = ["bash", str(ROOT / "scripts" / "demo")] if demo else [sys.executable, "-m", "fanet_mw", "launch", of]
    words += ["--duration", str(seconds), "--json", "--swarm", swarm]
    used: dict[str, list[tuple[float, float, int]]] = {name: [] for name in who}
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process,
        contextlib.ExitStack() as stack,
    ):
        assert process.stderr is not None, "it is a pipe"
        for line in process.stderr:
            if "processes up" in line:
                break
        threading.Thread(target=process.stderr.read, daemon=True).start()
        lookers = {name: stack.enter_context(onlooker(name, swarm)) for name in who}
        end_s = time.monotonic() + 0.9 * seconds
        while time.monotonic() < end_s and process.poll() is None:
            time.sleep(STEP_S)
            for name, (pid, takes) in lookers.items():
                if (now := cpu_s(pid)) is not None:
                    used[name].append((time.monotonic(), now, takes.bytes))
        assert process.stdout is not None, "it is a pipe"
        summary = json.loads(process.stdout.read())
    late, bound = summary["lateness"], summary["bound"] or {"violations": 0, "never": 0}
    row: dict[str, Any] = {
        "with": "+".join(who) or "nobody", "late_percent": round(100 * late["share"], 3), "late_p99_ms": late["p99_ms"],
        "late_max_ms": late["max_ms"], "pdr": summary["pdr"], "bounds_broken": bound["violations"] + bound["never"],
        "least_pace": min([1.0, *(step["time_scale"] for step in summary["paces"])]),
        "valid": summary["valid"], "load": round(os.getloadavg()[0], 1),
    }  # fmt: skip
    for name, samples in used.items():
        settled = samples[len(samples) // 3 :]  # imports aside
        if len(settled) > 2:
            (t0, c0, b0), (t1, c1, b1) = settled[0], settled[-1]
            row[f"{name}_core_percent"] = round(100 * (c1 - c0) / (t1 - t0), 1)
            row[f"{name}_kB_per_s"] = round((b1 - b0) / (t1 - t0) / 1000, 1)
    return row


def virtual(seconds: float) -> dict[str, Any]:
    scenario = catalog.find("flooding", [
        "nodes.count=200", f"duration_s={seconds}", "warmup_s=1", "drain_s=1", "world.engine=kinematic",
        "mobility.model=random_waypoint", "world.area_m=3000", "traffic.sources=10", "traffic.interval_s=1",
    ])  # fmt: skip
    with served(PORT) as server:
        state = SwarmState(scenario)
        scene = Scene(server, state, on_select=lambda _: None)
        look_over(server, scene)
        panels = Panels(server, scene, actions=None)
        browser = Taker(browse)
        observed = Observed(scenario, observer=state)
        observed.host.start()
        time.sleep(2)
        draw_s, frames, began = 0.0, 0, browser.bytes
        for t_ns in range(S // 10, scenario.duration_ns, S // 10):
            observed.host.run(t_ns)
            observed.tell_reports()
            start = time.process_time()
            scene.draw(t_ns)
            panels.refresh(t_ns)
            draw_s += time.process_time() - start
            frames += 1
            time.sleep(0.02)
        time.sleep(1)
        row = {
            "uavs": 200, "frames": frames, "cpu_ms_per_frame": round(1000 * draw_s / frames, 2),
            "cpu_share_at_10_hz": round(10 * draw_s / frames, 3),
            "kB_per_swarm_s": round((browser.bytes - began) / seconds / 1000, 1),
        }  # fmt: skip
        browser.ends = True
    return row


def medians(rows: list[dict[str, Any]]) -> str:
    """A table of the medians of what was measured, a line per company."""
    columns = ["late_percent", "late_p99_ms", "late_max_ms", "pdr", "bounds_broken", "least_pace", "load"]
    columns += sorted({name for row in rows for name in row if name.endswith(("_core_percent", "_kB_per_s"))})
    lines = [f"| with | flights | {' | '.join(columns)} |", f"|{'---|' * (len(columns) + 2)}"]
    for company in dict.fromkeys(row["with"] for row in rows):
        own = [row for row in rows if row["with"] == company]
        cells = [f"{statistics.median(row[name] for row in own):g}" if name in own[0] else "-" for name in columns]
        lines.append(f"| {company} | {len(own)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    flags = argparse.ArgumentParser(description="What it costs a swarm to be looked at.")
    flags.add_argument("seconds", nargs="?", default="40", help="seconds of a flight, or `virtual`")
    flags.add_argument("turns", nargs="?", type=float, default=3)
    flags.add_argument(
        "--only", nargs="+", choices=("view", "gateway", "inspect", "flood"), help="these instead, each alone"
    )
    flags.add_argument("--of", default="demo", help="a scenario instead of the demo")
    given = flags.parse_args()
    if given.seconds == "virtual":
        print(json.dumps(virtual(given.turns if len(sys.argv) > 2 else 30.0)))
        return
    companies = [(), *((name,) for name in given.only)] if given.only else [(), ("view",), ("gateway", "inspect")]
    rows = []
    for _ in range(round(given.turns)):
        for who in companies:
            rows.append(flight(float(given.seconds), who, of=given.of))
            print(json.dumps(rows[-1]), flush=True)
    print(medians(rows))


if __name__ == "__main__":
    main()
