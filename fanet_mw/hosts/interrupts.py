"""How the commands of this project react to SIGINT, SIGTERM and SIGHUP, and how a command exits.

Each entry point calls `install`, because Python leaves a SIGINT ignored that was so at the start, as a shell script has
it for `command &`. Signals then raise KeyboardInterrupt with their number, or cancel the coroutine of `hosts.loop.run`.
Some libraries swallow an exception during an import, others replace it: `raise_again` and `undisguised` are for these.
"""

import gc
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final, NoReturn

ENDED_BY: Final = "ended by {} before there was a result"
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_raised: Final[list[int]] = []


def _raise(number: int, _frame: FrameType | None) -> NoReturn:
    _raised.append(number)
    raise KeyboardInterrupt(number)


def heeded() -> list[signal.Signals]:
    """The signals that this process handles."""
    return [number for number in SIGNALS if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


def install() -> None:
    """Handle the signals from now on, even if the process was started with SIGINT ignored."""
    _raised.clear()
    for number in heeded():
        signal.signal(number, _raise)


def raise_again() -> None:
    """Raise KeyboardInterrupt if one was raised since `install` and got lost."""
    if _raised:
        raise KeyboardInterrupt(_raised[0])


@contextmanager
def undisguised() -> Iterator[None]:
    """Raise KeyboardInterrupt in place of an error that leaves this context, if one was raised since `install`."""
    try:
        yield
    except Exception:
        raise_again()
        raise


def is_signal(error: BaseException) -> bool:
    """True for the KeyboardInterrupt of a signal; a part of another package may raise one, too."""
    return isinstance(error, KeyboardInterrupt) and (
        bool(_raised)
        or isinstance(next(iter(error.args), None), int)
        or signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )


def installed() -> bool:
    """True if `install` was called; it is not in children of `fanet launch`, whose launcher handles the signals."""
    return signal.getsignal(signal.SIGTERM) is _raise


@contextmanager
def handed_to(on_signal: Callable[[int], None]) -> Iterator[None]:
    """Call `on_signal` with the first signal's number; further ones, and one that got lost, raise KeyboardInterrupt."""

    def first(number: int, _frame: FrameType | None) -> None:
        install()
        on_signal(number)

    before = {number: signal.getsignal(number) for number in heeded()}
    for number in before:
        signal.signal(number, first)
    try:
        raise_again()
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """The exit code that a shell shows for a process that was ended by this signal."""
    number: int = interrupt.args[0] if interrupt.args else signal.SIGINT
    return 128 + number


def sentence(interrupt: KeyboardInterrupt) -> str | None:
    """What a command says that another program has ended; None if a user has, or if it has been said (`said`)."""
    number, *said = interrupt.args or (signal.SIGINT,)
    if said or number == signal.SIGINT:
        return None
    return ENDED_BY.format(signal.Signals(number).name)


def said(number: int) -> KeyboardInterrupt:
    """An interrupt of which the user has been told."""
    return KeyboardInterrupt(number, "said")


def leave(code: int) -> NoReturn:
    """End the process without a final garbage collection, which takes seconds with numba on a busy machine. CPython
    ends `python -m` with SIGINT, whatever the code, once a KeyboardInterrupt has left a text that `exec` runs, as
    `namedtuple` does during imports; the next such text makes it forget.
    """
    exec("")  # noqa: S102
    gc.freeze()
    sys.exit(code)
