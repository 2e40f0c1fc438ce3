"""Runs whose disk is full, that are killed, or that have too little address space: never a result that seems whole.

    python tests/hostile/broken_runs.py disk [PLACES] [COMMAND]    file systems of 0/n, 1/n, ... of what a run takes
    python tests/hostile/broken_runs.py kills [COUNT] [COMMAND]    kill -9 at drawn instants of a run
    python tests/hostile/broken_runs.py memory [FROM_MB [TO_MB [STEP_MB [COMMAND]]]]
    COMMAND: simulate or launch

    disk, memory    one line says what is wrong; the summary is on standard output whenever it was computed
    disk, kills     what is cut is not valid, in the summary and for `fanet report`

The disk is a tmpfs in a namespace of its own (`unshare -rm`).
"""

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

FANET: Final = str(Path(sys.executable).with_name("fanet"))
MISSION: Final = {
    "simulate": ("simulate", "clusters", "--duration", "20", "--set", "warmup_s=5"),
    "launch": ("launch", "flooding", "--duration", "9", "--set", "warmup_s=3", "radio.lead_ms=150"),
}
MOST_LINES: Final = 12
"""Of standard error: `launch` says how it fares."""


class Ended(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str

    def summary(self) -> dict[str, Any] | None:
        with contextlib.suppress(ValueError):
            found = json.loads(self.out)
            if isinstance(found, dict):
                return found
        return None

    def rough(self) -> list[str]:
        """What a user should never see."""
        lines = self.err.splitlines()
        wrong = ["a traceback"] if "Traceback" in self.err + self.out else []
        wrong += [f"{len(lines)} lines on standard error"] if len(lines) > MOST_LINES else []
        wrong += (
            ["it ended without a word"] if self.code not in (0, -signal.SIGKILL) and not (self.err + self.out) else []
        )
        wrong += [f"signal {-self.code}"] if self.code < 0 and self.code != -signal.SIGKILL else []
        return wrong


def ended(command: list[str], **more: Any) -> Ended:
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, **more)
    return Ended(done.returncode, done.stdout, done.stderr)


def cut(folder: Path) -> list[str]:
    """The files of a run that are not what its summary says of them; all of them if it says nothing."""
    try:
        files = json.loads((folder / "summary.json").read_text("utf-8"))["files"]
    except (OSError, ValueError, KeyError):
        return ["summary.json"]
    found = [] if files else ["all files"]
    for name, said in files.items():
        path = folder / name
        whole = path.is_file() and path.stat().st_size == said["bytes"]
        if not whole or sha256(path.read_bytes()).hexdigest() != said["sha256"]:
            found.append(name)
    return found


def says_valid(folder: Path) -> bool:
    """True if the summary in the folder says so, or the page that `fanet report` makes of it."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        if json.loads((folder / "summary.json").read_text("utf-8"))["valid"] is True:
            return True
    with tempfile.TemporaryDirectory() as elsewhere:
        done = ended([FANET, "report", str(folder), "--out", elsewhere])
        page = Path(elsewhere) / "report.md"
        return done.code == 0 and page.exists() and "may be used" in page.read_text("utf-8")


# --- a full disk ------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def small_disk(size: int) -> Iterator[Path]:
    """A file system with so many bytes, seen by this process alone (`main` has entered a namespace)."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=True)
        try:
            yield Path(folder)
        finally:
            subprocess.run(["umount", "-l", folder], check=True)


