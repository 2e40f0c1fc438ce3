"""An event loop whose timers are accurate to some tens of microseconds, and which ends in good order on a signal.

asyncio's usual loop sleeps in epoll, which counts whole milliseconds and rounds up, so each wake-up is half a
millisecond late on average. select() counts microseconds. It examines all descriptors, which costs little because there
are few.
"""

import asyncio
import selectors
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from fanet_mw.hosts import interrupts

T = TypeVar("T")


def run(main: Coroutine[Any, Any, T]) -> T:
    """As `asyncio.run`. With `interrupts.install`, a signal cancels `main`, and KeyboardInterrupt has its number."""
    with asyncio.Runner(loop_factory=_loop) as runner:
        return runner.run(_cancelled_by_signals(main) if interrupts.installed() else main)


async def _cancelled_by_signals(main: Coroutine[Any, Any, T]) -> T:
    task = asyncio.ensure_future(main)
    caught: list[int] = []

    def on_signal(number: int) -> None:
        caught.append(number)
        task.cancel()

    try:
        with heeding(on_signal):
            return await task
    except asyncio.CancelledError:
        if not caught:
            raise
        raise KeyboardInterrupt(caught[0]) from None
    finally:
        interrupts.install()


@contextmanager
def heeding(on_signal: Callable[[int], object]) -> Iterator[None]:
    """Call `on_signal` with the number of each signal meanwhile, on the loop that runs, where the process handles it;
    raises KeyboardInterrupt if one got lost before.
    """
    loop, numbers = asyncio.get_running_loop(), interrupts.heeded()
    for number in numbers:
        loop.add_signal_handler(number, on_signal, number)
    try:
        interrupts.raise_again()
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)


def _loop() -> asyncio.AbstractEventLoop:
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
