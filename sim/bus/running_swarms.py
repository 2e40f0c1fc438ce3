"""The swarms that run on this machine, each in a file, so that a command finds a swarm with a random port.

The files are in a folder of this user: `$XDG_RUNTIME_DIR/fanet-mw`, or `fanet-mw-UID` in the folder for temporary
files. One whose process is gone is removed by the next reader.
"""

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

from fanet_mw.errors import FanetError

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
_START_TIME: Final = 22 - 3
"""Index of a field of /proc/PID/stat (proc_pid_stat(5)), from the one after the closing parenthesis."""


class Running(NamedTuple):
    """A swarm that runs on this machine."""

    swarm: str
    endpoint: str
    pid: int
    """The process id of its launcher or router."""
    started: str
    """The time at which that process began, in the kernel's count, because a process id may be used again."""


def _folder() -> Path:
    given = os.environ.get("XDG_RUNTIME_DIR")
    return Path(given) / "fanet-mw" if given else Path(tempfile.gettempdir()) / f"fanet-mw-{os.getuid()}"


def _ours(folder: Path) -> bool:
    """True if a folder belongs to this user alone; another user may have made one where all may write."""
    try:
        status = folder.lstat()
    except OSError:
        return False
    return folder.is_dir() and status.st_uid == os.getuid() and not status.st_mode & 0o077


def _started(pid: int) -> str:
    """The time at which a process began; empty when it is gone or a zombie."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if fields[0] in "ZX" else fields[_START_TIME]


@contextmanager
def registered(swarm: str, endpoint: str) -> Iterator[bool]:
    """Let commands find a swarm while the context lasts; yields True if they can."""
    folder, pid = _folder(), os.getpid()
    entry = Running(swarm, endpoint, pid, _started(pid))
    try:
        descriptor, name = _create(folder, pid)
    except OSError:
        yield False
        return
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            json.dump(entry._asdict(), file)
        yield True
    finally:
        with suppress(OSError):
            Path(name).unlink()


def _create(folder: Path, pid: int) -> tuple[int, str]:
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not _ours(folder):
        raise PermissionError(f"{folder}: it is not of this user alone")
    return tempfile.mkstemp(prefix=f"{pid}-", suffix=".json", dir=folder)


def running() -> list[Running]:
    folder = _folder()
    if not _ours(folder):
        return []
    found = [entry for path in sorted(folder.glob("*.json")) if (entry := _read(path)) is not None]
    return sorted(found)


def _read(path: Path) -> Running | None:
    """The content of a file, if its process lives; the file of a dead process is removed."""
    try:
        entry = Running(**json.loads(path.read_text(encoding="utf-8")))
        alive = bool(entry.started) and _started(int(entry.pid)) == entry.started
    except (OSError, ValueError, TypeError):
        return None  # the file is being written, has just been removed, or is not of this program
    if not alive:
        with suppress(OSError):
            path.unlink()
        return None
    return entry


def locate(connect: str | None, swarm: str | None) -> tuple[str, str | None]:
    """The endpoint and the name, None if only the router knows it; raises FanetError if several swarms fit."""
    if connect is not None:
        return connect, swarm
    found = [entry for entry in running() if swarm in (None, entry.swarm)]
    if len(found) > 1:
        some = ", ".join(f"{entry.swarm} ({entry.endpoint})" for entry in found)
        named = len({entry.swarm for entry in found}) == len(found)
        flag = "--swarm NAME" if named else "--connect ENDPOINT"
        raise FanetError(f"{len(found)} swarms run on this machine: {some}; say {flag}")
    if found:
        return found[0].endpoint, found[0].swarm
    return DEFAULT_ENDPOINT, swarm
