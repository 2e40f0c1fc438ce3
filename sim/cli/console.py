"""Printing for people, and the end of a command whose reader has gone: `fanet ... | head` ends as any Unix tool
does.
"""

import os
import sys
from typing import Final, NoReturn

import rich.console

CLOSED: Final = 128 + 13
"""The exit code that a shell shows for a process that SIGPIPE ended."""


class Console(rich.console.Console):
    """rich's, but a reader that is gone is an error like any other: `main` ends the command."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        raise


def nobody_reads() -> NoReturn:
    """End the command without a word. The signal itself would also end a service whose peer has closed a socket."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):  # what is buffered would fail once more at exit
        os.dup2(nowhere, stream.fileno())
    sys.exit(CLOSED)
