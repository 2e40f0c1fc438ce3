"""Telemetry that a run collects: in the order of its making, or by instant when it came from many processes."""

import os

import pytest

from sim.records.spool import Spool
from sim.run.collecting.taps import TapLog, encoded_tap, taps_of


def test_telemetry_is_read_as_it_was_heard() -> None:
    log, whole = TapLog(most_in_memory=7), [(number - 5, b"frame %d" % number) for number in range(22)]
    for tap in whole:
        log.append(tap)
    assert (len(log), list(log)) == (len(whole), whole)
    assert whole[3] in log


def test_telemetry_comes_by_instant() -> None:
    taps = Spool()
    for t_ns in (5, -1, 3, 3, 2**40):
        taps.append(encoded_tap(t_ns, str(taps.count).encode()))
    found = taps_of(taps)
    taps.close()
    assert [*found] == [(-1, b"1"), (3, b"2"), (3, b"3"), (5, b"0"), (2**40, b"4")]
    assert len(found) == 5
    assert (3, b"3") in found


def test_without_room_on_the_disk_to_sort_it_telemetry_is_sorted_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    taps = Spool()
    taps.append(encoded_tap(2, b"b"), encoded_tap(1, b"a"))
    monkeypatch.setattr(os, "pwrite", lambda *_: 0)
    assert [*taps_of(taps)] == [(1, b"a"), (2, b"b")]
    taps.close()
