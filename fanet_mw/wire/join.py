"""FANET_JOIN: a node asks the leader for a place in a cluster; a join may also report that another node is silent."""

from typing import NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, STILL, Enu
from fanet_mw.wire.checks import place_within, require_sender
from fanet_mw.wire.frame import ANY_NODE, JOIN, VERSION, Packed, decode_first, encode_inner


class Join(NamedTuple):
    """FANET_JOIN: a node asks the leader for a place in the next assignment."""

    node: int
    position: Enu
    velocity: Enu = STILL
    instead_of: int = 0
    """The silent node that the sender reports, or stands in for if it is its head; 0: none; its own id: it objects."""

    def encode_frame(self, node: int) -> bytes:
        payload = JOIN.layout.pack(*self.position, *self.velocity, self.node, self.instead_of, VERSION)
        return encode_inner(JOIN, payload, node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        *numbers, node, instead_of, version = decode_first(JOIN, packed)
        require_sender(version, node)
        if instead_of == ANY_NODE:
            raise MalformedFrameError(f"join of {node} instead of {instead_of}")
        position, velocity = place_within(*numbers[:3], most=FARTHEST_M), place_within(*numbers[3:], most=FASTEST_M_S)
        return cls(node, position, velocity, instead_of)
