"""The telemetry of a run, which MAVLink tools read: pairs (instant ns, MAVLink bytes), in memory or on disk."""

import struct
from collections.abc import Collection, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Final

from sim.run.collecting.overflow import MOST_IN_MEMORY, Overflow
from sim.run.collecting.spool import Spool, in_order

_INSTANT: Final = struct.Struct("<q")
Tap = tuple[int, bytes]


def encoded_tap(t_ns: int, frames: bytes) -> bytes:
    return _INSTANT.pack(t_ns) + frames


def _decoded_tap(item: bytes) -> Tap:
    return _INSTANT.unpack_from(item)[0], item[_INSTANT.size :]


def _encoded(taps: Sequence[Tap]) -> list[bytes]:
    return [encoded_tap(*tap) for tap in taps]


class TapLog(Collection[Tap]):
    """Telemetry in the order of its making: the latest in memory, what was before that on disk."""

    def __init__(self, folder: Path | None = None, *, most_in_memory: int = MOST_IN_MEMORY) -> None:
        self._taps = Overflow[Tap](_encoded, folder, most_in_memory)

    def append(self, tap: Tap) -> None:
        self._taps.extend((tap,))

    def __len__(self) -> int:
        return len(self._taps)

    def __iter__(self) -> Iterator[Tap]:
        return chain(map(_decoded_tap, self._taps.stored()), self._taps.latest)

    def __contains__(self, tap: object) -> bool:
        return any(one == tap for one in self)


class StoredTaps(Collection[Tap]):
    """The telemetry in a spool of `encoded_tap`; each iteration reads and decodes it anew."""

    def __init__(self, spool: Spool) -> None:
        self._spool = spool

    def __len__(self) -> int:
        return self._spool.count

    def __iter__(self) -> Iterator[Tap]:
        return map(_decoded_tap, self._spool.items())

    def __contains__(self, tap: object) -> bool:
        return any(one == tap for one in self)


def taps_of(spool: Spool) -> Collection[Tap]:
    """The telemetry in a spool of `encoded_tap`, by instant; in memory only if the disk has no room to sort it."""
    ordered = in_order(spool, _INSTANT.unpack_from)
    if ordered is None:
        return sorted(map(_decoded_tap, spool.items()), key=lambda tap: tap[0])
    return StoredTaps(ordered)
