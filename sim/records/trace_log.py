"""The trace of a run in virtual time: the latest records are in memory, all records before them in a file on disk.

Records are packed in portions of some hundred, each of three byte strings:

    the kind of each record, one byte each | the deliveries, packed in rows | all other records, pickled

Nine records in ten are deliveries: who asks for them alone unpickles nothing, and gets them as columns or lines too.
"""

import pickle
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import compress, starmap
from pathlib import Path
from typing import Any, Final

import numpy as np

from fanet_mw.trace import DELIVERED_LINE, Delivered, Record, line
from sim.records.disk_backed_log import MOST_IN_MEMORY, MOST_PACKED_BYTES, DiskBackedLog
from sim.records.record_kinds import CODES, KINDS, DeliveryColumns, StoredTrace, in_columns

_DELIVERED: Final = CODES[Delivered]
_IS_DELIVERED: Final = bytes(code == _DELIVERED for code in range(256))
"""For each code of a kind, 1 if it is that of deliveries; else 0."""
_IS_OTHER: Final = bytes(code != _DELIVERED for code in range(256))
_FIELDS: Final = "qHHIqHq"
"""The layout of `Delivered`: instant, node, origin, sequence number, delay, hops, handover."""
_ROW: Final = struct.Struct("<" + _FIELDS)
_COLUMNS: Final = np.dtype([(name, "<" + kind) for name, kind in zip(Delivered._fields, _FIELDS, strict=True)])
_TEXT: Final = DELIVERED_LINE.encode() + b"\n"
Change = Callable[[Delivered], Delivered]
"""A function that corrects a delivery, such as its delay, which the receiver measured by its own clock."""


class TraceLog(StoredTrace):
    """The trace records of a run, in the order in which they were added."""

    def __init__(
        self,
        folder: Path | None = None,
        *,
        most_in_memory: int = MOST_IN_MEMORY,
        most_packed_bytes: int = MOST_PACKED_BYTES,
    ) -> None:
        self._records = DiskBackedLog[Record](
            _packed, folder, most_in_memory=most_in_memory, most_packed_bytes=most_packed_bytes
        )
        self._change: Change | None = None

    def extend(self, records: Iterable[Record]) -> None:
        self._records.extend(records)

    def changed(self, change: Change) -> "TraceLog":
        """A view of the same stored records that applies `change` to each delivery when it is read."""
        other = TraceLog()
        other._records, other._change = self._records, change
        return other

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[Record]:
        for codes, rows, others in self._portions():
            delivered, rest = self._deliveries(rows), iter(_unpickled(others))
            for code in codes:
                yield next(delivered) if code == _DELIVERED else KINDS[code]._make(next(rest))
        yield from self._latest()

    def of_kinds(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        if Delivered in kinds and len(kinds) > 1:
            yield from (record for record in self if type(record) in kinds)
            return
        wanted = {CODES[kind] for kind in kinds}
        for codes, rows, others in self._portions():
            if _DELIVERED in wanted:
                yield from self._deliveries(rows)
            elif not wanted.isdisjoint(codes):
                rest = codes.replace(bytes((_DELIVERED,)), b"")
                for code, fields in zip(rest, _unpickled(others), strict=True):
                    if code in wanted:
                        yield KINDS[code]._make(fields)
        yield from (record for record in self._latest() if type(record) in kinds)

    def delivery_columns(self) -> Iterator[DeliveryColumns]:
        if self._change is not None:
            yield from super().delivery_columns()
            return
        for _, packed, _ in self._portions():
            rows = np.frombuffer(packed, _COLUMNS)
            yield DeliveryColumns(*(rows[name] for name in Delivered._fields))
        yield from in_columns(record for record in self._latest() if type(record) is Delivered)

    def lines(self) -> Iterator[bytes]:
        if self._change is not None:
            yield from super().lines()
            return
        for codes, rows, others in self._portions():
            delivered, rest = iter(_lines(rows)), iter(_unpickled(others))
            for code in codes:
                if code == _DELIVERED:
                    yield next(delivered)
                else:
                    yield f"{line(KINDS[code]._make(next(rest)))}\n".encode()
        yield from (f"{line(record)}\n".encode() for record in self._latest())

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
    codes = bytes(map(CODES.__getitem__, map(type, records)))
    rows = b"".join(starmap(_ROW.pack, compress(records, codes.translate(_IS_DELIVERED))))
    return codes, rows, pickle.dumps(list(map(tuple, compress(records, codes.translate(_IS_OTHER)))))


def _lines(rows: bytes) -> list[bytes]:
    """The lines of packed deliveries. All numbers are formatted at once, in a third of the time of one line by one."""
    count = len(rows) // _ROW.size
    return (_TEXT * count % struct.unpack("<" + _FIELDS * count, rows)).splitlines(keepends=True)


def _unpickled(data: bytes) -> list[Any]:
    found: list[Any] = pickle.loads(data)  # noqa: S301  (this process has written it, into a file without a name)
    return found
