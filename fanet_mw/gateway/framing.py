"""Finds MAVLink frames in the bytes of a ground station; whatever is no whole and known frame is skipped and counted.

A frame of MAVLink 1 is taken too, and goes on as one of MAVLink 2. Every CRC is checked here, so that nothing reaches a
UAV that its ground station did not send.
"""

import re
import struct
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from fastcrc.crc16 import mcrf4xx

from fanet_mw.mavlink import common
from fanet_mw.wire import MAGIC, OVERHEAD

_MAGIC_1: Final = 0xFE
_OVERHEAD_1: Final = 8
_SIGNED: Final = 1
SIGNATURE: Final = 13
_LONGEST: Final = OVERHEAD + 255 + SIGNATURE


class Layout(NamedTuple):
    """What a gateway must know of one kind of message."""

    crc_extra: int
    target_at: int | None
    """Where the payload names the system for which it is; None: for all."""


@lru_cache(maxsize=512)
def layout(message_id: int) -> Layout | None:
    """None for a message that neither dialect has."""
    known = common.mavlink_map.get(message_id)
    if known is None:
        return None
    at, target_at = 0, None
    fields = re.findall(r"\d*[a-zA-Z]", known.unpacker.format)  # one for each field, in the order of the payload
    for name, field in zip(known.ordered_fieldnames, fields, strict=True):
        if name == "target_system":
            target_at = at
        at += struct.calcsize(f"<{field}")
    return Layout(known.crc_extra, target_at)


class Frame(NamedTuple):
    """One frame of MAVLink 2, with what a gateway reads of it."""

    data: bytes
    message_id: int
    system: int
    component: int
    target: int
    """The system for which it is; 0: for all."""

    @property
    def signed(self) -> bool:
        return bool(self.data[2] & _SIGNED)


def frame_of(data: bytes, shape: Layout) -> Frame:
    """Read a whole frame of MAVLink 2."""
    at = shape.target_at
    target = data[10 + at] if at is not None and at < data[1] else 0  # zeros at the end are left out
    return Frame(data, int.from_bytes(data[7:10], "little"), data[5], data[6], target)


def with_crc(head_and_payload: bytes, crc_extra: int) -> bytes:
    return head_and_payload + struct.pack("<H", mcrf4xx(head_and_payload[1:] + bytes((crc_extra,))))


class Framing:
    """The bytes of one ground station; a payload may be longer than known here, as newer dialects have more fields."""

    def __init__(self, counts: Counter[str]) -> None:
        self._rest = b""
        self._counts = counts

    def frames(self, data: bytes) -> Iterator[Frame]:
        """The frames that are whole now; the beginning of another one waits for its end."""
        data = self._rest + data
        at, end = 0, len(data)
        while at < end:
            magic = data[at]
            if magic not in (MAGIC, _MAGIC_1):
                later = [found for found in (data.find(MAGIC, at), data.find(_MAGIC_1, at)) if found >= 0]
                self._counts["stray_bytes"] += min(later, default=end) - at
                at = min(later, default=end)
                continue
            if end - at < 3:
                break
            signature = SIGNATURE if magic == MAGIC and data[at + 2] & _SIGNED else 0
            size = data[at + 1] + (OVERHEAD if magic == MAGIC else _OVERHEAD_1) + signature
            if magic == MAGIC and data[at + 2] & ~_SIGNED:
                self._counts["incompatible"] += 1
                at += 1
                continue
            if end - at < size:
                break
            frame = self._checked(data[at : at + size], magic, signature)
            if frame is None:
                at += 1  # what looked like a frame may hide the beginning of one
            else:
                yield frame
                at += size
        self._rest = data[at:][-_LONGEST:]

    def datagram(self, data: bytes) -> Iterator[Frame]:
        """The frames of a datagram, which ends with a whole one."""
        yield from self.frames(data)
        if self._rest:
            self._counts["stray_bytes"] += len(self._rest)
            self._rest = b""

    def _checked(self, data: bytes, magic: int, signature: int) -> Frame | None:
        message_id = data[5] if magic == _MAGIC_1 else int.from_bytes(data[7:10], "little")
        shape = layout(message_id)
        if shape is None:
            self._counts["unknown_message"] += 1
            return None
        body = data[: len(data) - signature]
        (crc,) = struct.unpack_from("<H", body, len(body) - 2)
        if mcrf4xx(body[1:-2] + bytes((shape.crc_extra,))) != crc:
            self._counts["bad_crc"] += 1
            return None
        if magic == _MAGIC_1:
            head = bytes((MAGIC, data[1], 0, 0, data[2], data[3], data[4], data[5], 0, 0))
            data = with_crc(head + data[6:-2], shape.crc_extra)
        return frame_of(data, shape)
