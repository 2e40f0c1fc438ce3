"""The messages of AODV (RFC 3561, 5) with node ids in place of IP addresses: little endian, without reserved bits.

The hop count is in the message and the TTL in the routing header (`hop_limit`), as with IP. A hello is a RREP about its
sender (6.9). Not carried: J and R (multicast), N (local repair), prefix size, and RREP-ACK (the MAC's acknowledgement
takes its place).
"""

import struct
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.rival_control_messages import BodyReader, check_node, unpack

RREQ: Final = 1
RREP: Final = 2
RERR: Final = 3

GRATUITOUS: Final = 1
DESTINATION_ONLY: Final = 2
UNKNOWN_SEQUENCE: Final = 4

_RREQ: Final = struct.Struct("<BBIHIHI")
_RREP: Final = struct.Struct("<BHIHI")
_COUNT: Final = struct.Struct("<B")
_ENTRY: Final = struct.Struct("<HI")


class RouteRequest(NamedTuple):
    """A route request, RREQ (5.1)."""

    flags: int
    hop_count: int
    rreq_id: int
    destination: int
    destination_seq: int
    originator: int
    originator_seq: int

    def encode(self) -> bytes:
        return _RREQ.pack(*self)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        request = cls(*unpack(_RREQ, body))
        check_node(request.destination)
        check_node(request.originator)
        if request.hop_count == 255:  # the next hop count would not fit its byte
            raise MalformedFrameError(f"RREQ of {request.hop_count} hops")
        return request


class RouteReply(NamedTuple):
    """RREP (5.2); `lifetime_ms` is how long the route is valid."""

    hop_count: int
    destination: int
    destination_seq: int
    originator: int
    lifetime_ms: int

    @property
    def is_hello(self) -> bool:
        return self.destination == self.originator

    def encode(self) -> bytes:
        return _RREP.pack(*self)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reply = cls(*unpack(_RREP, body))
        check_node(reply.destination)
        check_node(reply.originator)
        if reply.hop_count == 255:
            raise MalformedFrameError(f"RREP of {reply.hop_count} hops")
        return reply


class Unreachable(NamedTuple):
    """One destination of a RERR."""

    destination: int
    destination_seq: int


def most_unreachable(capacity: int) -> int:
    """The number of destinations that a RERR of this many bytes can name; the count has one byte."""
    return min(255, (capacity - _COUNT.size) // _ENTRY.size)


class RouteError(NamedTuple):
    """A route error, RERR (5.3)."""

    unreachable: tuple[Unreachable, ...]

    def encode(self) -> bytes:
        return _COUNT.pack(len(self.unreachable)) + b"".join(_ENTRY.pack(*entry) for entry in self.unreachable)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = BodyReader(body)
        (count,) = reader.take(_COUNT)
        entries = tuple(Unreachable(*fields) for fields in reader.rest(_ENTRY))
        if not count or count != len(entries):
            raise MalformedFrameError(f"RERR of {len(entries)} entries says {count}")
        for entry in entries:
            check_node(entry.destination)
        return cls(entries)
