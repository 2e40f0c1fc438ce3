"""The MAVLink traffic of a run as pairs of an instant and bytes, collected for the file `mavlink.tlog`.

A tap is a copy of MAVLink bytes that a node has produced or delivered (`MavlinkTap` on the bus). The file lets
MAVLink tools, such as a ground station, replay a run.
"""

import struct
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Final

from sim.records.disk_backed_log import MOST_IN_MEMORY, DiskBackedLog
from sim.records.spool import OnDisk, Spool, in_order

_INSTANT: Final = struct.Struct("<q")
Tap = tuple[int, bytes]
"""The instant [ns] at which a node produced or delivered MAVLink bytes, and those bytes."""


def encoded_tap(t_ns: int, frames: bytes) -> bytes:
    return _INSTANT.pack(t_ns) + frames


def _decoded_tap(item: bytes) -> Tap:
    return _INSTANT.unpack_from(item)[0], item[_INSTANT.size :]


def _encoded(taps: Sequence[Tap]) -> list[bytes]:
    return [encoded_tap(*tap) for tap in taps]


class TapLog(OnDisk[Tap]):
    """The taps of a run in virtual time, in the order in which they were added; all but the latest are on disk."""

    def __init__(self, folder: Path | None = None, *, most_in_memory: int = MOST_IN_MEMORY) -> None:
        self._taps = DiskBackedLog[Tap](_encoded, folder, most_in_memory=most_in_memory)

    def append(self, tap: Tap) -> None:
        self._taps.extend((tap,))

    def __len__(self) -> int:
        return len(self._taps)

    def __iter__(self) -> Iterator[Tap]:
        return chain(map(_decoded_tap, self._taps.stored()), self._taps.latest)


class StoredTaps(OnDisk[Tap]):
    """Taps that are on disk, encoded by `encoded_tap`; each iteration reads the file again."""

    def __init__(self, spool: Spool) -> None:
        self._spool = spool

    def __len__(self) -> int:
        return self._spool.count

    def __iter__(self) -> Iterator[Tap]:
        return map(_decoded_tap, self._spool.items())


def taps_of(spool: Spool) -> Collection[Tap]:
    """The taps of a run in real time, sorted by instant, on disk or, where that has no room, in memory."""
    ordered = in_order(spool, _INSTANT.unpack_from)
    if ordered is None:
        return sorted(map(_decoded_tap, spool.items()), key=lambda tap: tap[0])
    return StoredTaps(ordered)
