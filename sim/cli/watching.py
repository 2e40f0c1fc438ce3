"""What a command says on standard error while it works, and how far it is."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Final

from sim.console import Console

ERR: Final = Console(stderr=True)
Tell = Callable[[float, str, str], None]
"""Takes how far it is, that in words for a bar, and in a sentence for a line of its own."""


def say(text: str, *, style: str | None = None) -> None:
    """Say something to whoever watches; a terminal that has gone must not cost the result."""
    with suppress(OSError):
        ERR.print(text, style=style, highlight=False, soft_wrap=True)  # above the bar, if there is one


@contextmanager
def watched(
    name: str, total: float, unit: str, *, every_s: float, bar: bool = True, lines: bool = True
) -> Iterator[Tell]:
    """A progress bar for a person who is watching, and else a line from time to time."""
    if not (bar if ERR.is_terminal else lines):
        yield lambda *_: None
        return
    if ERR.is_terminal:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        far = TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit}")
        shown = Progress(
            TextColumn("{task.description}"), BarColumn(), far, TimeElapsedColumn(), console=ERR, transient=True
        )
        task = shown.add_task(name, total=total)
        shown.start()
        try:
            yield lambda done, words, _: shown.update(
                task, completed=done, description=f"{name}: {words}" if words else name
            )
        finally:
            with suppress(OSError):  # as in `say`
                shown.stop()
        return
    said_s = monotonic()

    def line(_done: float, _words: str, sentence: str) -> None:
        nonlocal said_s
        if monotonic() >= said_s + every_s:
            said_s = monotonic()
            say(sentence)

    yield line
