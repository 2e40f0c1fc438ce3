"""Prepares the folder of `--out` before a run: it must be writable, and must not contain the result of another run.

    checked     before anything else, because a run may take an hour, and its result has nowhere else to go
    start       with --force: the earlier result is set aside
    replace     the run has begun: the earlier result is removed
    it raises   the earlier result is put back, if it was not removed

The folder is locked as long as the run lasts: another one would otherwise take it between the check and the first file,
or by --force.
"""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from emulator.pcap_file import NAME as CAPTURE
from emulator.pcap_file import captures
from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import keep_alone, writing
from sim.results.file_names import PAGES, PICTURES, RESERVED, RUN_FILES, SUMMARY_FILE, pictures

_MOST_SAID: Final = 8
_ASIDE: Final = ".earlier"
"""The folder in `--out` that holds the earlier result while a run starts."""


@contextlib.contextmanager
def alone(out: Path | None) -> Iterator[None]:
    """Make a folder and keep it from other runs, unless its file system locks nothing; raises ConfigError."""
    if out is None:
        yield
        return
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        folder = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    try:
        keep_alone(folder, f"--out {out}: another run writes there now; choose another folder")
        yield
    finally:
        os.close(folder)


class OutFolder:
    """The folder of a run, or none. What an earlier run has left stays until this one has begun."""

    def __init__(self, out: Path | None, *, force: bool) -> None:
        """Make the folder, or raise ConfigError: also if another run has left files in it, unless `force` is given."""
        self._out = out
        self._earlier: list[Path] = []
        self._started = False
        if out is None:
            return
        with writing(f"--out {out}"):
            out.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=out) as file:
                file.write(b"a run would be lost")
            if os.path.lexists(out / _ASIDE / SUMMARY_FILE):  # that run was killed before it began
                _put_back(out)
            self._earlier = _left_in(out)
        if self._earlier and not force:
            raise ConfigError(
                f"--out {out}: holds the result of another run ({_said(self._earlier)}); "
                "choose another folder, or replace it with --force"
            )

    def start(self) -> None:
        """Set the earlier result aside, and keep room for the new one; raises ConfigError."""
        if self._out is None:
            return
        from sim.results.files import begin

        self._started = True
        with writing(f"--out {self._out}"):
            for path in self._earlier:
                kept = self._out / _ASIDE / path.relative_to(self._out)
                kept.parent.mkdir(parents=True, exist_ok=True)
                path.rename(kept)
            _remove_empty(self._out / PICTURES)
        begin(self._out)

    def replace(self) -> None:
        """Remove the earlier result, and nothing else: the run has begun."""
        if self._out is None or not self._earlier:
            return
        self._earlier = []
        with writing(f"--out {self._out}"):
            for path in _left_in(self._out / _ASIDE):
                path.unlink()
            _remove_empty(self._out / _ASIDE / PICTURES)
            _remove_empty(self._out / _ASIDE)

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Put the earlier result back if the run ends by an error before it has begun; otherwise remove it."""
        try:
            yield
        except BaseException:
            if self._started and self._out is not None:
                _put_back(self._out)
            raise
        self.replace()


def _left_in(folder: Path) -> list[Path]:
    """What a run and its page have left in a folder, the summary first."""
    named = (folder / name for name in (*RUN_FILES, *PAGES, *RESERVED))
    return [path for path in (*named, *captures(folder / CAPTURE), *pictures(folder)) if os.path.lexists(path)]


def _put_back(out: Path) -> None:
    """Forget a run that has not begun, and put back what was set aside for it; the summary last, which says that there
    is something to put back.
    """
    from sim.results.files import forget

    forget(out)
    for path in reversed(_left_in(out / _ASIDE)):
        place = out / path.relative_to(out / _ASIDE)
        place.parent.mkdir(exist_ok=True)
        path.rename(place)
    _remove_empty(out / _ASIDE / PICTURES)
    _remove_empty(out / _ASIDE)


def _remove_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):  # it is missing, or holds files of another program
        folder.rmdir()


def _said(paths: Sequence[Path]) -> str:
    """The names of some files, and the number of the others."""
    others = len(paths) - _MOST_SAID
    return ", ".join(path.name for path in paths[:_MOST_SAID]) + (f" and {others} more" if others > 0 else "")
