"""The processes of a swarm: forked from one warmed-up server, watched, and ended without leaving any behind.

Children ignore Ctrl-C and the signals by which a service is ended, because these often go to all processes of a group
and the launcher decides when its children end: by the swarm's clock, or else by killing them. They are killed when the
server ends, and the server ends with the launcher, however the launcher ends.
"""

import asyncio
import atexit
import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from typing import Any, Final, NamedTuple

from fanet_mw.errors import ConfigError, FanetError, HostError, LocalProtocolError
from fanet_mw.hosts.service import BUS_EXIT_CODE
from sim.results.outcome import described
from sim.run.launcher import process_setup
from sim.run.launcher.process_setup import be_killed_with_parent

_PRELOAD: Final = ["agents.__main__", "emulator.process", "sim.world.process", "sim.run.launcher.services"]
_NICENESS: Final = 4
"""Added to the launcher's. With 10, two busy loops beside `rescue` on two processors slow the swarm's clock to 0.56;
with 4 it stays at 1, and the emulator still goes first."""
_FOR_THE_LAUNCHER: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_LAUNCHES_WHEN_IMPORTED: Final = 79
"""The exit code of a child whose import of the main program starts a swarm."""
_MUST_COMPILE: Final = 78
"""The exit code of the first child if the emulator's kernel is not compiled yet."""
_REFUSED: Final = 2
"""The exit code of a child that cannot be what the scenario asks for, as that of a command."""
_UNKNOWN_END: Final = 255
"""The exit code that multiprocessing gives a child whose server has not told one."""
_NO_FOLDER: Final = "the working folder has been deleted, and the swarm's processes start in it"
Entry = Callable[..., int]

_PR_SET_NAME: Final = 15
_KILLED_S: Final = 5.0
"""How long a killed child may take to be seen dead."""
_NAME_BYTES: Final = 15
_ARG_START, _ARG_END = 48 - 3, 49 - 3
"""Indices of fields of /proc/PID/stat (proc_pid_stat(5)), from the one after the closing parenthesis."""


def entitle(name: str, title: str) -> None:
    """Name this process (15 characters), and make its command line `title`, as far as there is room."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode()[:_NAME_BYTES], 0, 0, 0)
    fields = Path("/proc/self/stat").read_text(encoding="latin-1").rpartition(")")[2].split()
    start, end = int(fields[_ARG_START]), int(fields[_ARG_END])
    if start:  # the last byte stays zero; otherwise the kernel would add the environment to the command line
        ctypes.memmove(start, title.encode()[: end - start - 1].ljust(end - start, b"\0"), end - start)


class ChildRecipe(NamedTuple):
    """How to start a child: `entry(**arguments)`."""

    entry: Entry
    arguments: Mapping[str, Any]
    gives_way: bool
    name: str
    title: str
    """The command line that `ps` shows for the child."""


def _child(recipe: ChildRecipe) -> None:
    for number in _FOR_THE_LAUNCHER:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _FOR_THE_LAUNCHER)
    be_killed_with_parent()
    process_setup.restore()
    _keep_no_server_alive()
    _keep_no_tracker_alive()
    entitle(recipe.name, recipe.title)
    try:
        if recipe.gives_way:
            _give_way()
        code = recipe.entry(**recipe.arguments)
    except LocalProtocolError:
        raise  # a bug, perhaps of a part of another package: where it is says the traceback
    except FanetError as error:
        sys.stderr.write(f"{error}\n")
        code = _REFUSED if isinstance(error, ConfigError) else BUS_EXIT_CODE
    sys.exit(code)


def _keep_no_server_alive() -> None:
    """Close this copy of the fork server's pipe, so that it, and all children, end with a launcher that is killed."""
    kept = forkserver._forkserver._forkserver_alive_fd  # type: ignore[attr-defined]  # noqa: SLF001
    if kept is not None:
        os.close(kept)
        forkserver._forkserver._forkserver_alive_fd = None  # type: ignore[attr-defined]  # noqa: SLF001


