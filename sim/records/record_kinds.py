"""The kinds of trace records; and the records of a trace while it is in memory or on disk: by kind, as lines, or
deliveries as columns of numbers.

A log on disk can leave most of what was not asked for undecoded, so analysis code calls `records_of`, `lines` and
`delivery_columns`. There are millions of deliveries in an hour of a large swarm, and numpy handles a column many times
as fast as Python its records.
"""

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final, NamedTuple, TypeVar, get_args, overload

import numpy as np
import numpy.typing as npt

from fanet_mw import trace
from fanet_mw.trace import Delivered, Record
from sim.records.spool import OnDisk

A = TypeVar("A", bound=Record)
B = TypeVar("B", bound=Record)
C = TypeVar("C", bound=Record)
D = TypeVar("D", bound=Record)
KINDS: Final[tuple[type[Any], ...]] = tuple(sorted(get_args(Record), key=trace.name_of))
CODES: Final = {kind: code for code, kind in enumerate(KINDS)}
"""The number of each kind, its index in `KINDS`, by which a log on disk names the kind of a record."""


class StoredTrace(OnDisk[Record]):
    """A trace on disk, which can leave undecoded what is not asked for."""

    @abstractmethod
    def of_kinds(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        """The records of these kinds, in the order of the trace."""

    def lines(self) -> Iterator[bytes]:
        """The lines of the trace file."""
        return _as_lines(self)

    def delivery_columns(self) -> "Iterator[DeliveryColumns]":
        """All deliveries in the order of the trace, in portions."""
        return in_columns(self.of_kinds((Delivered,)))  # type: ignore[arg-type]


@overload
def records_of(records: Iterable[Record], kind: type[A], /) -> Iterator[A]: ...
@overload
def records_of(records: Iterable[Record], kind: type[A], other: type[B], /) -> Iterator[A | B]: ...
@overload
def records_of(records: Iterable[Record], kind: type[A], other: type[B], third: type[C], /) -> Iterator[A | B | C]: ...
@overload
def records_of(
    records: Iterable[Record], kind: type[A], other: type[B], third: type[C], fourth: type[D], /
) -> Iterator[A | B | C | D]: ...
@overload
def records_of(records: Iterable[Record], *kinds: type[Record]) -> Iterator[Record]: ...
def records_of(records: Iterable[Record], *kinds: type[Any]) -> Iterator[Any]:
    """The records of these kinds, in the order of the trace."""
    if isinstance(records, StoredTrace):
        return records.of_kinds(kinds)
    return (record for record in records if type(record) in kinds)


def lines(records: Iterable[Record]) -> Iterator[bytes]:
    """The lines of the trace file, each one JSON array."""
    return records.lines() if isinstance(records, StoredTrace) else _as_lines(records)


def _as_lines(records: Iterable[Record]) -> Iterator[bytes]:
    return (f"{trace.line(record)}\n".encode() for record in records)


_PORTION: Final = 4096
Column = npt.NDArray[np.integer[Any]]


class DeliveryColumns(NamedTuple):
    """Some deliveries in the order of the trace: the fields of `Delivered`, each as a column [n]."""

    t_ns: Column
    node: Column
    origin: Column
    seq: Column
    delay_ns: Column
    hops: Column
    handover_ns: Column


def delivery_columns(records: Iterable[Record]) -> Iterator[DeliveryColumns]:
    return (
        records.delivery_columns() if isinstance(records, StoredTrace) else in_columns(records_of(records, Delivered))
    )


def in_columns(deliveries: Iterable[Delivered]) -> Iterator[DeliveryColumns]:
    rest = iter(deliveries)
    while portion := list(islice(rest, _PORTION)):
        yield DeliveryColumns(*np.array(portion, dtype=np.int64).T)