def disk(places: int, command: str) -> Iterator[tuple[str, list[str]]]:
    options = ["--json", "--pcap", "--report"]
    with tempfile.TemporaryDirectory() as folder:
        whole = ended([FANET, *MISSION[command], "--out", f"{folder}/run", *options])
        files = sorted(Path(folder, "run").iterdir())
        needed = sum(-(-path.stat().st_size // 4096) * 4096 for path in files)
        assert whole.code == 0, f"without a full disk it is well: {whole.err}"
    for place in range(places):
        size = max(4096, needed * place // places // 4096 * 4096)
        with small_disk(size) as root:
            done = ended([FANET, *MISSION[command], "--out", str(root / "run"), *options])
            summary, missing = done.summary(), [path.name for path in files if not (root / "run" / path.name).exists()]
            wrong = done.rough()
            if summary is None:
                wrong += [] if done.code == 2 and len(done.err.splitlines()) <= 2 else ["no summary on standard output"]
            else:
                broken = cut(root / "run") + missing
                wrong += [] if done.code or not broken else [f"exit status 0 while {broken} are cut"]
                wrong += ["valid, though cut"] if broken and (summary["valid"] or not summary["unwritten"]) else []
                wrong += ["valid on the disk, though cut"] if broken and says_valid(root / "run") else []
            said = (
                (done.err.splitlines() or [""])[-1]
                if summary is None
                else ", ".join(summary["unwritten"]) or "all written"
            )
            yield f"disk of {size} of {needed} bytes: exit status {done.code}, {said[:160]}", wrong


# --- kills ------------------------------------------------------------------------------------------------------------


def kills(count: int, command: str) -> Iterator[tuple[str, list[str]]]:
    """One in ten is killed before it has a folder; of the others, half in the last fifth, when files are written.

    A run that was over by then does not count, and tells how long runs take now.
    """
    options = ["--json", "--pcap"]
    random = Random("kills")
    whole_s, done = 60.0, 0
    while done < count:
        share = random.uniform(0.8, 1.0) if done % 2 else random.uniform(0.0, 0.8)
        with tempfile.TemporaryDirectory() as folder:
            run = Path(folder) / "run"
            process = subprocess.Popen(
                [FANET, *MISSION[command], "--out", str(run), *options], stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
            while done % 10 and not run.exists() and process.poll() is None:
                time.sleep(0.005)
            began = time.monotonic()
            try:
                process.wait(share * whole_s)
            except subprocess.TimeoutExpired:
                process.kill()
            code = process.wait()
            if code != -signal.SIGKILL:
                whole_s = time.monotonic() - began
                continue
            done += 1
            time.sleep(0.3)  # the children of a launcher end with it
            broken = cut(run) if run.exists() else ["no folder"]
            wrong = ["valid, though cut"] if run.exists() and broken and says_valid(run) else []
            if run.exists():
                for of in ("report", "replay"):
                    read = ended([FANET, of, str(run), "--out", f"{folder}/page"])
                    wrong += [f"{of}: {what}" for what in read.rough()]
            leftover = [path for path in Path("/proc").glob("[0-9]*/cmdline") if _mentions(path, str(run))]
            wrong += [f"{len(leftover)} processes are left"] if leftover else []
            whole_s *= 1.02  # if the machine has become slower, the last instants would not be tried
            yield f"killed after {share:.0%}: cut: {', '.join(broken) or 'nothing'}", wrong


def _mentions(path: Path, text: str) -> bool:
    try:
        return text.encode() in path.read_bytes()
    except OSError:
        return False


# --- address space ----------------------------------------------------------------------------------------------------


def memory(first_mb: int, last_mb: int, step_mb: int, command: str) -> Iterator[tuple[str, list[str]]]:
    short = (
        ("quick", "--duration", "13", "--set", "radio.lead_ms=150")
        if command == "launch"
        else ("quick", "--duration", "13")
    )
    for size_mb in range(first_mb, last_mb + 1, step_mb):
        done = ended([FANET, command, *short, "--json"], preexec_fn=_limited_to(size_mb))
        wrong = done.rough()
        wrong += [f"{len(done.err.splitlines())} lines"] if done.code == 2 and len(done.err.splitlines()) != 1 else []
        wrong += ["no summary"] if done.code in (0, 1) and done.summary() is None else []
        wrong += [f"exit status {done.code}"] if done.code not in (0, 1, 2) else []
        yield f"{size_mb} MB: exit status {done.code}, {(done.err.splitlines() or ['a result'])[-1][:140]}", wrong


def _limited_to(size_mb: int) -> Callable[[], None]:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (size_mb << 20, size_mb << 20))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return limit


def main() -> int:
    words = sys.argv[1:]
    what = words.pop(0) if words else ""
    if what not in ("disk", "kills", "memory"):
        sys.stderr.write(f"{__doc__}")
        return 2
    command = words.pop() if words and words[-1] in MISSION else "simulate"
    if what == "disk" and "FANET_IN_NAMESPACE" not in os.environ:
        again = ["unshare", "-rm", sys.executable, *sys.argv]
        return subprocess.run(again, env={**os.environ, "FANET_IN_NAMESPACE": "1"}, check=False).returncode
    numbers = [int(word) for word in words]
    if what == "disk":
        found = disk(numbers[0] if numbers else 20, command)
    elif what == "kills":
        found = kills(numbers[0] if numbers else 50, command)
    else:
        first_mb, last_mb, step_mb = (*numbers, *(200, 1000, 10)[len(numbers) :])
        found = memory(first_mb, last_mb, step_mb, command)
    count = bad = 0
    for line, wrong in found:
        count, bad = count + 1, bad + bool(wrong)
        print(f"{line}: {'kept' if not wrong else 'NOT KEPT: ' + '; '.join(wrong)}", flush=True)
    print(f"{count} runs, {bad} not kept")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
