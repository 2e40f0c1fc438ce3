"""What a part of another package does to its process: it is told, and costs no other output."""

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from fanet_mw.hosts import interrupts
from sim.cli.foreign_parts import in_own_process, own_output


def ended(work: Callable[[], int], says: Path) -> int:
    """The exit code of a command that does this work in a process of its own and says so."""
    command = os.fork()
    if not command:
        try:
            os.dup2(os.open(says, os.O_WRONLY | os.O_CREAT), 2)
            sys.stderr = os.fdopen(2, "w")
            interrupts.install()
            code = in_own_process(work, ["mine", "yours"])
        except SystemExit as left:
            code = left.code  # type: ignore[assignment]
        except KeyboardInterrupt as interrupt:
            code = interrupts.exit_code(interrupt)
        except ValueError:
            code = 5
        finally:
            sys.stderr.flush()
            os._exit(code)
    _, status = os.waitpid(command, os.WUNTRACED)
    if os.WIFSTOPPED(status):
        os.kill(command, signal.SIGCONT)
        _, status = os.waitpid(command, 0)
    return os.waitstatus_to_exitcode(status)


def raises() -> NoReturn:
    raise ValueError


def leaves_threads() -> int:
    for name in "abcde":
        threading.Thread(target=time.sleep, args=(60,), name=name).start()
    return 3


def is_interrupted() -> int:
    os.kill(os.getppid(), signal.SIGTERM)
    time.sleep(60)
    return 0


def is_stopped() -> int:
    os.kill(os.getppid(), signal.SIGTSTP)
    time.sleep(0.01)
    return 6


_GONE = (
    "fanet: the run has no result: its process, which flew parts of mine, yours, was ended with {}, from C or by "
    "another program\n"
)


@pytest.mark.parametrize(
    ("work", "code", "said"),
    [
        (lambda: ctypes.CDLL(None)._exit(0), 1, _GONE.format("exit code 0")),
        (lambda: ctypes.CDLL(None)._exit(4), 4, _GONE.format("exit code 4")),
        (lambda: os.execv("/bin/true", ["true"]), 1, _GONE.format("exit code 0")),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), 137, _GONE.format("signal SIGKILL")),
        (lambda: 7, 7, ""),
        (raises, 5, ""),
        (is_interrupted, 143, ""),
        (is_stopped, 6, ""),
        (
            leaves_threads,
            3,
            "fanet: a part of another package has left threads, which are not waited for: a, b, c and 2 more\n",
        ),
    ],
)
def test_what_ends_a_process_without_a_word_is_told_and_is_no_success(
    tmp_path: Path, work: Callable[[], int], code: int, said: str
) -> None:
    assert ended(work, tmp_path / "err") == code
    assert (tmp_path / "err").read_text() == said


def test_with_json_nothing_else_is_on_standard_output(capfd: pytest.CaptureFixture[str]) -> None:
    with own_output(json=True):
        print("by Python")
        os.write(1, b"from C\n")
        sys.stdout = None  # type: ignore[assignment]
        os.close(1)
    print("{}")
    assert capfd.readouterr() == ("{}\n", "by Python\nfrom C\n")
    with own_output(json=False):
        print("by Python")
        sys.stdout = None  # type: ignore[assignment]
    print("a table")
    assert capfd.readouterr() == ("by Python\na table\n", "")
