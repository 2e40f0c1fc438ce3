"""Traces on disk: in order whatever the order of their coming, and read by kinds as in memory."""

import errno
import os
import tracemalloc
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.trace import Approaching, Delivered, Dropped, Generated, LetOut, Posed, Record, kind_of
from fanet_mw.units import MS
from sim.records import spool as module
from sim.records.record_kinds import lines, records_of
from sim.records.spool import Spool, in_order
from sim.records.stored_records import RecordSpools, StoredRecords

INSTANTS = st.integers(-5, 20)
NODES = st.integers(0, 3)
RECORDS = st.lists(
    st.one_of(
        st.builds(Generated, INSTANTS, NODES, st.integers(0, 5), st.just("traffic"), st.just(9)),
        st.builds(Delivered, INSTANTS, NODES, NODES, st.integers(0, 5), st.just(9), st.just(1), st.integers(0, 9)),
        st.builds(LetOut, INSTANTS, NODES, st.integers(0, 5)),
        st.builds(Approaching, INSTANTS, NODES, st.just(1), st.just(3), st.just(1.5), st.just(2.5)),
    ),
    max_size=60,
)


@pytest.fixture(autouse=True, scope="module")
def _small_portions() -> Iterator[None]:
    """So small that a few records are several runs on disk."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_SORTED_BYTES", 300)
        patch.setattr(module, "_BLOCK_BYTES", 50)
        yield


def stored(records: list[Record], *, true_delays: bool = False) -> StoredRecords:
    with closing(RecordSpools()) as spools:
        assert spools.append(records[:7]) == spools.append(records[7:]) == 0
        found = spools.records(true_delays=true_delays)
    assert isinstance(found, StoredRecords), "they outlive the spools from which they were made"
    return found


@given(RECORDS)
def test_records_come_by_instant_node_and_kind_and_else_as_they_came(records: list[Record]) -> None:
    expected = sorted(records, key=lambda record: (record.t_ns, record.node, kind_of(record)))
    found = stored(records)
    assert [*found] == expected == [*found]
    assert len(found) == len(expected)
    assert [*lines(found)] == [*lines(expected)]
    for kinds in ((Delivered,), (Generated,), (Generated, LetOut), (LetOut, Delivered), (Dropped, Posed, Approaching)):
        assert (
            [*records_of(found, *kinds)]
            == [*records_of(expected, *kinds)]
            == [one for one in expected if type(one) in kinds]
        )


@given(RECORDS)
def test_two_readers_do_not_disturb_each_other(records: list[Record]) -> None:
    found = stored(records)
    assert [*zip(found, found, strict=True)] == [(record, record) for record in found]


def test_a_delay_counts_from_the_true_instant_of_generation_where_that_is_known() -> None:
    delivered = [Delivered(10 * MS, 2, 1, seq, 3 * MS, 1) for seq in (7, 8)]
    found = stored([*delivered, Generated(4 * MS, 1, 7, "traffic", 9)], true_delays=True)
    assert [record.delay_ns for record in records_of(found, Delivered)] == [6 * MS, 3 * MS]


def test_without_room_on_the_disk_to_sort_them_they_are_sorted_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    spools = RecordSpools()
    records = [Generated(MS * (50 - i), 1, i, "traffic", 9) for i in range(50)]
    spools.append([*records, Delivered(0, 2, 1, 1, 3, 1)])
    monkeypatch.setattr(os, "pwrite", lambda *_: 0)
    assert [*spools.records(true_delays=False)] == [Delivered(0, 2, 1, 1, 3, 1), *reversed(records)]
    spools.close()


def test_memory_does_not_depend_on_how_much_is_sorted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SORTED_BYTES", 40_000)
    most = []
    for count in (2_000, 20_000):
        spool = Spool()
        for number in range(count):
            spool.append(b"%08d" % (number * 7919 % count))
        tracemalloc.start()
        ordered = in_order(spool, lambda item: item)
        assert ordered is not None
        assert sum(item == b"%08d" % place for place, item in enumerate(ordered.items())) == count
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        spool.close()
        ordered.close()
    assert most[1] < 6 * most[0], "a reader for each run: far less than the items"


def test_a_folder_that_is_removed_during_the_run_costs_no_records(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with closing(RecordSpools(folder)) as spools:
        spools.append([LetOut(3, 1, 1), LetOut(2, 1, 0)])
        folder.rmdir()
        assert [one.t_ns for one in spools.records(true_delays=False)] == [2, 3]


def test_where_no_further_file_can_be_made_they_are_sorted_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk may have room and no inode left."""
    spools = RecordSpools()
    records = [Generated(MS * (50 - i), 1, i, "traffic", 9) for i in range(50)]
    spools.append(records)

    def no_inode(**_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.tempfile, "TemporaryFile", no_inode)
    assert [*spools.records(true_delays=False)] == records[::-1]
