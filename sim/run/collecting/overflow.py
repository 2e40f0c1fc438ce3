"""What a run in virtual time collects: in memory while it is short, beyond that on disk, a portion at a time.

    portion of a trace = the kind of each record | its deliveries, which are nine in ten | its other records

A reader of a trace that asks for some kinds decodes no others. All is read in the order in which it was made. Where the
disk takes no more, what comes then stays in memory.
"""

import pickle
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, get_args

from fanet_mw.errors import ConfigError
from fanet_mw.trace import Delivered, Record
from sim.run.collecting.spool import Spool

T = TypeVar("T")
MOST_IN_MEMORY: Final = 1 << 17
"""So many items are kept in memory: of records some 25 MB, a minute of a rescue by 45 UAVs."""
_KINDS: Final[tuple[type[Any], ...]] = get_args(Record)
_CODES: Final = {kind: code for code, kind in enumerate(_KINDS)}
_DELIVERED: Final = _CODES[Delivered]
_ROW: Final = struct.Struct("<qHHIqHq")
"""A delivery: instant, node, origin, sequence number, delay, hops, handover."""
Change = Callable[[Delivered], Delivered]


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

    @property
    def all_in_memory(self) -> bool:
        return not self._moved

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


def _unpickled(data: bytes) -> list[Any]:
    found: list[Any] = pickle.loads(data)  # noqa: S301  (this process has written it, into a file without a name)
    return found


# --- telemetry --------------------------------------------------------------------------------------------------------


class TapLog(Collection[tuple[int, bytes]]):
    """Pairs (instant ns, MAVLink bytes) in the order of their making."""

    def __init__(self, folder: Path | None = None, *, most_in_memory: int = MOST_IN_MEMORY) -> None:
        self._taps = Overflow[tuple[int, bytes]](lambda taps: (pickle.dumps(taps),), folder, most_in_memory)

    def append(self, tap: tuple[int, bytes]) -> None:
        self._taps.extend((tap,))

    def __len__(self) -> int:
        return len(self._taps)

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        stored = map(_unpickled, self._taps.stored())
        return chain(chain.from_iterable(stored), self._taps.latest)

    def __contains__(self, tap: object) -> bool:
        return any(one == tap for one in self)


# --- traces -----------------------------------------------------------------------------------------------------------


class TraceLog(Collection[Record]):
    """The trace records of a run in the order of their making."""

    def __init__(self, folder: Path | None = None, *, most_in_memory: int = MOST_IN_MEMORY) -> None:
        self._records = Overflow[Record](_packed, folder, most_in_memory)
        self._change: Change | None = None

    def extend(self, records: Iterable[Record]) -> None:
        """Take in records at the end."""
        self._records.extend(records)

    def changed(self, change: Change) -> "TraceLog":
        """The same records with every delivery changed, whenever it is read."""
        other = TraceLog()
        other._records, other._change = self._records, change
        return other

    def __len__(self) -> int:
        return len(self._records)

    def __contains__(self, record: object) -> bool:
        return any(one == record for one in self)

    def __iter__(self) -> Iterator[Record]:
        for codes, rows, others in self._portions():
            delivered, rest = self._deliveries(rows), iter(_unpickled(others))
            for code in codes:
                yield next(delivered) if code == _DELIVERED else _KINDS[code]._make(next(rest))
        yield from self._latest()

    def of(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        """The records of some kinds, in their order."""
        if Delivered in kinds and len(kinds) > 1:
            yield from (record for record in self if type(record) in kinds)
            return
        wanted = {_CODES[kind] for kind in kinds}
        for codes, rows, others in self._portions():
            if _DELIVERED in wanted:
                yield from self._deliveries(rows)
            elif not wanted.isdisjoint(codes):
                rest = codes.replace(bytes((_DELIVERED,)), b"")
                for code, fields in zip(rest, _unpickled(others), strict=True):
                    if code in wanted:
                        yield _KINDS[code]._make(fields)
        yield from (record for record in self._latest() if type(record) in kinds)

    def _portions(self) -> Iterator[tuple[bytes, bytes, bytes]]:
        items = self._records.stored()
        return zip(items, items, items, strict=True)

    def _deliveries(self, rows: bytes) -> Iterator[Delivered]:
        found = map(Delivered._make, _ROW.iter_unpack(rows))
        return found if self._change is None else map(self._change, found)

    def _latest(self) -> Iterator[Record]:
        change = self._change
        if change is None:
            return iter(self._records.latest)
        return (change(record) if type(record) is Delivered else record for record in self._records.latest)


def _packed(records: Sequence[Record]) -> tuple[bytes, bytes, bytes]:
    codes = bytes(_CODES[type(record)] for record in records)
    rows = b"".join(_ROW.pack(*record) for record in records if type(record) is Delivered)
    return codes, rows, pickle.dumps([tuple(record) for record in records if type(record) is not Delivered])
