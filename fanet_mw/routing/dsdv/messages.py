"""The update of DSDV: (destination, metric, sequence number) of some routes (incremental) or all of them (full dump).

Little endian, with node ids in place of addresses. A sender's entry for itself has metric 0. Metric 255 is infinite and
has an odd sequence number: a broken route, reported by a node other than the destination (Perkins and Bhagwat 1994,
section 3).
"""

import struct
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.routing.rival_control_messages import BodyReader, check_node

FULL: Final = 1
INCREMENTAL: Final = 2
INFINITE: Final = 255

_ENTRY: Final = struct.Struct("<HBI")
PER_ENTRY: Final = _ENTRY.size


class Advertised(NamedTuple):
    """One route of an update."""

    destination: int
    metric: int
    seq: int


class Update(NamedTuple):
    """An update, or the part of an update that fits a frame."""

    routes: tuple[Advertised, ...]

    def encode(self) -> bytes:
        return b"".join(_ENTRY.pack(*route) for route in self.routes)

    @classmethod
    def decode(cls, body: bytes) -> Self:
        routes = tuple(Advertised(*fields) for fields in BodyReader(body).rest(_ENTRY))
        for route in routes:
            check_node(route.destination)
            if (route.metric == INFINITE) != bool(route.seq & 1):
                raise MalformedFrameError(f"metric {route.metric} with sequence number {route.seq}")
        return cls(routes)
