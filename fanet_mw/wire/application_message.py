"""FANET_MESSAGE, FANET_TARGETS and FANET_RECEIPT: messages of applications, in pieces that fit a packet.

packet of a piece      [FANET_TARGETS ...]  FANET_MESSAGE  FANET_CHUNK ...          bytes on a numbered port
                       [FANET_TARGETS ...]  FANET_MESSAGE  MAVLink messages         port 0, always one piece
packet of receipts     FANET_RECEIPT ...
"""

import struct
from collections.abc import Collection, Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire.frame import (
    ANY_NODE,
    CHUNK,
    CHUNK_DATA,
    CHUNK_HEAD,
    LATEST_US,
    MESSAGE,
    OVERHEAD,
    RECEIPT,
    TARGETS,
    VERSION,
    encode_inner,
    inner_frames,
)

MOST_PIECES: Final = 64
"""The greatest number of pieces of a message, which is the number of bits in a receipt."""
MAVLINK_PORT: Final = 0
MOST_LIFETIME_MS: Final = 3_600_000
HEAD_BYTES: Final = OVERHEAD + MESSAGE.layout.size
RECEIPT_BYTES: Final = OVERHEAD + RECEIPT.layout.size
_TARGETS_BYTES: Final = OVERHEAD + TARGETS.layout.size
_TARGETS_EACH: Final = 32
_CHUNK_OVERHEAD: Final = OVERHEAD + CHUNK_HEAD.size
_PAYLOAD_AT: Final = 10
"""The offset of the payload in a MAVLink 2 frame."""


class Head(NamedTuple):
    """FANET_MESSAGE: identifies a piece of a message, and the message before it in its flow (0: none)."""

    born_us: int
    number: int
    previous: int
    size: int
    lifetime_ms: int
    port: int
    flow: int
    stride: int
    piece: int
    pieces: int
    confirm: int

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(MESSAGE, MESSAGE.layout.pack(*self, VERSION), node=node)

    @classmethod
    def of(cls, inner: bytes) -> Self:
        """The fields of one inner frame that is this message; raises MalformedFrameError."""
        *fields, version = _fields(MESSAGE.layout, inner)
        head = cls(*fields)
        if (
            version != VERSION
            or head.born_us > LATEST_US
            or not head.piece < head.pieces <= MOST_PIECES
            or not 0 < head.lifetime_ms <= MOST_LIFETIME_MS
            or head.confirm > 1
            or not head.previous < head.number
            or (head.port == MAVLINK_PORT and head.pieces > 1)
            or not (head.pieces - 1) * head.stride <= head.size <= head.pieces * head.stride
            or (head.pieces > 1 and head.size <= (head.pieces - 1) * head.stride)
        ):
            raise MalformedFrameError(f"head {head}, version {version}")
        return head

    @property
    def length(self) -> int:
        """The number of bytes of data in this piece."""
        return self.stride if self.piece < self.pieces - 1 else self.size - self.piece * self.stride


class Receipt(NamedTuple):
    """FANET_RECEIPT: the pieces of a message that a target has received, and the outcome."""

    held: int
    number: int
    outcome: int

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(RECEIPT, RECEIPT.layout.pack(*self, VERSION), node=node)


MISSING: Final = 0
DELIVERED: Final = 1
NO_LISTENER: Final = 2
GIVEN_UP: Final = 3


class Piece(NamedTuple):
    """A piece of a message, as one packet brings it."""

    head: Head
    targets: frozenset[int] | None
    """The nodes for which it is meant; None if these are the packet's destination."""
    data: bytes


