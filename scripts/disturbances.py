#!/usr/bin/env python
"""Runs the demo while its machine is disturbed, and says how the swarm's clock and the result fared.

    python scripts/disturbances.py loops --duration 150     two busy loops for a while, beside the swarm
    python scripts/disturbances.py pauses                   all processes stopped for 150 ms every 20 s
    python scripts/disturbances.py one-by-one               one process stopped for 150 ms at a time, in turn
    python scripts/disturbances.py disk                     a file that is written and synced without end
    python scripts/disturbances.py reader                   standard output and error read at 100 bytes per second
    python scripts/disturbances.py term                     SIGTERM to the whole group at instants of a run

A line per run ends with "kept" or with what was not. The exit status is the number of runs that did not keep it.
"""

import argparse
import contextlib
import itertools
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FANET = Path(sys.executable).with_name("fanet")
LEAST_PACE = 0.5
"""Two busy loops may slow the clock to no less than this."""
BACK_S = 30.0
"""The clock is back at full pace so much real time after the disturbance."""
TERM_AFTER_S = (0.1, 0.5, 1.0, 3.0, 10.0, 100.0)
MOST_LINES = 3
"""What a run may say that was ended before it had a result: where it runs, its lead, and why it ended."""
_WRITES = """
import os, sys
block = os.urandom(1 << 22)
while True:
    with open(sys.argv[1], "wb") as file:
        for _ in range(50):
            file.write(block)
            file.flush()
            os.fsync(file.fileno())
"""
BESIDE = {
    "loops": ([sys.executable, "-c", "while True: pass"], 2),
    "disk": ([sys.executable, "-c", _WRITES], 1),
}
"""What runs beside the swarm, and how many of it."""


