"""The console script: `fanet`, or `python -m sim`. Ctrl-C is quiet from the first moment on.

Importing the command line takes half a second, and a signal that comes meanwhile would show where Python was.
"""

import os
import signal
from types import FrameType
from typing import NoReturn


def main() -> None:
    """Import the command line, and run it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)
    from sim.cli.app import main as run

    run()


def _leave(number: int, _frame: FrameType | None) -> NoReturn:
    os._exit(128 + number)  # nothing has been started, nothing is to be written


if __name__ == "__main__":
    main()
