"""Keeps what parts of other packages do to their process away from the command that runs them.

`fanet simulate` flies them in a child: what ends a process from C, perhaps with exit code 0, ends that child, and is
told; a thread that a part leaves does not keep the command. What parts print is not mixed with the JSON of a summary.
"""

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Final

from fanet_mw.hosts import interrupts
from sim.results.outcome import described
from sim.run.launcher.process_setup import be_killed_with_parent

_STOPS: Final = (signal.SIGTSTP, signal.SIGCONT)
_NAMED: Final = 3


@contextmanager
def own_output(*, json: bool) -> Iterator[None]:
    """With `json`, what is printed meanwhile, from C too, goes to standard error; a part may replace `sys.stdout`."""
    sys.stdout.flush()
    with redirect_stdout(sys.stderr if json else sys.stdout):
        if not json:
            yield
            return
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def in_own_process(work: Callable[[], int], parts: Iterable[str]) -> int:
    """Do `work` in a child, whose parent leaves with its exit code and says what has ended it without a word. A caller
    that is no command of its own, such as a test, does it itself.
    """
    if not interrupts.installed():
        return work()
    parent, (read, write) = os.getpid(), os.pipe()
    waited: set[int] = {signal.SIGCHLD, *_STOPS, *interrupts.heeded()}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, waited)
    sys.stdout.flush()
    child = os.fork()
    if child:
        os.close(write)
        interrupts.leave(_code(_awaited(child, waited), read, parts))
    os.setpgid(0, 0)  # a terminal's signals come by the parent, once
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # it may write there all the same
    be_killed_with_parent()
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    if os.getppid() != parent:
        os._exit(1)
    try:
        code = work()
    finally:
        os.write(write, b".")  # Python goes on, and says what it raises
    _leave_threads(code)
    return code


def _leave_threads(code: int) -> None:
    """End the process now if a part has left threads, for which Python would wait for ever."""
    left = [one.name for one in threading.enumerate() if not one.daemon and one is not threading.main_thread()]
    if not left:
        return
    names = ", ".join(left[:_NAMED]) + (f" and {len(left) - _NAMED} more" if len(left) > _NAMED else "")
    sys.stderr.write(f"fanet: a part of another package has left threads, which are not waited for: {names}\n")
    atexit._run_exitfuncs()  # noqa: SLF001  (what the part has registered)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _awaited(child: int, waited: set[int]) -> int:
    """The wait status of a child, to which the signals of this process are handed on."""
    while True:
        number = signal.sigwait(waited)
        if number == signal.SIGCHLD:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status
        elif number == signal.SIGTSTP:
            os.kill(child, signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGSTOP)
        else:
            os.kill(child, number)


def _code(status: int, read: int, parts: Iterable[str]) -> int:
    code = os.waitstatus_to_exitcode(status)
    os.set_blocking(read, False)  # another child of the part may hold it open
    try:
        if os.read(read, 1):
            return code if code >= 0 else 128 - code
    except BlockingIOError:
        pass
    sys.stderr.write(
        f"fanet: the run has no result: its process, which flew parts of {', '.join(parts)}, was ended with "
        f"{described(code)}, from C or by another program\n"
    )
    return code or 1 if code >= 0 else 128 - code
