"""FANET_BEACON: the part of a hello that states its sender's cluster, role, leader and distance from a head."""

from enum import IntEnum
from typing import NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire.checks import require_sender
from fanet_mw.wire.frame import ANY_NODE, BEACON, VERSION, Packed, decode_first, encode_inner


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
