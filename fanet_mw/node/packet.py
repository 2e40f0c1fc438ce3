"""A routed packet as a node holds it, and the decision to pass one on."""

from typing import NamedTuple

from fanet_mw.units import NodeId
from fanet_mw.wire import Header


class Packet(NamedTuple):
    """A routed packet: its header, decoded, and its bytes."""

    header: Header
    frame: bytes

    @property
    def origin(self) -> NodeId:
        return NodeId(self.header.origin)


Relay = tuple[Packet, int]
"""A flooded packet of another node that is to be passed on, and the instant from which it may go."""
