"""A routed packet inside a node, and the decision to relay one."""

from typing import NamedTuple

from fanet_mw.units import NodeId
from fanet_mw.wire import Header


class Packet(NamedTuple):
    """A routed packet: its decoded header, and its bytes."""

    header: Header
    frame: bytes

    @property
    def origin(self) -> NodeId:
        return NodeId(self.header.origin)


Relay = tuple[Packet, int]
"""A flooded packet of another node that is to be relayed, and the instant from which it may be transmitted."""
