"""Prints for people, and ends a command quietly if its reader has gone, as in `fanet ... | head`."""

import os
import sys
from typing import Final, NoReturn

import rich.console

CLOSED: Final = 128 + 13
"""The exit code that a shell shows for a process that SIGPIPE ended."""


class Console(rich.console.Console):
    """The console of rich, except that writing to a closed pipe raises an error; `main` then ends the command."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        raise


def nobody_reads() -> NoReturn:
    """End the command without a message. The default handling of SIGPIPE would also end a service whose peer closes a
    socket.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):  # what is buffered would fail once more at exit
        os.dup2(nowhere, stream.fileno())
    sys.exit(CLOSED)
