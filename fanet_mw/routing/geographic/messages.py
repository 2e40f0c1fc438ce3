"""The messages of geographic routing: the sender's position, the locations of others, and queries for a location.

Little endian; positions are ENU metres as floats, instants swarm microseconds. A LOCATION is that of the packet's
origin, at the instant in its header.
"""

import math
import struct
from typing import Any, Final, NamedTuple, Self

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.rival_control_messages import BodyReader, check_node, unpack
from fanet_mw.units import Enu

BEACON: Final = 1
LOCATION: Final = 2
QUERY: Final = 3

_PLACE: Final = struct.Struct("<fff")
_FIX: Final = struct.Struct("<HfffQ")
_WANTED: Final = struct.Struct("<H")
MOST_FIXES: Final = 8
"""The most locations of other nodes in one beacon."""


def _position(fields: tuple[Any, ...]) -> Enu:
    if not all(math.isfinite(value) for value in fields):
        raise MalformedFrameError(f"position {fields}")
    return Enu(*fields)


class Fix(NamedTuple):
    """The position of a node, and the instant at which it was there [swarm us]."""

    node: int
    position: Enu
    t_us: int


class PositionBeacon(NamedTuple):
    """BEACON, one hop: the sender's position, and the locations of the destinations that it has used last."""

    position: Enu
    fixes: tuple[Fix, ...]

    def encode(self) -> bytes:
        return _PLACE.pack(*self.position) + b"".join(_FIX.pack(f.node, *f.position, f.t_us) for f in self.fixes)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        reader = BodyReader(body)
        position = _position(reader.take(_PLACE))
        fixes = tuple(
            Fix(check_node(node), _position((east, north, up)), t_us)
            for node, east, north, up, t_us in reader.rest(_FIX)
        )
        if len(fixes) > MOST_FIXES or any(fix.t_us > wire.LATEST_US for fix in fixes):
            raise MalformedFrameError(f"beacon of {len(fixes)} locations")
        return cls(position, fixes)


class Location(NamedTuple):
    """LOCATION, flooded: the position of its origin."""

    position: Enu

    def encode(self) -> bytes:
        return _PLACE.pack(*self.position)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        return cls(_position(unpack(_PLACE, body)))


class Query(NamedTuple):
    """QUERY, flooded: a question for the location of this node."""

    wanted: int

    def encode(self) -> bytes:
        return _WANTED.pack(self.wanted)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        return cls(check_node(*unpack(_WANTED, body)))
