"""The console script: `fanet`, or `python -m fanet_mw`. Ctrl-C ends it quietly from the first moment on.

Importing the command line takes half a second, and a signal in this time would normally print a traceback. The command
line is imported by its name, and only after this installation was found complete, because this package must not depend
on it.
"""

import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from types import FrameType
from typing import NoReturn

from fanet_mw.hosts.interrupts import ENDED_BY
from fanet_mw.installation import damage


def main() -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup ignores it
            signal.signal(number, _leave)
    if (why := damage()) is not None:
        sys.stderr.write(f"fanet: {why}\n")
        sys.exit(2)
    import_module("sim.cli.app").main()


def _leave(number: int, _frame: FrameType | None) -> NoReturn:
    if number != signal.SIGINT:
        with suppress(OSError):  # nobody may be listening any more
            os.write(2, f"fanet: {ENDED_BY.format(signal.Signals(number).name)}\n".encode())
    os._exit(128 + number)  # nothing has been started yet, so nothing must be cleaned up


if __name__ == "__main__":
    main()
