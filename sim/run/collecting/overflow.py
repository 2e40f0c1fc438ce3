"""Items of one type that a run collects: in memory while they are few, beyond that on disk, a portion at a time.

They are read in the order in which they were made. Where the disk takes no more, what comes then stays in memory.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, Generic, TypeVar

from fanet_mw.errors import ConfigError
from sim.run.collecting.spool import Spool

T = TypeVar("T")
MOST_IN_MEMORY: Final = 1 << 17
"""So many items are kept in memory: of records some 25 MB, a minute of a rescue by 45 UAVs."""


class Overflow(Generic[T]):
    """Items of one type: the latest in memory, those before them on disk."""

    def __init__(
        self, pack: Callable[[Sequence[T]], Sequence[bytes]], folder: Path | None, most_in_memory: int
    ) -> None:
        """`pack` makes of a portion what is stored of it; files are made in `folder`, by default that for temporary
        files.
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
        """What was made of the portions on disk, one after another."""
        return iter(()) if self._spool is None else self._spool.items()

    def _move(self) -> None:
        """Move what is in memory to the disk."""
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