def _keep_no_tracker_alive() -> None:
    """Close this copy of the resource tracker's pipe: a process that an application forks would keep it, and so the
    tracker, for which the launcher waits at its exit. A child that needs a tracker starts its own.
    """
    tracker: Any = resource_tracker._resource_tracker  # noqa: SLF001
    if tracker._fd is not None:  # noqa: SLF001
        os.close(tracker._fd)  # noqa: SLF001
        tracker._fd = tracker._pid = None  # noqa: SLF001


def _give_way() -> None:
    """With `SCHED_BATCH` a UAV that wakes up does not interrupt another's step, when the world's poses wake all."""
    os.nice(_NICENESS)
    with contextlib.suppress(OSError):  # a container may forbid it; the niceness helps, too
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def end_if_imported_by_a_child() -> None:
    """End a child whose import of the main program would start a swarm; `warm_up` says then what is wrong."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # as multiprocessing itself asks
        os._exit(_LAUNCHES_WHEN_IMPORTED)


_started: Final[dict[str, int]] = {}
"""Which of multiprocessing's helper processes were started here, and by which process."""


def _first() -> None:
    """Ask what only a process knows that has loaded the emulator; the launcher has not."""
    from emulator.compile_kernel import must_compile

    sys.exit(_MUST_COMPILE if must_compile() else 0)


def _start_server() -> int:
    """Start the server from which children are forked, if there is none; returns its process id. The launcher's signals
    are blocked: it ignores them only after its imports, and a child only from `_child` on; until then each would print
    a traceback.
    """
    helpers = {
        "tracker": resource_tracker._resource_tracker._pid,  # type: ignore[attr-defined]  # noqa: SLF001
        "server": forkserver._forkserver._forkserver_pid,  # type: ignore[attr-defined]  # noqa: SLF001
    }
    _started.update({name: 1 for name, pid in helpers.items() if pid is None}, process=os.getpid())
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGHUP])  # the tracker ignores the other two by itself
    try:
        with process_setup.without_working_folder():
            resource_tracker.ensure_running()  # otherwise the server starts the tracker, which unblocks SIGINT
            signal.pthread_sigmask(signal.SIG_BLOCK, _FOR_THE_LAUNCHER)
            forkserver.ensure_running()
    except OSError as error:
        if _folder_is_gone():
            raise HostError(_NO_FOLDER) from error
        raise HostError(
            f"the server of the swarm's processes cannot be started: {error}; its socket is in the folder for "
            f"temporary files, TMPDIR = {tempfile.gettempdir()}, whose path may have 70 characters"
        ) from error
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    pid: int = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]  # noqa: SLF001
    return pid


def _folder_is_gone() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def _wake_server() -> None:
    """Let a server that was stopped (SIGSTOP) go on: only it can say that children are dead, for which the launcher
    would wait at its exit for ever.
    """
    pid = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]  # noqa: SLF001
    if pid is not None:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGCONT)


def _end_of_server(pid: int) -> int | None:
    """The exit code of the server with this pid, if it has ended. It closes its files a moment before it is dead."""
    with contextlib.suppress(ChildProcessError):  # multiprocessing has waited for it
        for _ in range(40):
            ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            if ended is not None:
                return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
            time.sleep(0.005)
    return None


