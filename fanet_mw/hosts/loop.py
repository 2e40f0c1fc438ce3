"""An event loop whose timers are good to some tens of microseconds.

asyncio's usual loop sleeps in epoll, which counts whole milliseconds and rounds up: every wake-up is half a millisecond
late on average. select() counts microseconds; that it looks at every descriptor costs nothing with the few we have.
"""

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


def run(main: Coroutine[Any, Any, T]) -> T:
    """As `asyncio.run`."""
    with asyncio.Runner(loop_factory=_loop) as runner:
        return runner.run(main)


def _loop() -> asyncio.AbstractEventLoop:
    return asyncio.SelectorEventLoop(selectors.SelectSelector())
