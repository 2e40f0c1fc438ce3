"""A temporary file to which a run writes items of bytes, so that its memory does not grow with the length of the run.

    file = (length, bytes)*

It has no name, and is gone when nothing refers to it. Items that are appended together are written whole or not at all.
If the disk is full, no more are accepted, but the run goes on, and the stored ones can be read.
"""

import heapq
import os
import struct
import tempfile
import weakref
from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar

from fanet_mw.errors import ConfigError
from fanet_mw.whole_file import batches

T = TypeVar("T")
_LENGTH: Final = struct.Struct("<I")
_BLOCK_BYTES: Final = 1 << 18
_SORTED_BYTES: Final = 1 << 23
"""The number of bytes of items that are sorted in memory at once."""


class OnDisk(Collection[T]):
    """Items that are decoded each time they are gone through."""

    def __contains__(self, value: object) -> bool:
        return any(item == value for item in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Spool:
    """A temporary file of items, written during a run and read after it; raises ConfigError if no file can be made."""

    def __init__(self, folder: Path | None = None) -> None:
        try:
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115  (closed by `close`)
        except OSError as error:
            where = folder if folder is not None else "the folder of temporary files (see TMPDIR)"
            raise ConfigError(f"{where}: no file can be made there: {error.strerror}") from error
        self._close = weakref.finalize(self, self._file.close)
        self._write = os.pwrite
        self.folder = folder
        self.size = 0
        """The length of the file, up to the end of its last complete item."""
        self.count = 0
        self.failure: str | None = None
        """Why no more items are accepted; None while they are."""

    def append(self, *items: bytes) -> bool:
        """Write items at the end; returns True if they are kept."""
        if not items:
            return True
        if self.failure is not None:
            return False
        data = b"".join(part for item in items for part in (_LENGTH.pack(len(item)), item))
        try:
            written = self._write(self._file.fileno(), data, self.size)
        except OSError as error:
            self.failure = error.strerror or str(error)
            return False
        if written < len(data):
            self.failure = "no space left for the whole of an item"
            return False
        self.size += written
        self.count += len(items)
        return True

    def items(self, start: int = 0, end: int | None = None) -> Iterator[bytes]:
        """The items in their order, or those between two sizes that the spool has had; several readers may read."""
        end = self.size if end is None else end
        unread, at, block = start, 0, b""
        while unread < end or at < len(block):
            if len(block) - at >= _LENGTH.size:
                (length,) = _LENGTH.unpack_from(block, at)
                item_end = at + _LENGTH.size + length
                if item_end <= len(block):
                    yield block[at + _LENGTH.size : item_end]
                    at = item_end
                    continue
                wanted = item_end - len(block)
            else:
                wanted = _LENGTH.size
            more = os.pread(self._file.fileno(), min(max(wanted, _BLOCK_BYTES), end - unread), unread)
            unread += len(more)
            block, at = block[at:] + more, 0

    def close(self) -> None:
        self._close()


def in_order(
    source: Spool, key: Callable[[bytes], Any], *, change: Callable[[bytes], bytes] = lambda item: item
) -> Spool | None:
    """A new spool with the items sorted by key (stably) after `change`; None if the disk has no room."""
    folder = source.folder
    if folder is not None and not folder.exists():  # whoever has removed it meanwhile costs no result
        folder = None
    try:
        runs, result = Spool(folder), Spool(folder)
    except ConfigError:  # there is room for nothing more, not even for a file
        return None
    ends = [0]
    for portion in batches(source.items(), least_bytes=_SORTED_BYTES):
        portion.sort(key=key)
        if not runs.append(*portion):
            return None
        ends.append(runs.size)
    merged = heapq.merge(*(runs.items(start, end) for start, end in pairwise(ends)), key=key)
    for portion in batches(map(change, merged), least_bytes=_BLOCK_BYTES):
        if not result.append(*portion):
            return None
    return result
