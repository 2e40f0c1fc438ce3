"""The deliveries of a trace as columns of numbers, portion by portion.

There are millions in an hour of a large swarm, and numpy handles a column many times as fast as Python its records.
"""

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from fanet_mw.trace import Delivered, Record
from sim.records.record_kinds import records_of

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


@runtime_checkable
class StoredInColumns(Protocol):
    """A trace that can give its deliveries as columns without making records of them."""

    def delivery_columns(self) -> Iterator[DeliveryColumns]:
        """All deliveries in the order of the trace, in portions."""


def delivery_columns(records: Iterable[Record]) -> Iterator[DeliveryColumns]:
    if isinstance(records, StoredInColumns):
        return records.delivery_columns()
    return in_columns(records_of(records, Delivered))


def in_columns(deliveries: Iterable[Delivered]) -> Iterator[DeliveryColumns]:
    rest = iter(deliveries)
    while portion := list(islice(rest, _PORTION)):
        yield DeliveryColumns(*np.array(portion, dtype=np.int64).T)