def family(root: int) -> list[int]:
    """A process and all that descend from it."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with contextlib.suppress(OSError):
                parent = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[1])
                children.setdefault(parent, []).append(int(folder.name))
    found = [root]
    for process in found:
        found += children.get(process, [])
    return found


def stop_for(processes: list[int], pause_s: float) -> None:
    for process in processes:
        with contextlib.suppress(OSError):
            os.kill(process, signal.SIGSTOP)
    time.sleep(pause_s)
    for process in processes:
        with contextlib.suppress(OSError):
            os.kill(process, signal.SIGCONT)


@contextlib.contextmanager
def beside(command: list[str], count: int) -> Iterator[None]:
    """Some processes that run beside the swarm."""
    processes = [subprocess.Popen(command) for _ in range(count)]  # noqa: S603  (a command of this file)
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


class Demo:
    """One run of the demo, and what it said at which instant of real time."""

    def __init__(self, mission: str, duration_s: float, more: list[str], *, slowly: bool = False) -> None:
        self._out = tempfile.TemporaryDirectory()
        command = [str(FANET), "launch", mission, "--slow-down-to", "0.1", "--json", "--duration", str(duration_s)]
        self.process = subprocess.Popen(  # noqa: S603  (this tree's own command)
            [*command, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, process_group=0
        )
        self.said: list[tuple[float, str]] = []
        self.printed = b""
        self.up = threading.Event()
        self._slowly = slowly
        self._readers = [threading.Thread(target=self._read_error), threading.Thread(target=self._read_output)]
        for reader in self._readers:
            reader.start()

    def _read_error(self) -> None:
        assert self.process.stderr is not None, "it is a pipe"
        for line in self.process.stderr:
            text = line.decode().strip()
            self.said.append((time.monotonic(), text))
            if "processes up after" in text:
                self.up.set()
            if self._slowly:
                time.sleep(len(line) / 100)
        self.up.set()

    def _read_output(self) -> None:
        assert self.process.stdout is not None, "it is a pipe"
        while part := self.process.stdout.read1(100 if self._slowly else 1 << 16):  # type: ignore[attr-defined]
            self.printed += part
            if self._slowly:
                time.sleep(1)

    def end(self, timeout_s: float) -> dict[str, Any]:
        try:
            self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGINT)
            self.process.wait()
        for reader in self._readers:
            reader.join()
        with contextlib.suppress(ValueError):
            summary: dict[str, Any] = json.loads(self.printed)
            return summary
        return {}

    def last_word(self) -> str:
        return self.said[-1][1] if self.said else "nothing"

    def full_again(self) -> float | None:
        """When it last said that its clock is back at full pace."""
        return next((at for at, text in reversed(self.said) if "clock is back at" in text), None)


def disturbed(demo: Demo, kind: str, options: argparse.Namespace) -> float:
    """Disturb a run; returns when the last disturbance ended."""
    began, ends = time.monotonic(), options.duration - 8
    if kind in BESIDE:
        time.sleep(options.after)
        command, count = BESIDE[kind]
        late = contextlib.suppress(subprocess.TimeoutExpired)
        with tempfile.NamedTemporaryFile(dir=".") as file, beside([*command, file.name], count), late:
            demo.process.wait(options.lasting)
    elif kind in ("pauses", "one-by-one"):
        for number in itertools.count():
            processes = family(demo.process.pid)
            stop_for(processes if kind == "pauses" else processes[number % len(processes) :][:1], options.pause / 1000)
            time.sleep(options.every - options.pause / 1000)
            if time.monotonic() > began + ends or demo.process.poll() is not None:
                break
    else:
        demo.process.wait()
    return time.monotonic()


def run(kind: str, options: argparse.Namespace) -> bool:
    """Fly once; prints what came of it, and returns True if all was as it should."""
    demo = Demo(options.mission, options.duration, options.more, slowly=kind == "reader")
    demo.up.wait()
    ended = disturbed(demo, kind, options)
    summary = demo.end(options.duration * 4)
    if not summary:
        print(f"{kind}: NO RESULT: {demo.last_word()}")
        return False
    steps = [(step["t_s"], step["time_scale"]) for step in summary["slowed"]]
    slowest = min([scale for _, scale in steps], default=1.0)
    least = LEAST_PACE if kind in BESIDE else 1.0
    wrong = [f"the clock fell to {slowest:.3g}"] if slowest < least else []
    back_s = None
    if steps:
        back = demo.full_again()
        back_s = math.inf if back is None or steps[-1][1] < 1 else max(0.0, back - ended)
        wrong += [f"full pace again only after {back_s:.0f} s"] if back_s > BACK_S else []
    wrong += [] if summary["frames"]["closes"] else ["the ledger does not close"]
    late = summary["lateness"]
    again = "" if back_s is None else f", back {back_s:.0f} s after the end"
    print(
        f"{kind}: {summary['simulated_s']:.0f} s in {summary['wall_s']:.0f} s, clock at least {slowest:.3g}{again}, "
        f"late {late['share']:.2%} (worst {late['max_ms']:.0f} ms), PDR {summary['pdr']:.3f}, "
        f"{'valid' if summary['valid'] else summary['invalid_because']}, pauses {summary['pauses']}, steps {steps}: "
        f"{'kept' if not wrong else 'NOT KEPT: ' + ', '.join(wrong)}",
        flush=True,
    )
    return not wrong


def terminated(after_s: float, options: argparse.Namespace) -> bool:
    """Send SIGTERM to all processes of a run at once; its result closes, or it says why there is none."""
    demo = Demo(options.mission, options.duration, options.more)
    time.sleep(after_s)
    processes = family(demo.process.pid)
    os.killpg(demo.process.pid, signal.SIGTERM)
    summary = demo.end(60)
    time.sleep(0.5)
    left = [process for process in processes if Path(f"/proc/{process}").exists()]
    wrong = [f"{len(left)} processes are left"] if left else []
    if summary:
        flown = f"{summary['simulated_s']:.1f} s flown, {summary['invalid_because'][:1]}"
        wrong += [] if summary["frames"]["closes"] else ["the ledger does not close"]
    else:
        flown = f"no result: {demo.last_word()}"
        told = "SIGTERM" in demo.last_word() or demo.process.returncode == -signal.SIGTERM  # before it runs a line
        wrong += [] if told and len(demo.said) <= MOST_LINES else ["it does not say why"]
    print(
        f"SIGTERM after {after_s:g} s to {len(processes)} processes: exit status {demo.process.returncode}, {flown}: "
        f"{'kept' if not wrong else 'NOT KEPT: ' + ', '.join(wrong)}",
        flush=True,
    )
    return not wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["loops", "pauses", "one-by-one", "disk", "reader", "term"])
    parser.add_argument("--mission", default="rescue")
    parser.add_argument("--duration", type=float, default=120.0, help="swarm time [s]")
    parser.add_argument("--after", type=float, default=15.0, help="undisturbed time before loops and disk [s]")
    parser.add_argument("--lasting", type=float, default=70.0, help="how long loops and disk last [s]")
    parser.add_argument("--pause", type=float, default=150.0, help="how long processes are stopped [ms]")
    parser.add_argument("--every", type=float, default=20.0, help="how often processes are stopped [s]")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("more", nargs="*", help="further options of fanet launch, after --")
    options = parser.parse_args()
    if options.kind == "term":
        return sum(not terminated(after_s, options) for _ in range(options.times) for after_s in TERM_AFTER_S)
    return sum(not run(options.kind, options) for _ in range(options.times))


if __name__ == "__main__":
    sys.exit(main())
