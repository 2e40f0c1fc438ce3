"""What a hello states of its sender: cluster, role, leader and distance from a head (FANET_BEACON), and when an earlier
hello ended, in swarm time (FANET_TIME).
"""

from enum import IntEnum
from typing import NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import US
from fanet_mw.wire.checks import require_sender
from fanet_mw.wire.frame import ANY_NODE, BEACON, TIME, VERSION, Packed, decode_first, encode_inner, inner_frames


class Role(IntEnum):
    """A node's role in its cluster."""

    ISOLATED = 0
    MEMBER = 1
    HEAD = 2


class Beacon(NamedTuple):
    """FANET_BEACON: the routing part of a hello."""

    node: int
    head: int
    head_seq: int
    cluster: int
    epoch: int
    slot: int
    role: int
    hops_to_head: int
    term: int = 0
    leader: int = 0
    """The leader that the sender follows; 0 if it follows none. `term` states since when that node leads."""

    def encode_frame(self, node: int) -> bytes:
        return encode_inner(
            BEACON, BEACON.layout.pack(self.term, *self[:6], self.leader, *self[6:8], VERSION), node=node
        )

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        term, of, head, seq, cluster, epoch, slot, leader, role, hops, version = decode_first(BEACON, packed)
        beacon = cls(of, head, seq, cluster, epoch, slot, role, hops, term, leader)
        require_sender(version, beacon.node)
        if beacon.role > Role.HEAD or ANY_NODE in (beacon.head, beacon.leader):
            raise MalformedFrameError(f"beacon of role {beacon.role}, head {beacon.head}")
        return beacon


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
