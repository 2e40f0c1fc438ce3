"""The kinds of trace records; and the records of a trace while it is in memory or on disk, by kind or as lines.

A log on disk can leave most of what was not asked for undecoded, so analysis code calls `records_of` and `lines`.
"""

from collections.abc import Iterable, Iterator
from typing import Any, Final, Protocol, TypeVar, get_args, overload, runtime_checkable

from fanet_mw import trace
from fanet_mw.trace import Record

A = TypeVar("A", bound=Record)
B = TypeVar("B", bound=Record)
C = TypeVar("C", bound=Record)
D = TypeVar("D", bound=Record)
KINDS: Final[tuple[type[Any], ...]] = tuple(sorted(get_args(Record), key=trace.name_of))
"""All kinds of records, sorted by name."""
CODES: Final = {kind: code for code, kind in enumerate(KINDS)}
"""The number of each kind, its index in `KINDS`, by which a log on disk names the kind of a record."""


@runtime_checkable
class StoredByKind(Protocol):
    """A trace that can give the records of some kinds without decoding all the others."""

    def of_kinds(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        """The records of these kinds, in the order of the trace."""


@runtime_checkable
class StoredAsLines(Protocol):
    """A trace that stores each record as the line of text that the trace file has for it."""

    def lines(self) -> Iterator[bytes]:
        """The lines of the trace file."""


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
    if isinstance(records, StoredByKind):
        return records.of_kinds(kinds)
    return (record for record in records if type(record) in kinds)


def lines(records: Iterable[Record]) -> Iterator[bytes]:
    """The lines of the trace file, each one JSON array."""
    if isinstance(records, StoredAsLines):
        return records.lines()
    return (f"{trace.line(record)}\n".encode() for record in records)
