"""A temporary file without a name for what a run collects, so that memory does not grow with the run.

    file = (length, bytes)*

An item is appended whole or not at all. A full disk ends the spool and not the run: what the spool has stays readable.
"""

import os
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError

_LENGTH: Final = struct.Struct("<I")
_BUFFER: Final = 1 << 20


class Spool:
    """Items of bytes, written during a run and read after it; raises ConfigError when no file can be made."""

    def __init__(self, folder: Path | None = None) -> None:
        try:
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115  (closed by `close`)
        except OSError as error:
            where = folder if folder is not None else "the folder of temporary files (see TMPDIR)"
            raise ConfigError(f"{where}: no file can be made there: {error.strerror}") from error
        self._write = os.pwrite
        self.size = 0
        """The bytes of the file that belong to whole items."""
        self.failure: str | None = None
        """Why no more items are accepted; None while they are."""

    def append(self, item: bytes) -> bool:
        """Write an item at the end; returns True if it is kept."""
        if self.failure is not None:
            return False
        data = _LENGTH.pack(len(item)) + item
        try:
            written = self._write(self._file.fileno(), data, self.size)
        except OSError as error:
            self.failure = error.strerror or str(error)
            return False
        if written < len(data):
            self.failure = "no space left for the whole of an item"
            return False
        self.size += written
        return True

    def items(self) -> Iterator[bytes]:
        """The items in the order in which they were appended; may be read repeatedly."""
        with open(os.dup(self._file.fileno()), "rb", buffering=_BUFFER) as file:  # noqa: PTH123  (it has no path)
            file.seek(0)
            left = self.size
            while left:
                (length,) = _LENGTH.unpack(file.read(_LENGTH.size))
                yield file.read(length)
                left -= _LENGTH.size + length

    def close(self) -> None:
        """Free the disk space."""
        self._file.close()
