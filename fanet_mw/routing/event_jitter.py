"""Jitter of warnings (RFC 5148, 5.2): those who see the same event at the same instant must not tell of it at once.

All receivers of GPS give their fixes at the same instants, so that both UAVs of a conflict foresee it together. On an
idle channel frames that begin at one instant collide with certainty, and so do their repetitions.
"""

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.wire import PRIORITY_SAFETY


class EventJitter:
    """When the own packets of one node may start."""

    def __init__(self, port: Port) -> None:
        self._most_ns = port.scenario.routing.jitter_ns
        self._random = port.stream("event_jitter").random

    def start_ns(self, packet: Packet, due_ns: int) -> int:
        """The instant at which a packet that is due may start: a warning after U(0, `routing.jitter_ms`)."""
        if packet.header.priority != PRIORITY_SAFETY:
            return due_ns
        return due_ns + int(self._random() * self._most_ns)