def targets_bytes(count: int) -> int:
    """The length of the frames that name this number of targets."""
    return -(-count // _TARGETS_EACH) * _TARGETS_BYTES


def room_for_data(size: int) -> int:
    """The number of bytes of data that fit into chunks of `size` bytes together."""
    whole, rest = divmod(size, _CHUNK_OVERHEAD + CHUNK_DATA)
    return max(0, whole * CHUNK_DATA + max(0, rest - _CHUNK_OVERHEAD))


def encode_piece(head: Head, data: bytes, *, node: int, targets: Collection[int] = ()) -> bytes:
    """The inner frames of a packet; on port 0, `data` are MAVLink frames."""
    parts = [_targets(chunk, node) for chunk in _split(sorted(targets))]
    parts.append(head.encode_frame(node))
    parts += [data] if head.port == MAVLINK_PORT else _chunks(data, node)
    return b"".join(parts)


def decode_piece(frame: bytes) -> Piece:
    """The piece in a packet, routing header first; raises MalformedFrameError."""
    found: Head | None = None
    targets: list[int] = []
    data: list[bytes] = []
    length = 0
    for msgid, inner in inner_frames(frame):
        if found is None and msgid == TARGETS.msgid:
            targets += _targets_of(inner)
        elif found is None and msgid == MESSAGE.msgid:
            found = Head.of(inner)
        elif found is None:
            raise MalformedFrameError(f"message {msgid} before the head")
        else:
            data.append(inner if found.port == MAVLINK_PORT else _chunk_of(msgid, inner))
            length += len(data[-1])
    if found is None or length != found.length:
        raise MalformedFrameError(f"{length} bytes after {found}")
    return Piece(found, frozenset(targets) or None, b"".join(data))


def encode_receipts(receipts: Sequence[Receipt], *, node: int) -> bytes:
    return b"".join(receipt.encode_frame(node) for receipt in receipts)


def decode_receipts(frame: bytes) -> list[Receipt]:
    """The receipts in a packet, routing header first; raises MalformedFrameError."""
    found = []
    for msgid, inner in inner_frames(frame):
        if msgid != RECEIPT.msgid:
            raise MalformedFrameError(f"message {msgid} among receipts")
        *fields, version = _fields(RECEIPT.layout, inner)
        receipt = Receipt(*fields)
        if version != VERSION or receipt.outcome > GIVEN_UP:
            raise MalformedFrameError(f"receipt {receipt}, version {version}")
        found.append(receipt)
    return found


def _fields(layout: struct.Struct, inner: bytes) -> tuple[int, ...]:
    if inner[1] != layout.size:
        raise MalformedFrameError(f"payload of {inner[1]} bytes, not {layout.size}")
    return layout.unpack_from(inner, _PAYLOAD_AT)


def _split(nodes: Sequence[int]) -> list[Sequence[int]]:
    return [nodes[at : at + _TARGETS_EACH] for at in range(0, len(nodes), _TARGETS_EACH)]


def _targets(nodes: Sequence[int], node: int) -> bytes:
    payload = TARGETS.layout.pack(*nodes, *[0] * (_TARGETS_EACH - len(nodes)), len(nodes), VERSION)
    return encode_inner(TARGETS, payload, node=node)


def _targets_of(inner: bytes) -> tuple[int, ...]:
    *nodes, count, version = _fields(TARGETS.layout, inner)
    if version != VERSION or not 0 < count <= _TARGETS_EACH or not all(0 < n < ANY_NODE for n in nodes[:count]):
        raise MalformedFrameError(f"{count} targets, version {version}")
    return tuple(nodes[:count])


def _chunks(data: bytes, node: int) -> list[bytes]:
    parts = [data[at : at + CHUNK_DATA] for at in range(0, len(data), CHUNK_DATA)]
    return [
        encode_inner(CHUNK, CHUNK_HEAD.pack(len(part), index, len(parts)) + part, node=node, seq=index)
        for index, part in enumerate(parts)
    ]


def _chunk_of(msgid: int, inner: bytes) -> bytes:
    """The data of a chunk; trailing zeros may have been dropped on the way, as MAVLink 2 does."""
    if msgid != CHUNK.msgid or inner[1] < CHUNK_HEAD.size:
        raise MalformedFrameError(f"message {msgid} of {inner[1]} bytes in place of a chunk")
    length, _, _ = CHUNK_HEAD.unpack_from(inner, _PAYLOAD_AT)
    begin = _PAYLOAD_AT + CHUNK_HEAD.size
    if length > CHUNK_DATA or inner[1] - CHUNK_HEAD.size > length:
        raise MalformedFrameError(f"chunk of {length} bytes with {inner[1]}")
    return bytes(inner[begin : _PAYLOAD_AT + inner[1]]).ljust(length, b"\0")
