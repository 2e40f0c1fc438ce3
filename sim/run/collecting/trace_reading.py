"""How a trace is read wherever it is: whole, by kinds of records, or as the lines of its file.

A reader of a trace asks for the kinds of records that it needs: of a trace on disk, only those are decoded. Stored
records name their kind by its number in `KINDS`.
"""

from collections.abc import Iterable, Iterator
from typing import Any, Final, Protocol, TypeVar, get_args, overload, runtime_checkable

from fanet_mw import trace
from fanet_mw.trace import Record

A = TypeVar("A", bound=Record)
B = TypeVar("B", bound=Record)
C = TypeVar("C", bound=Record)
KINDS: Final[tuple[type[Any], ...]] = tuple(sorted(get_args(Record), key=trace.name_of))
"""All kinds of records, by name."""
CODES: Final = {kind: code for code, kind in enumerate(KINDS)}


@runtime_checkable
class StoredByKind(Protocol):
    """A trace of which records of some kinds can be read alone."""

    def of(self, kinds: tuple[type[Record], ...]) -> Iterator[Record]:
        """The records of these kinds, in the order of the trace."""


@runtime_checkable
class StoredAsLines(Protocol):
    """A trace whose records are stored as they stand in the trace file."""

    def lines(self) -> Iterator[bytes]:
        """The lines of the trace file."""


@overload
def of(records: Iterable[Record], kind: type[A], /) -> Iterator[A]: ...
@overload
def of(records: Iterable[Record], kind: type[A], other: type[B], /) -> Iterator[A | B]: ...
@overload
def of(records: Iterable[Record], kind: type[A], other: type[B], third: type[C], /) -> Iterator[A | B | C]: ...
@overload
def of(records: Iterable[Record], *kinds: type[Record]) -> Iterator[Record]: ...
def of(records: Iterable[Record], *kinds: type[Any]) -> Iterator[Any]:
    """The records of some kinds, in the order of the trace."""
    if isinstance(records, StoredByKind):
        return records.of(kinds)
    return (record for record in records if type(record) in kinds)


def lines(records: Iterable[Record]) -> Iterator[bytes]:
    """The lines of the trace file, each one JSON array."""
    if isinstance(records, StoredAsLines):
        return records.lines()
    return (f"{trace.line(record)}\n".encode() for record in records)
