"""A list of items that only grows: what becomes much is packed, some hundred items at a time, and written to a file,
some hundred kilobytes at a time. Once the disk is full, what is packed stays in memory.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Final, Generic, TypeVar

from fanet_mw.errors import ConfigError
from sim.records.spool import Spool

T = TypeVar("T")
MOST_IN_MEMORY: Final = 1 << 9
"""Items at which those in memory are packed: so few records are still in the processor's cache then."""
MOST_PACKED_BYTES: Final = 1 << 18
"""Packed bytes at which they are written; each call of the operating system takes the cache from the run."""


class DiskBackedLog(Generic[T]):
    """Items of one type in the order of their adding: the latest as they are, all before them packed."""

    def __init__(
        self,
        pack: Callable[[Sequence[T]], Sequence[bytes]],
        folder: Path | None,
        *,
        most_in_memory: int = MOST_IN_MEMORY,
        most_packed_bytes: int = MOST_PACKED_BYTES,
    ) -> None:
        """`pack` encodes items together, as one or several byte strings; the file is made in `folder`."""
        self._pack = pack
        self._folder = folder
        self._most = most_in_memory
        self._most_packed_bytes = most_packed_bytes
        self._spool: Spool | None = None
        self._disk_is_full = False
        self._count = 0
        """The number of items that were packed."""
        self._packed: list[bytes] = []
        """The packed items that are not on disk."""
        self.latest: list[T] = []
        """The items that are not packed yet."""

    def __len__(self) -> int:
        return self._count + len(self.latest)

    def extend(self, items: Iterable[T]) -> None:
        self.latest += items
        if len(self.latest) >= self._most:
            self._pack_latest()

    def stored(self) -> Iterator[bytes]:
        """The byte strings that `pack` has made of all items but the latest, in their order."""
        return chain(() if self._spool is None else self._spool.items(), self._packed)

    def _pack_latest(self) -> None:
        self._packed += self._pack(self.latest)
        self._count += len(self.latest)
        self.latest = []
        if not self._disk_is_full and sum(map(len, self._packed)) >= self._most_packed_bytes:
            self._write()

    def _write(self) -> None:
        """Move what is packed to disk; if it cannot be written, it and all later items stay in memory."""
        try:
            if self._spool is None:
                self._spool = Spool(self._folder)
            kept = self._spool.append(*self._packed)
        except ConfigError:  # no file can be made there
            kept = False
        if kept:
            self._packed = []
        self._disk_is_full = not kept
