"""How a command is interrupted, and how it leaves."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fanet_mw.hosts import interrupts, loop

LEAVES = """
import atexit, gc
from fanet_mw.hosts import interrupts
atexit.register(lambda: print(len(gc.get_objects()), gc.get_freeze_count()))
interrupts.leave(7)
"""


def test_a_command_leaves_with_its_code_and_without_a_last_collection_over_all_that_is_imported() -> None:
    done = subprocess.run([sys.executable, "-c", LEAVES], capture_output=True, text=True, check=False)
    left, frozen = map(int, done.stdout.split())
    assert done.returncode == 7
    assert frozen > 100 * max(left, 10)


INTERRUPTED_IN_A_TEXT = """
import os, signal
from fanet_mw.hosts import interrupts
interrupts.install()
try:
    exec("os.kill(os.getpid(), signal.SIGINT)")
except KeyboardInterrupt as interrupt:
    interrupts.leave(interrupts.exit_code(interrupt))
"""


def test_a_command_that_is_interrupted_while_an_import_runs_a_text_leaves_with_its_code(tmp_path: Path) -> None:
    """The shell shows 130 for both; a program that started the command sees whether it ended or was killed."""
    (tmp_path / "interrupted.py").write_text(INTERRUPTED_IN_A_TEXT)
    done = subprocess.run([sys.executable, "-m", "interrupted"], cwd=tmp_path, env=with_path(), check=False)
    assert done.returncode == 130


def with_path() -> dict[str, str]:
    return {"PYTHONPATH": ":".join(filter(None, sys.path))}


async def nothing() -> None:
    pass


@pytest.mark.parametrize("number", interrupts.SIGNALS)
def test_an_interrupt_that_an_import_took_for_its_failure_ends_what_starts_next(number: signal.Signals) -> None:
    before = [signal.getsignal(one) for one in interrupts.SIGNALS]
    try:
        signal.signal(number, signal.SIG_DFL)  # under nohup it would stay ignored
        interrupts.install()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt) as again:
            loop.run(nothing())
        assert interrupts.exit_code(again.value) == 128 + number
        loop.run(nothing())
    finally:
        interrupts.install()  # which forgets the interrupt: it must not end what a later test of this process runs
        for one, handler in zip(interrupts.SIGNALS, before, strict=True):
            signal.signal(one, handler)


def test_an_interrupt_without_the_number_of_a_signal_is_that_of_a_part_unless_python_handles_ctrl_c() -> None:
    before = [signal.getsignal(one) for one in interrupts.SIGNALS]
    try:
        interrupts.install()
        assert interrupts.is_signal(KeyboardInterrupt(signal.SIGTERM))
        assert not interrupts.is_signal(KeyboardInterrupt())
        assert not interrupts.is_signal(KeyboardInterrupt("stop"))
        signal.signal(signal.SIGINT, signal.default_int_handler)
        assert interrupts.is_signal(KeyboardInterrupt())
    finally:
        for one, handler in zip(interrupts.SIGNALS, before, strict=True):
            signal.signal(one, handler)


def test_an_interrupt_that_got_lost_ends_a_simulation_before_it_starts() -> None:
    before = [signal.getsignal(one) for one in interrupts.SIGNALS]
    try:
        interrupts.install()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt), interrupts.handed_to(lambda _: None):
            pytest.fail("nothing is started")
    finally:
        interrupts.install()  # which forgets the interrupt: it must not end what a later test of this process runs
        for one, handler in zip(interrupts.SIGNALS, before, strict=True):
            signal.signal(one, handler)


@pytest.mark.parametrize("interrupted", [True, False])
def test_an_interrupt_that_a_library_raises_as_an_error_of_its_own_is_an_interrupt_again(interrupted: bool) -> None:
    """pydantic does, while it builds a model: its SchemaError has the interrupt in its text alone."""
    before = [signal.getsignal(one) for one in interrupts.SIGNALS]
    expected = KeyboardInterrupt if interrupted else ValueError

    def library() -> None:
        with contextlib.suppress(KeyboardInterrupt):
            if interrupted:
                signal.raise_signal(signal.SIGTERM)
        raise ValueError("a schema could not be built")

    try:
        interrupts.install()
        with pytest.raises(expected) as raised, interrupts.undisguised():
            library()
        assert not interrupted or interrupts.exit_code(raised.value) == 143
    finally:
        interrupts.install()  # which forgets the interrupt: it must not end what a later test of this process runs
        for one, handler in zip(interrupts.SIGNALS, before, strict=True):
            signal.signal(one, handler)
