"""The second phase of a packet, FLOOD: a broadcast that begins at one node and is passed on once by every relay.

What a node sends or hears it keeps where repair is asked for, so that a neighbor that lacks it gets it again. Whether
and when a node floods is for its protocol to decide; this is what it sends then.
"""

from collections.abc import Sequence
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet
from fanet_mw.routing.clustered.forwarding.repair import Repair
from fanet_mw.routing.clustered.tdma.contention import Contention
from fanet_mw.units import BROADCAST, S
from fanet_mw.wire import FLAG_FLOOD, Kind

_DATA: Final = int(Kind.DATA)
_UPLINK_NS: Final = 1 * S
"""A packet should be flooded at most one flooding period and this after it was generated; else it may be repaired."""


class Floods:
    """Floods as one node sends them."""

    def __init__(self, port: Port, repair: Repair | None, contention: Contention) -> None:
        self._port = port
        self._repair = repair
        self._contention = contention
        self._expect_ns = port.scenario.clusters.period_ns + _UPLINK_NS
        self._hop_limit = port.scenario.routing.hop_limit

    def keep(self, packet: Packet, *, flooded: bool, now_ns: int) -> None:
        """Keep a packet that is for all nodes, so that it can be repaired."""
        header = packet.header
        if self._repair and header.kind == _DATA and header.destination == BROADCAST:
            self._repair.hold(packet, flooded=flooded, expect_ns=now_ns + self._expect_ns, now_ns=now_ns)

    def control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """Make a control packet of this node for all nodes."""
        return self._port.announce(kind, inner, now_ns=now_ns, flags=FLAG_FLOOD, hop_limit=self._hop_limit)

    def contend_control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """Make a control packet of this node, and send it as soon as it may contend."""
        packet = self.control(kind, inner, now_ns=now_ns)
        self._port.transmit(packet.frame, BROADCAST, start_ns=self._contention.start_ns(now_ns=now_ns))
        return packet

    def contend_again(self, packet: Packet, *, now_ns: int) -> None:
        """Send what a neighbor lacks as soon as it may contend."""
        if self._goes_on(packet):  # else it needs no instant
            start_ns = self._contention.start_ns(now_ns=now_ns)
            self._port.transmit_together([packet], flags=FLAG_FLOOD, at_ns=(start_ns,))

    def begin(self, packets: Sequence[Packet], *, start_ns: int, again_ns: Sequence[int] = ()) -> None:
        """Begin the floods of several packets, in one frame, which is repeated at later instants."""
        for packet in packets:
            self.keep(packet, flooded=True, now_ns=start_ns)
        self._port.transmit_together(packets, flags=FLAG_FLOOD, at_ns=(start_ns, *again_ns))

    def answer(self, packets: Sequence[Packet], *, start_ns: int) -> None:
        """Send what neighbors lack, in one frame."""
        goes = [packet for packet in packets if self._goes_on(packet)]
        self._port.transmit_together(goes, flags=FLAG_FLOOD, at_ns=(start_ns,))

    def _goes_on(self, packet: Packet) -> bool:
        """True if a packet may go farther; one that may not counts as flooded here all the same."""
        if packet.header.origin == self._port.node or packet.header.hop_limit > 1:
            return True
        self._port.mark(packet, flags=FLAG_FLOOD)
        return False
