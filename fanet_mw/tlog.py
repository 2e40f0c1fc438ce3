"""The telemetry log of MAVProxy, QGroundControl and Mission Planner: 8-byte big-endian microseconds, then one frame."""

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import US

_STAMP: Final = struct.Struct(">Q")
_OVERHEAD: Final = 12


def frames(data: bytes) -> Iterator[bytes]:
    """Each MAVLink 2 frame of a run of frames; raises MalformedFrameError at a broken one."""
    at = 0
    while at < len(data):
        if len(data) - at < _OVERHEAD or data[at] != 0xFD:
            raise MalformedFrameError(f"no MAVLink 2 frame at byte {at}")
        end = at + _OVERHEAD + data[at + 1] + (13 if data[at + 2] & 1 else 0)
        if end > len(data):
            raise MalformedFrameError(f"frame at byte {at} ends beyond the end")
        yield data[at:end]
        at = end


def write(path: Path, taps: Iterable[tuple[int, bytes]], *, epoch_us: int = 0) -> None:
    """Write (instant ns, frames) pairs; `epoch_us` is the unix time of swarm instant 0."""
    with path.open("wb") as file:
        for t_ns, data in taps:
            stamp = _STAMP.pack(epoch_us + t_ns // US)
            for frame in frames(data):
                file.write(stamp + frame)


def read(path: Path) -> Iterator[tuple[int, bytes]]:
    """(microseconds, frame) pairs."""
    data = path.read_bytes()
    at = 0
    while at < len(data):
        if len(data) - at < _STAMP.size + _OVERHEAD:
            raise MalformedFrameError(f"{path}: cut off at byte {at}")
        (t_us,) = _STAMP.unpack_from(data, at)
        at += _STAMP.size
        frame = next(frames(data[at : at + _OVERHEAD + data[at + 1] + (13 if data[at + 2] & 1 else 0)]))
        yield t_us, frame
        at += len(frame)
