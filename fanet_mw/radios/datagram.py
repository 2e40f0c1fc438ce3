"""The datagram of the UDP radio: a 12-byte header names sender and receiver, so that the frame can be acknowledged.

"FN" | version | kind (frame, ack) | source | destination | sequence number | frame

The sequence number grows by one with each request, from a random number at the start of the radio.
"""

import struct
from enum import IntEnum
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import BROADCAST, MAX_NODES, NodeId

_LAYOUT: Final = struct.Struct("!2sBBHHI")
_MAGIC: Final = b"FN"
_VERSION: Final = 1
SEQ_MASK: Final = 0xFFFF_FFFF


class DatagramKind(IntEnum):
    """The kind of a datagram."""

    FRAME = 0
    ACK = 1


class Datagram(NamedTuple):
    """The payload of one UDP packet."""

    kind: DatagramKind
    src: NodeId
    dst: NodeId
    seq: int
    frame: bytes = b""

    def encode(self) -> bytes:
        return _LAYOUT.pack(_MAGIC, _VERSION, self.kind, self.src, self.dst, self.seq & SEQ_MASK) + self.frame

    @classmethod
    def decode(cls, data: bytes) -> Self:
        """Decode a UDP payload; raises MalformedFrameError."""
        if len(data) < _LAYOUT.size:
            raise MalformedFrameError(f"datagram of {len(data)} bytes")
        magic, version, kind, src, dst, seq = _LAYOUT.unpack_from(data)
        if magic != _MAGIC or version != _VERSION or kind > DatagramKind.ACK:
            raise MalformedFrameError(f"datagram of version {version}, kind {kind}")
        if not 1 <= src <= MAX_NODES or not (1 <= dst <= MAX_NODES or dst == BROADCAST):
            raise MalformedFrameError(f"datagram from {src} to {dst}")
        frame = data[_LAYOUT.size :]
        if bool(frame) == (kind == DatagramKind.ACK):
            raise MalformedFrameError(f"datagram of kind {kind} with {len(frame)} bytes")
        return cls(DatagramKind(kind), NodeId(src), NodeId(dst), seq, frame)
