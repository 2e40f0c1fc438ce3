"""SIGINT and SIGTERM, as the commands of this project hear them, and how a command leaves.

Python hears SIGINT only when it was not ignored at the start of the process, and a shell script starts `command &` with
SIGINT ignored. Each entry point therefore calls `heed`: from then on both signals raise KeyboardInterrupt with the
signal's number, and `hosts.loop.run` cancels its coroutine instead, so that nothing is cut in half.
"""

import gc
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final, NoReturn

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


def _raise(number: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt(number)


def heed() -> None:
    """Hear both signals from here on, even if this process was started with them ignored."""
    for number in SIGNALS:
        signal.signal(number, _raise)


def heeded() -> bool:
    """False in a child of `fanet launch`, which leaves both signals to the launcher."""
    return all(signal.getsignal(number) is _raise for number in SIGNALS)


@contextmanager
def handed_to(hear: Callable[[int], None]) -> Iterator[None]:
    """Call `hear` with the number of the first signal that comes; any further one raises KeyboardInterrupt."""

    def first(number: int, _frame: FrameType | None) -> None:
        heed()
        hear(number)

    before = [signal.getsignal(number) for number in SIGNALS]
    for number in SIGNALS:
        signal.signal(number, first)
    try:
        yield
    finally:
        for number, handler in zip(SIGNALS, before, strict=True):
            signal.signal(number, handler)


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """What a shell shows for a process that this signal ended."""
    number: int = interrupt.args[0] if interrupt.args else signal.SIGINT
    return 128 + number


def leave(code: int) -> NoReturn:
    """End the process without a last garbage collection over everything that is imported.

    That collection takes a fifth of a second with numba, on a machine whose cores are busy several seconds of waiting.
    """
    gc.freeze()
    sys.exit(code)
