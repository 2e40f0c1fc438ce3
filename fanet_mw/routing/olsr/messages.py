"""The messages of OLSR (RFC 3626, 3.3, 6.1, 9.1), node ids in place of IP addresses: little endian, no reserved bits.

The routing header serves as message header: `origin` is the originator, `seq` the message sequence number, `hop_limit`
the time to live, `hops` the hop count. One message is one packet; what does not fit a frame is divided into several
messages, as the RFC allows. A relayed TC keeps its bytes. Not carried: MID and HNA (one interface, no gateways).
"""

import math
import struct
from enum import IntEnum
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.olsr.parameters import WILL_ALWAYS
from fanet_mw.routing.rival_control_messages import BodyReader, check_node
from fanet_mw.units import S

HELLO: Final = 1
TC: Final = 2

_HELLO: Final = struct.Struct("<BBB")
_BLOCK: Final = struct.Struct("<BB")
_NODE: Final = struct.Struct("<H")
_TC: Final = struct.Struct("<BH")
_C_NS: Final = S // 16
"""The scaling factor C of validity times, 1/16 s (18.3)."""


class LinkType(IntEnum):
    """The link type, in the low two bits of a link code (6.1.1)."""

    UNSPEC = 0
    ASYM = 1
    SYM = 2
    LOST = 3


class NeighborType(IntEnum):
    """The neighbor type, in the next two bits of a link code (6.1.1)."""

    NOT = 0
    SYM = 1
    MPR = 2


def encode_time(duration_ns: int) -> int:
    """The code of a validity time, mantissa a (high half) and exponent b: C (1 + a/16) 2^b (18.3), at most 3968 s."""
    b = max(0, math.floor(math.log2(max(1.0, duration_ns / _C_NS))))
    a = math.ceil(16 * (duration_ns / (_C_NS * 2**b) - 1))
    if a > 15:
        a, b = 0, b + 1
    return max(0, a) << 4 | b if b <= 15 else 0xFF


def decode_time(code: int) -> int:
    """The duration [ns] of a validity time."""
    return _C_NS * (16 + (code >> 4)) * (1 << (code & 0xF)) // 16


class HelloNeighbor(NamedTuple):
    """One neighbor in a hello: the type of the link to it, and its type as a neighbor."""

    link_type: LinkType
    neighbor_type: NeighborType
    node: int


class Hello(NamedTuple):
    """HELLO (6.1); its times are codes of validity times."""

    vtime: int
    htime: int
    willingness: int
    neighbors: tuple[HelloNeighbor, ...]

    def encode(self) -> bytes:
        """The bytes of a hello; neighbors with the same link code stand together, as in the RFC."""
        body = _HELLO.pack(self.vtime, self.htime, self.willingness)
        for code in sorted({(h.link_type, h.neighbor_type) for h in self.neighbors}):
            nodes = [h.node for h in self.neighbors if (h.link_type, h.neighbor_type) == code]
            for at in range(0, len(nodes), 255):
                part = nodes[at : at + 255]
                body += _BLOCK.pack(code[0] | code[1] << 2, len(part))
                body += b"".join(_NODE.pack(node) for node in part)
        return body

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = BodyReader(body)
        vtime, htime, willingness = reader.take(_HELLO)
        if willingness > WILL_ALWAYS:
            raise MalformedFrameError(f"willingness {willingness}")
        neighbors = []
        while not reader.at_end:
            code, count = reader.take(_BLOCK)
            if code >> 2 > NeighborType.MPR:
                raise MalformedFrameError(f"link code {code}")
            link_type, neighbor_type = LinkType(code & 3), NeighborType(code >> 2)
            if link_type is LinkType.SYM and neighbor_type is NeighborType.NOT:
                raise MalformedFrameError("a symmetric link to no neighbor (6.1.1)")
            neighbors += [
                HelloNeighbor(link_type, neighbor_type, check_node(reader.take(_NODE)[0])) for _ in range(count)
            ]
        return cls(vtime, htime, willingness, tuple(neighbors))


HELLO_HEAD: Final = _HELLO.size + 6 * _BLOCK.size
"""The most bytes that a hello needs beside its neighbors."""
TC_HEAD: Final = _TC.size
PER_NODE: Final = _NODE.size


class TopologyControl(NamedTuple):
    """TC (9.1): the originator is the last hop to each of these nodes."""

    vtime: int
    ansn: int
    advertised: tuple[int, ...]

    def encode(self) -> bytes:
        return _TC.pack(self.vtime, self.ansn) + b"".join(_NODE.pack(node) for node in self.advertised)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = BodyReader(body)
        vtime, ansn = reader.take(_TC)
        return cls(vtime, ansn, tuple(check_node(node) for (node,) in reader.rest(_NODE)))
