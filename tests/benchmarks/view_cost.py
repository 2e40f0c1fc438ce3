"""What a view costs a swarm: its CPU, the bytes a second to a browser, and the swarm's lateness with and without it.

    python tests/benchmarks/view_cost.py [SECONDS] [TURNS]     45 UAVs in real time, in turns without and with a view
    python tests/benchmarks/view_cost.py virtual [SECONDS]     200 UAVs in virtual time: CPU per frame, bytes a second

The browser is a websocket client in this process that takes all that comes.
"""

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Final

import viser
from websockets.sync.client import connect

from fanet_mw.units import S
from sim.observation.swarm_state import SwarmState
from sim.run.virtual import Observed
from sim.scenarios import catalog
from sim.view.panels import Panels
from sim.view.scene import Scene
from sim.view.server import HOST, close_server, look_over, open_server

PORT: Final = 8765
TICKS: Final = os.sysconf("SC_CLK_TCK")


class Browser:
    """Counts the bytes that a page would receive."""

    def __init__(self, port: int) -> None:
        self.bytes = 0
        self._ends = False
        self._port = port
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ends:
            try:
                with connect(
                    f"ws://{HOST}:{self._port}",
                    subprotocols=[f"viser-v{viser.__version__}"],
                    max_size=None,  # type: ignore[list-item]
                ) as socket:
                    for message in socket:
                        self.bytes += len(message)
            except (OSError, EOFError):
                time.sleep(0.5)
            except Exception as error:  # noqa: BLE001  (the server has gone)
                if self._ends:
                    return
                print(f"browser: {error}", file=sys.stderr)
                time.sleep(0.5)

    def end(self) -> None:
        self._ends = True


def cpu_s(words: str) -> float | None:
    """The CPU time of the process with these words in its command line."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                if words in command:
                    fields = (folder / "stat").read_text().rpartition(")")[2].split()
                    return (int(fields[11]) + int(fields[12])) / TICKS
            except OSError:
                continue
    return None


def real_time(seconds: float, *, view: bool) -> dict[str, Any]:
    words = [sys.executable, "-m", "fanet_mw", "launch", "rescue", "--duration", str(seconds), "--json"]
    words += ["--set", "warmup_s=3", "drain_s=3"]
    browser = Browser(PORT) if view else None
    words += ["--view", "--view-port", str(PORT)] if view else []
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    used, since = [], time.monotonic()
    while process.poll() is None and time.monotonic() < since + seconds + 120:
        if view and (now := cpu_s(f"fanet_mw view --port {PORT}")) is not None:
            used.append((time.monotonic(), now, browser.bytes if browser else 0))
        time.sleep(0.5)
        if len(used) > 2 * seconds + 200:
            break
    out, _ = process.communicate()
    if browser:
        browser.end()
    summary = json.loads(out)
    row = {
        "view": view, "late": summary["lateness"]["share"], "late_p99_ms": summary["lateness"]["p99_ms"],
        "late_max_ms": summary["lateness"]["max_ms"],
        "pdr": summary["pdr"], "valid": summary["valid"], "load": os.getloadavg()[0],
    }  # fmt: skip
    flown = [one for one in used if one[1] > 2.0]  # imports aside
    if len(flown) > 4:
        (t0, c0, b0), (t1, c1, b1) = flown[len(flown) // 4], flown[-1]
        row |= {"view_cpu_share": round((c1 - c0) / (t1 - t0), 4), "kB_per_s": round((b1 - b0) / (t1 - t0) / 1000, 1)}
    return row


def virtual(seconds: float) -> dict[str, Any]:
    scenario = catalog.find("flooding", [
        "nodes.count=200", f"duration_s={seconds}", "warmup_s=1", "drain_s=1", "world.engine=kinematic",
        "mobility.model=random_waypoint", "world.area_m=3000", "traffic.sources=10", "traffic.interval_s=1",
    ])  # fmt: skip
    server = open_server(PORT)
    state = SwarmState(scenario)
    scene = Scene(server, state, on_select=lambda _: None)
    look_over(server, scene)
    panels = Panels(server, scene, actions=None)
    browser = Browser(PORT)
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
    browser.end()
    close_server(server)
    return row


def main() -> None:
    words = sys.argv[1:]
    if words[:1] == ["virtual"]:
        print(json.dumps(virtual(float(words[1]) if len(words) > 1 else 30.0)))
        return
    seconds, turns = float(words[0]) if words else 60.0, int(words[1]) if len(words) > 1 else 2
    for _ in range(turns):
        for view in (False, True):
            print(json.dumps(real_time(seconds, view=view)), flush=True)


if __name__ == "__main__":
    main()
