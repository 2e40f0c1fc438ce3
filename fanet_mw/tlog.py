"""The telemetry log of MAVProxy, QGroundControl and Mission Planner: 8-byte big-endian microseconds, then one frame.

A log holds only MAVLink 2 frames, as a swarm sends them. By the format's custom instants are unix time. The taps of
many nodes are in one file, so the frames of each (system, component) are numbered anew in its order, because readers
take gaps for losses.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import US
from fanet_mw.whole_file import Written, write_items
from fanet_mw.wire import frames, renumbered

_STAMP: Final = struct.Struct(">Q")
_LONGEST: Final = _STAMP.size + 10 + 255 + 2 + 13


def append(file: BinaryIO, data: bytes, *, t_us: int) -> int:
    """Append each frame of a run under one stamp; returns how many. It raises before it writes any of a broken run."""
    stamp = _STAMP.pack(t_us)
    whole = list(frames(data))
    for frame in whole:
        file.write(stamp + frame)
    return len(whole)


def write(path: Path, taps: Iterable[tuple[int, bytes]], *, epoch_us: int = 0, held: Written | None = None) -> None:
    """Write (instant ns, frames) pairs; `epoch_us`: unix time of 0. Raises OSError after the last whole frame."""
    write_items(path, _stamped(taps, epoch_us), held)


def _stamped(taps: Iterable[tuple[int, bytes]], epoch_us: int) -> Iterator[bytes]:
    numbers: Counter[bytes] = Counter()
    for t_ns, data in taps:
        stamp = _STAMP.pack(epoch_us + t_ns // US)
        for frame in frames(data):
            sender = frame[5:7]  # system, component
            yield stamp + renumbered(frame, numbers[sender] % 256)
            numbers[sender] += 1


def read(path: Path) -> Iterator[tuple[int, bytes]]:
    """(microseconds, frame) pairs, one at a time; raises MalformedFrameError where the file is cut off or broken."""
    with path.open("rb") as file:
        yield from read_from(file, source=str(path))


def read_from(file: BinaryIO, *, source: str) -> Iterator[tuple[int, bytes]]:
    """The same of an open file, which messages call `source`."""
    at = 0
    rest = b""
    while rest := rest + file.read(_LONGEST - len(rest)):
        if len(rest) <= _STAMP.size:
            raise MalformedFrameError(f"{source}: cut off at byte {at}")
        (t_us,) = _STAMP.unpack_from(rest)
        try:
            frame = next(frames(rest, start=_STAMP.size))
        except MalformedFrameError as error:
            raise MalformedFrameError(f"{source}: record at byte {at}: {error}") from error
        yield t_us, frame
        at += _STAMP.size + len(frame)
        rest = rest[_STAMP.size + len(frame) :]
