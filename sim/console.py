"""Prints for people, and ends a command quietly if its reader has gone, as in `fanet ... | head`."""

import io
import os
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final, NoReturn

from rich.console import Console as RichConsole
from rich.text import Text

if TYPE_CHECKING:
    from rich.table import Table

CLOSED: Final = 128 + 13
"""The exit code that a shell shows for a process that SIGPIPE ended."""

_NARROWEST: Final = 20
_UNWRAPPED: Final = 10_000
"""The width where no terminal limits it: nothing is this long."""


class Console(RichConsole):
    """rich, but a closed pipe raises an error, brackets are no markup, lines without a terminal are not wrapped."""

    def __init__(self, *, wraps: bool = False, **options: Any) -> None:  # noqa: ANN401  (they are those of rich)
        """`wraps`: lines are wrapped in a pipe, too."""
        stated = os.environ.get("COLUMNS", "")
        if not (stated.isdecimal() and int(stated) >= _NARROWEST):  # some programs export 0, in which nothing fits
            options["_environ"] = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
            stated = ""
        super().__init__(markup=False, **options)
        if not (wraps or self.is_terminal or stated):
            self.width = _UNWRAPPED

    def print(self, *objects: Any, **options: Any) -> None:  # noqa: ANN401  (they are those of rich)
        if self.is_terminal:
            super().print(*objects, **options)
            return
        with self.capture() as captured:
            super().print(*objects, **options)
        self.file.write("\n".join(line.rstrip() for line in captured.get().split("\n")))

    def render_str(self, text: str, **options: Any) -> Text:  # noqa: ANN401
        """What is printed may be somebody else's: what would move the cursor is escaped."""
        return super().render_str(printable(text), **options)

    def on_broken_pipe(self) -> None:
        self.quiet = True
        raise


def tell(text: str) -> None:
    """Say something on standard error, as it is."""
    Console(stderr=True).print(text, highlight=False, soft_wrap=True)


def table(headings: Sequence[str], rows: Iterable[Sequence[str]] = ()) -> "Table":
    """A table as commands print them; a name that is longer than its column goes on below."""
    from rich.table import Column, Table

    made = Table(
        *(Column(heading, overflow="fold") for heading in headings), box=None, header_style="bold", padding=(0, 2, 0, 0)
    )
    for row in rows:
        made.add_row(*row)
    return made


def printable(text: str) -> str:
    """A text in which what would move the cursor, but for ends of lines and tabs, is escaped."""
    return text if text.isprintable() else "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in text)


def open_closed_streams() -> None:
    """Let a standard stream that is closed (`>&-`) lead nowhere, so that no file which is opened takes its number."""
    closed = []
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
            closed.append(name)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False))
    if "stdout" in closed:
        sys.stderr.write("fanet: standard output is closed: what would be printed there is lost\n")


def escape_what_has_no_code() -> None:
    """Let a character that the encoding of the locale does not know (`LC_ALL=C`) be printed by its number."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def nobody_reads() -> NoReturn:
    """End the command without a message. (The default handling of SIGPIPE would also end services.)"""
    discard_output()
    sys.exit(CLOSED)


def discard_output() -> None:
    """Let what is buffered, and whatever is printed from now on, go nowhere; at exit it would fail once more."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nowhere, stream.fileno())
