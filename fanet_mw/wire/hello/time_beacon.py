"""FANET_TIME: the swarm time that a node states in its hellos."""

from typing import NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import US
from fanet_mw.wire.checks import require_sender
from fanet_mw.wire.frame import ANY_NODE, TIME, VERSION, Packed, decode_first, encode_inner, inner_frames


class TimeBeacon(NamedTuple):
    """FANET_TIME: the swarm time at which hello number `hello` of its sender ended; bounds in ns."""

    t_ns: int
    error_ns: int
    rate_ppb: int
    worst_ns: int
    hello: int
    round: int
    node: int
    reference: int
    worst_age_s: int
    hops: int

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(TIME, TIME.layout.pack(*self, VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """Decode a beacon; raises MalformedFrameError. Only a beacon of the reference itself has 0 hops."""
        *fields, version = decode_first(TIME, packed)
        beacon = cls(*fields)
        require_sender(version, beacon.node, t_us=beacon.t_ns // US)
        if not 0 < beacon.reference < ANY_NODE or (beacon.reference == beacon.node) != (beacon.hops == 0):
            raise MalformedFrameError(f"time of node {beacon.reference}, {beacon.hops} hops from {beacon.node}")
        return beacon

    @classmethod
    def in_hello(cls, hello: Packed) -> Self | None:
        """The beacon in a hello; None when it has none. Raises MalformedFrameError."""
        has_time = any(message == TIME.msgid for message, _ in inner_frames(hello))
        return cls.decode_frame(hello) if has_time else None
