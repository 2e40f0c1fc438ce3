"""The trace of a run in virtual time stays in order and whole, in memory or on disk; memory holds only the latest."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from fanet_mw.errors import DropReason
from fanet_mw.trace import Delivered, Dropped, Generated, Posed, Record, line
from sim.records.record_kinds import delivery_columns, lines, records_of
from sim.records.trace_log import TraceLog

MOST = 7
"""So few records are kept in memory here, and packed."""
PACKED_BYTES = 400
"""Two packed portions are longer, so every second one is written, together with the one before it."""


def record(number: int) -> Record:
    """A record of the trace of all numbers: mostly deliveries, as in a run."""
    match number % 10:
        case 0:
            return Generated(number, 1, number, "load", 1024)
        case 3:
            return Posed(number, 2, number / 3, -0.0, 50.0)
        case 6:
            return Dropped(number, 3, DropReason.EXPIRED, 1, number)
        case _:
            return Delivered(number, 65_534, 1, 2**32 - 1, -number, 255, 2**40)


def log_of(count: int, *, folder: Path | None = None, most: int = MOST) -> TraceLog:
    log = TraceLog(folder, most_in_memory=most, most_packed_bytes=PACKED_BYTES)
    for number in range(count):
        log.extend([record(number)])
    return log


@pytest.mark.parametrize("count", [0, MOST - 1, MOST, MOST + 1, 5 * MOST, 5 * MOST + 3])
def test_a_trace_is_read_as_it_was_made_wherever_it_is(count: int) -> None:
    log, whole = log_of(count), [record(number) for number in range(count)]
    assert (len(log), list(log), list(log)) == (count, whole, whole)
    assert b"".join(lines(log)).decode() == "".join(f"{line(one)}\n" for one in whole)


@pytest.mark.parametrize("kinds", [(Delivered,), (Posed,), (Posed, Generated), (Delivered, Dropped)])
def test_a_reader_gets_the_kinds_it_asks_for_in_order(kinds: tuple[type[Record], ...]) -> None:
    whole = [record(number) for number in range(5 * MOST + 3)]
    assert list(records_of(log_of(len(whole)), *kinds)) == [one for one in whole if type(one) in kinds]


@pytest.mark.parametrize("changed", [False, True])
def test_deliveries_come_in_columns_as_in_records(changed: bool) -> None:
    log = log_of(5 * MOST + 3)
    if changed:
        log = log.changed(lambda delivered: delivered._replace(delay_ns=1))
    expected = [tuple(one) for one in log if type(one) is Delivered]
    for trace in (log, list(log)):
        columns = delivery_columns(trace)
        assert [row for portion in columns for row in np.transpose(portion).tolist()] == [*map(list, expected)]


def test_deliveries_are_changed_wherever_they_are() -> None:
    changed = log_of(5 * MOST + 3).changed(lambda delivered: delivered._replace(delay_ns=1))
    expected = [one._replace(delay_ns=1) if type(one) is Delivered else one for one in map(record, range(5 * MOST + 3))]
    assert list(changed) == expected
    assert b"".join(lines(changed)).decode() == "".join(f"{line(one)}\n" for one in expected)
    assert list(records_of(changed, Delivered)) == [one for one in expected if type(one) is Delivered]


def test_where_no_file_can_be_made_everything_stays_in_memory(tmp_path: Path) -> None:
    log = log_of(5 * MOST, folder=tmp_path / "not there")
    assert list(log) == [record(number) for number in range(5 * MOST)]


def test_memory_does_not_grow_with_a_run() -> None:
    tracemalloc.start()
    try:
        log = TraceLog(most_in_memory=100, most_packed_bytes=50_000)
        log.extend(record(number) for number in range(2_000))
        before, _ = tracemalloc.get_traced_memory()
        log.extend(record(number) for number in range(20_000))
        for number in range(20_000):
            log.extend([record(number)])
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(log) == 42_000
    assert after - before < 300_000, "all of them are some 10 MB, and more than one when they are packed"