class Processes:
    """The children by name; each of them can be started again."""

    def __init__(
        self, on_end: Callable[[str, int], None], *, title: str = "fanet", preload: Sequence[str] = ()
    ) -> None:
        """`preload`: modules that all children need, in addition to those of the services."""
        self._title = title
        """The beginning of each child's command line in `ps`, before its name."""
        self._context: ForkServerContext = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([*_PRELOAD, *preload])
        self._on_end = on_end
        self._loop = asyncio.get_running_loop()
        self._running: dict[str, ForkServerProcess] = {}
        self._recipes: dict[str, ChildRecipe] = {}
        self._server_of: dict[str, int] = {}
        """The process id of the server that each child was forked from last."""
        self._ended_servers: dict[int, int] = {}
        """The exit code of each such server that has ended before its children, by its process id."""
        self._empty = asyncio.Event()

    async def warm_up(self) -> bool:
        """Wait until the server has imported what children need. Returns True if the emulator's kernel will be
        compiled; raises HostError if the main program starts a swarm when it is imported, or cannot be imported.
        """
        first = self._context.Process(target=_first)

        def run() -> int | None:
            server = _start_server()
            try:
                first.start()
            except (OSError, EOFError) as error:
                raise self._not_started("a process", server, error) from error
            first.join()
            code = first.exitcode
            first.close()
            return code

        code = await asyncio.to_thread(run)
        if code == _LAUNCHES_WHEN_IMPORTED:
            raise HostError(
                "the processes of a swarm import the program that launches it, and this program launches a swarm "
                'whenever it is imported: put the launch below `if __name__ == "__main__":`'
            )
        if code is not None and code > 0 and code not in (_MUST_COMPILE, _UNKNOWN_END):
            raise HostError(
                f"the processes of a swarm import the program that launches it, and that ended with {described(code)}: "
                "it must be a file that can be imported"
            )
        return code == _MUST_COMPILE

    def start(self, name: str, entry: Entry, arguments: Mapping[str, Any], *, gives_way: bool = False) -> None:
        """Start a child; `entry(**arguments)` must be importable and picklable."""
        recipe = self._recipes[name] = ChildRecipe(entry, arguments, gives_way, name, f"{self._title} {name}")
        process = self._context.Process(target=_child, args=(recipe,), name=name)
        for last in (False, True):
            server = _start_server()
            try:
                process.start()
            except (OSError, EOFError) as error:
                if last or not self._has_ended(server):
                    raise self._not_started(name, server, error) from error
            else:
                break
        self._running[name], self._server_of[name] = process, server
        self._empty.clear()
        self._loop.add_reader(process.sentinel, self._ended, name)

    def restart(self, name: str, **more: object) -> None:
        """Start a child again that has ended, with its former arguments, except for those in `more`."""
        recipe = self._recipes[name]
        self.start(name, recipe.entry, {**recipe.arguments, **more}, gives_way=recipe.gives_way)

    def end_of_server(self, name: str) -> int | None:
        """The exit code of the server that this child was forked from, if it has ended, and the child with it."""
        return self._ended_servers.get(self._server_of[name])

    def _not_started(self, name: str, server: int, error: Exception) -> HostError:
        why = _NO_FOLDER if _folder_is_gone() else str(error)
        if self._has_ended(server):
            how = described(self._ended_servers[server])
            why = f"the server from which all processes are forked ended with {how} while it imported what they need"
        return HostError(f"{name} cannot be started: {why}")

    def _has_ended(self, server: int) -> bool:
        if server not in self._ended_servers and (code := _end_of_server(server)) is not None:
            self._ended_servers[server] = code
        return server in self._ended_servers

    def pid(self, name: str) -> int:
        pid = self._running[name].pid
        assert pid is not None, "a running child has a pid"
        return pid

    def names(self) -> list[str]:
        return list(self._running)

    def _ended(self, name: str) -> None:
        process = self._running.pop(name)
        self._loop.remove_reader(process.sentinel)
        process.join()
        code = process.exitcode or 0
        process.close()
        if code == _UNKNOWN_END and self._has_ended(self._server_of[name]):
            code = -signal.SIGKILL  # `be_killed_with_parent`
        if not self._running:
            self._empty.set()
        self._on_end(name, code)

    async def wait(self, timeout_s: float) -> bool:
        """Wait until all children have ended by themselves; returns False if some have not in time."""
        try:
            await asyncio.wait_for(self._empty.wait(), timeout_s)
        except TimeoutError:
            return False
        return True

    async def end_all(self) -> None:
        for process in list(self._running.values()):
            process.kill()
        if self._running and not await self.wait(_KILLED_S):
            _wake_server()
            await self.wait(_KILLED_S)


@atexit.register
def end_servers() -> None:
    """End those of multiprocessing's helper processes that were started for a swarm, some tens of milliseconds before
    they would end. A program with living children of its own is not held up.
    """
    if _started.get("process") != os.getpid() or multiprocessing.active_children():
        return
    # There is no public function for this; CPython's own tests use these calls.
    if "server" in _started:
        forkserver._forkserver._stop()  # type: ignore[attr-defined]  # noqa: SLF001
    if "tracker" in _started:
        resource_tracker._resource_tracker._stop()  # type: ignore[attr-defined]  # noqa: SLF001
