"""OLSR's messages (RFC 3626, 3.3, 6.1, 9.1), node ids in place of IP addresses: little endian, without reserved bits.

The routing header stands for the message header: `origin` is the originator, `seq` the message sequence number,
`hop_limit` the time to live, `hops` the hop count. One message is one packet; what does not fit a frame is divided into
several, as the RFC allows. A relayed TC keeps its bytes. Not carried: MID and HNA (one interface, no gateways).
"""

import math
import struct
from enum import IntEnum
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.control import Reader, check_node
from fanet_mw.routing.olsr.parameters import WILL_ALWAYS
from fanet_mw.units import S

HELLO: Final = 1
TC: Final = 2

_HELLO: Final = struct.Struct("<BBB")
_BLOCK: Final = struct.Struct("<BB")
_NODE: Final = struct.Struct("<H")
_TC: Final = struct.Struct("<BH")
_C_NS: Final = S // 16
"""Scaling factor C of validity times, 1/16 s (18.3)."""


class Link(IntEnum):
    """Low two bits of a link code (6.1.1)."""

    UNSPEC = 0
    ASYM = 1
    SYM = 2
    LOST = 3


class Neighborhood(IntEnum):
    """Next two bits of a link code (6.1.1)."""

    NOT = 0
    SYM = 1
    MPR = 2


def encode_time(duration_ns: int) -> int:
    """A validity time as mantissa (high half) and exponent: C (1 + a/16) 2^b, rounded up (18.3); at most 3968 s."""
    b = max(0, math.floor(math.log2(max(1.0, duration_ns / _C_NS))))
    a = math.ceil(16 * (duration_ns / (_C_NS * 2**b) - 1))
    if a > 15:
        a, b = 0, b + 1
    return max(0, a) << 4 | b if b <= 15 else 0xFF


def decode_time(code: int) -> int:
    """The duration [ns] of a validity time."""
    return _C_NS * (16 + (code >> 4)) * (1 << (code & 0xF)) // 16


class Heard(NamedTuple):
    """One neighbor in a hello: what the link to it is, and what it is to the sender."""

    link: Link
    neighborhood: Neighborhood
    node: int


class Hello(NamedTuple):
    """HELLO (6.1); times are validity codes."""

    vtime: int
    htime: int
    willingness: int
    heard: tuple[Heard, ...]

    def encode(self) -> bytes:
        """Neighbors of one link code stand together, as in the RFC."""
        body = _HELLO.pack(self.vtime, self.htime, self.willingness)
        for code in sorted({(h.link, h.neighborhood) for h in self.heard}):
            nodes = [h.node for h in self.heard if (h.link, h.neighborhood) == code]
            for at in range(0, len(nodes), 255):
                part = nodes[at : at + 255]
                body += _BLOCK.pack(code[0] | code[1] << 2, len(part))
                body += b"".join(_NODE.pack(node) for node in part)
        return body

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = Reader(body)
        vtime, htime, willingness = reader.take(_HELLO)
        if willingness > WILL_ALWAYS:
            raise MalformedFrameError(f"willingness {willingness}")
        heard = []
        while not reader.at_end:
            code, count = reader.take(_BLOCK)
            if code >> 2 > Neighborhood.MPR:
                raise MalformedFrameError(f"link code {code}")
            link, neighborhood = Link(code & 3), Neighborhood(code >> 2)
            if link is Link.SYM and neighborhood is Neighborhood.NOT:
                raise MalformedFrameError("a symmetric link to no neighbor (6.1.1)")
            heard += [Heard(link, neighborhood, check_node(reader.take(_NODE)[0])) for _ in range(count)]
        return cls(vtime, htime, willingness, tuple(heard))


HELLO_HEAD: Final = _HELLO.size + 6 * _BLOCK.size
"""The most that a hello needs beside its neighbors."""
TC_HEAD: Final = _TC.size
PER_NODE: Final = _NODE.size


class TopologyControl(NamedTuple):
    """TC (9.1): the originator is a last hop to each of these."""

    vtime: int
    ansn: int
    advertised: tuple[int, ...]

    def encode(self) -> bytes:
        return _TC.pack(self.vtime, self.ansn) + b"".join(_NODE.pack(node) for node in self.advertised)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = Reader(body)
        vtime, ansn = reader.take(_TC)
        return cls(vtime, ansn, tuple(check_node(node) for (node,) in reader.rest(_NODE)))
