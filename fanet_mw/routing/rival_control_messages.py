"""The control messages of the rival protocols on the air: FANET_ROUTING messages in a packet of kind ROUTING.

The high half of a message's type names the protocol, so none decodes messages of another. All pieces travel in one
radio frame, so `capacity` bounds its length.
"""

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import Any, Final

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire import OVERHEAD, ROUTING, encode_inner

_HEAD: Final = struct.Struct("<BBBB")
"""The beginning of a piece: its length, the type of the message, the number of the piece, the number of pieces."""
_PIECE: Final = 239
"""The most bytes of a body in one piece."""
_AT: Final = OVERHEAD - 2
"""The offset of the payload in a MAVLink 2 frame."""
_END: Final = bytes((wire.VERSION,))
"""The end of a piece. It is not 0, because MAVLink 2 cuts zeros off the end of a payload."""


class Family(IntEnum):
    """The protocol named by the high half of a type."""

    AODV = 1
    OLSR = 2
    DSDV = 3
    GEOGRAPHIC = 4
    ADDRESS = 5
    """Address resolution, which is no routing protocol but runs beside any of them (`address_resolution.py`)."""


def type_of(family: Family, number: int) -> int:
    """The type byte of message `number` (0..15) of a protocol."""
    return family << 4 | number


def capacity(max_frame_bytes: int) -> int:
    """The bytes of control that fit into one radio frame beside the headers."""
    room = max_frame_bytes - wire.HEADER_BYTES
    whole, rest = divmod(room, OVERHEAD + _HEAD.size + _PIECE + 1)
    return whole * _PIECE + max(0, rest - OVERHEAD - _HEAD.size - 1)


def encode(kind: int, body: bytes, *, node: int) -> bytes:
    """The inner frames of one control message."""
    pieces = [body[at : at + _PIECE] for at in range(0, len(body), _PIECE)] or [b""]
    return b"".join(
        encode_inner(ROUTING, _HEAD.pack(len(piece), kind, part, len(pieces)) + piece + _END, node=node, seq=part)
        for part, piece in enumerate(pieces)
    )


def decode(frame: bytes) -> tuple[int, bytes]:
    """(type, body) of the control message in a radio frame; raises MalformedFrameError."""
    kind, body, expected, parts = -1, b"", 0, 1
    for msgid, inner in wire.inner_frames(frame):
        if msgid != ROUTING.msgid or inner[1] < _HEAD.size + 1:
            raise MalformedFrameError(f"message {msgid} of {inner[1]} bytes in a control packet")
        length, its_kind, part, parts = _HEAD.unpack_from(inner, _AT)
        piece = inner[_AT + _HEAD.size : _AT + inner[1]]
        if part != expected or kind not in (-1, its_kind) or len(piece) != length + 1 or piece[-1:] != _END:
            raise MalformedFrameError(f"piece {part} of {parts}, type {its_kind}, {len(piece)} bytes")
        kind, body, expected = its_kind, body + piece[:-1], expected + 1
    if not expected or expected != parts:
        raise MalformedFrameError(f"{expected} of {parts} pieces")
    return kind, body


class BodyReader:
    """Reads a body from its beginning; reading beyond its end raises MalformedFrameError."""

    def __init__(self, body: bytes) -> None:
        self._body = body
        self._at = 0

    def take(self, layout: struct.Struct) -> tuple[Any, ...]:
        end = self._at + layout.size
        if end > len(self._body):
            raise MalformedFrameError(f"control of {len(self._body)} bytes ends before byte {end}")
        fields = layout.unpack_from(self._body, self._at)
        self._at = end
        return fields

    def rest(self, layout: struct.Struct) -> Iterator[tuple[Any, ...]]:
        """All entries up to the end of the body, which must be the end of an entry."""
        while self._at < len(self._body):
            yield self.take(layout)

    @property
    def at_end(self) -> bool:
        return self._at == len(self._body)


def unpack(layout: struct.Struct, body: bytes) -> tuple[Any, ...]:
    """The fields of a body, which must be exactly so long."""
    if len(body) != layout.size:
        raise MalformedFrameError(f"control of {len(body)} bytes must have {layout.size}")
    return layout.unpack(body)


def check_node(node: int) -> int:
    """A node id off the air; raises MalformedFrameError at 0 and at the broadcast id."""
    if not 0 < node < 0xFFFF:
        raise MalformedFrameError(f"node id {node} in control")
    return node
