"""A routed packet inside a node, and the decision to relay one.

A packet that is heard with a hop limit of 1 has made its last hop: the node may deliver it, but passes it on to no one.
The part that would have passed it on drops it by the reason `hop_limit`.
"""

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


def is_used_up(header: Header) -> bool:
    """True if a packet that was heard with this header may not be passed on."""
    return header.hop_limit <= 1
