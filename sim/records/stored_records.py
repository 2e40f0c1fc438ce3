"""The trace of a run in real time: its records arrive from many processes, and are sorted on disk when the run ends."""

import heapq
import struct
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Final

from fanet_mw import trace
from fanet_mw.trace import Delivered, Generated, Record
from sim.records.record_kinds import CODES, StoredTrace
from sim.records.spool import Spool, in_order

_KEY: Final = struct.Struct("<qHB")
"""The first bytes of a stored record and its sort key: instant, node, kind (`CODES`). A line of JSON follows."""


class RecordSpools:
    """Trace records on disk as they arrive: deliveries in one file, all other records in another.

    Nine records in ten are deliveries, so the others are read ten times faster from a file of their own.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._deliveries = Spool(folder)
        self._others = Spool(folder)

    def append(self, records: Iterable[Record]) -> int:
        """Write records at the end; returns the number of those that could not be written."""
        deliveries: list[bytes] = []
        others: list[bytes] = []
        for record in records:
            (deliveries if type(record) is Delivered else others).append(_encoded(record))
        parts = ((self._deliveries, deliveries), (self._others, others))
        return sum(len(items) for spool, items in parts if not spool.append(*items))

    @property
    def failure(self) -> str | None:
        """Why no more records are accepted; None while they are."""
        return self._deliveries.failure or self._others.failure

    def close(self) -> None:
        self._deliveries.close()
        self._others.close()

    def records(self, *, true_delays: bool) -> Collection[Record]:
        """All records, sorted by instant, node and kind: `StoredRecords`, or a list if the disk has no room for sorted
        copies. `true_delays`: delays count from the true instant of generation, where the trace has it.
        """
        born: dict[tuple[int, int], int] = {}
        if true_delays:
            generated = (one for one in map(_decoded, self._others.items()) if type(one) is Generated)
            born = {(one.node, one.seq): one.t_ns for one in generated}

        def with_true_delay(item: bytes) -> bytes:
            record = _decoded(item)
            assert type(record) is Delivered, "the file of deliveries has no other records"
            born_ns = born.get((record.origin, record.seq))
            return item if born_ns is None else _encoded(record._replace(delay_ns=record.t_ns - born_ns))

        change = with_true_delay if born else lambda item: item
        deliveries = in_order(self._deliveries, _KEY.unpack_from, change=change)
        others = in_order(self._others, _KEY.unpack_from)
        if deliveries is None or others is None:
            items = [*map(change, self._deliveries.items()), *self._others.items()]
            return [_decoded(item) for item in sorted(items, key=_KEY.unpack_from)]
        return StoredRecords(deliveries, others)


class StoredRecords(StoredTrace):
    """Trace records on disk, sorted: one file of deliveries and one of other records, merged while they are read."""

    def __init__(self, deliveries: Spool, others: Spool) -> None:
        self._deliveries = deliveries
        self._others = others

    def __len__(self) -> int:
        return self._deliveries.count + self._others.count

    def __iter__(self) -> Iterator[Record]:
        return map(_decoded, self._items())

    def of_kinds(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        if kinds == (Delivered,):
            return map(_decoded, self._deliveries.items())
        items = self._items() if Delivered in kinds else self._others.items()
        wanted = {CODES[kind] for kind in kinds}
        code_at = _KEY.size - 1
        return (_decoded(item) for item in items if item[code_at] in wanted)

    def lines(self) -> Iterator[bytes]:
        return (item[_KEY.size :] + b"\n" for item in self._items())

    def _items(self) -> Iterator[bytes]:
        return heapq.merge(self._deliveries.items(), self._others.items(), key=_KEY.unpack_from)


def _encoded(record: Record) -> bytes:
    return _KEY.pack(record.t_ns, record.node, CODES[type(record)]) + trace.line(record).encode()


def _decoded(item: bytes) -> Record:
    return trace.parse(item[_KEY.size :].decode())
