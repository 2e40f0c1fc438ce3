"""A list of items that only grows, and that moves its items from memory to a file on disk whenever they become many.

It bounds the memory that a long run needs. Once the disk is full, later items stay in memory.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, Generic, TypeVar

from fanet_mw.errors import ConfigError
from sim.run.collecting.spool import Spool

T = TypeVar("T")
MOST_IN_MEMORY: Final = 1 << 9
"""The number of items at which those in memory are moved to disk. So few trace records are still in the processor's
cache when they are packed, and the next ones take their place there: a run takes less time than if all its records
stayed in memory."""


class DiskBackedLog(Generic[T]):
    """Items of one type in the order of their adding: the latest in memory, all before them on disk."""

    def __init__(
        self, pack: Callable[[Sequence[T]], Sequence[bytes]], folder: Path | None, most_in_memory: int
    ) -> None:
        """`pack` encodes the items that are moved to disk together, as one or several byte strings. The file is made in
        `folder`, by default in the system's folder for temporary files.
        """
        self._pack = pack
        self._folder = folder
        self._most = most_in_memory
        self._spool: Spool | None = None
        self._disk_is_full = False
        self._moved = 0
        """The number of items on disk."""
        self.latest: list[T] = []
        """The items in memory."""

    def __len__(self) -> int:
        return self._moved + len(self.latest)

    def extend(self, items: Iterable[T]) -> None:
        self.latest += items
        if len(self.latest) >= self._most and not self._disk_is_full:
            self._move()

    def stored(self) -> Iterator[bytes]:
        """The byte strings that `pack` has made of the items on disk, in their order."""
        return iter(()) if self._spool is None else self._spool.items()

    def _move(self) -> None:
        """Move all items in memory to disk; if they cannot be written, they and all later ones stay in memory."""
        try:
            if self._spool is None:
                self._spool = Spool(self._folder)
            kept = self._spool.append(*self._pack(self.latest))
        except ConfigError:  # no file can be made there
            kept = False
        if kept:
            self._moved += len(self.latest)
            self.latest = []
        self._disk_is_full = not kept
