"""Opens and writes the file of a capture; the medium itself only knows `Capture`.

If the disk fails, the capture ends and the run goes on: one message says so, and the file keeps what it has.
"""

import contextlib
import re
import sys
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from emulator.pcap import Pcap
from fanet_mw.scenario import Radio
from fanet_mw.whole_file import require_in_place, writing

NAME: Final = "air.pcap"
_BUFFER: Final = 1 << 18


def unused(path: Path) -> Path:
    """`path`, or `path` with a number if that file exists: a restarted emulator must not overwrite a capture."""
    number = 1
    found = path
    while found.exists():
        number += 1
        found = path.with_stem(f"{path.stem}-{number}")
    return found


def captures(path: Path) -> list[Path]:
    """The captures that a finished run has left, in the order of time: `path`, and the same name with a number."""
    named = (
        (re.fullmatch(rf"{re.escape(path.stem)}(?:-(\d+))?", found.stem), found)
        for found in path.parent.glob(f"{path.stem}*{path.suffix}")
    )
    return [found for _, found in sorted((int(fits[1] or 1), found) for fits, found in named if fits)]


class PcapFile:
    """A `Pcap` that writes to a file; raises ConfigError when the file cannot be opened."""

    def __init__(self, path: Path, radio: Radio, *, receptions: bool = False) -> None:
        with writing(f"--pcap: {path}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: BinaryIO | None = path.open("wb", buffering=_BUFFER)
        self._path = path
        self._place = path.absolute()  # a part of another package may change the working folder
        self._failure: str | None = None
        self.pcap = Pcap(self._write, radio, receptions=receptions, flush=self._flush)

    def _write(self, data: bytes) -> None:
        if self._file is not None:
            try:
                self._file.write(data)
            except OSError as error:
                self._give_up(error)

    def _flush(self) -> str | None:
        if self._file is not None:
            try:
                self._file.flush()
                require_in_place(self._file, self._place)
            except OSError as error:
                self._give_up(error)
        return self._failure

    def _give_up(self, error: OSError) -> None:
        assert self._file is not None, "it was written to"
        with contextlib.suppress(OSError):
            self._file.close()
        self._file = None
        self._failure = error.strerror or str(error)
        sys.stderr.write(f"{self._path}: the capture ends here: {error.strerror}\n")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            try:
                self._file.close()
            except OSError as why:
                sys.stderr.write(f"{self._path}: the end of the capture is lost: {why.strerror}\n")
