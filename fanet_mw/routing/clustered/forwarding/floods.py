"""The second phase of a packet, FLOOD: a broadcast that begins at one node and is passed on once by every relay.

What a node sends or hears it keeps where repair is asked for, so that a neighbor that lacks it gets it again. Whether
and when a node floods is for its protocol to decide; this is what it sends then.
"""

from collections.abc import Sequence
from typing import Final

from fanet_mw.node import duplicates
from fanet_mw.node.contract import Port
from fanet_mw.node.queue import Packet
from fanet_mw.routing.clustered.forwarding.repair import Repair
from fanet_mw.routing.clustered.tdma.contention import Contention
from fanet_mw.units import BROADCAST, S
from fanet_mw.wire import FLAG_FLOOD, Kind

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
        """Be able to repair this packet, if it is for everyone."""
        if self._repair and packet.header.kind == Kind.DATA and packet.header.destination == BROADCAST:
            self._repair.hold(packet, flooded=flooded, expect_ns=now_ns + self._expect_ns, now_ns=now_ns)

    def control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """A control packet of our own, for everyone."""
        return self._port.announce(kind, inner, now_ns=now_ns, flags=FLAG_FLOOD, hop_limit=self._hop_limit)

    def contend_control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """A control packet of our own, sent as soon as it may contend."""
        packet = self.control(kind, inner, now_ns=now_ns)
        self._port.transmit(packet.frame, BROADCAST, start_ns=self._contention.start_ns(now_ns=now_ns))
        return packet

    def contend_again(self, packet: Packet, *, now_ns: int) -> None:
        """Send what a neighbor lacks as soon as it may contend."""
        frame = self.again(packet)
        if frame is not None:
            self._port.transmit(frame, BROADCAST, start_ns=self._contention.start_ns(now_ns=now_ns))

    def begin(self, packets: Sequence[Packet], *, start_ns: int, again_ns: Sequence[int] = ()) -> None:
        """The floods of several packets begin here, in one frame, which is repeated at later instants."""
        for packet in packets:
            self._port.mark(packet, duplicates.FLOODED)
            self.keep(packet, flooded=True, now_ns=start_ns)
        for at_ns in (start_ns, *again_ns):
            self._port.gather()
            for packet in packets:
                self._port.transmit(self._frame(packet), BROADCAST, start_ns=at_ns)
            self._port.send_gathered()

    def relay(self, packet: Packet, *, start_ns: int) -> None:
        """Pass on a flood that began elsewhere."""
        self._port.transmit(self._port.forwarded(packet, flags=FLAG_FLOOD), BROADCAST, start_ns=start_ns)

    def answer(self, packets: Sequence[Packet], *, start_ns: int) -> None:
        """Send what neighbors lack, in one frame."""
        self._port.gather()
        for packet in packets:
            frame = self.again(packet)
            if frame is not None:
                self._port.transmit(frame, BROADCAST, start_ns=start_ns)
        self._port.send_gathered()

    def again(self, packet: Packet) -> bytes | None:
        """The frame for a neighbor that lacks this packet; None: it is as far as it may go, and needs no instant."""
        self._port.mark(packet, duplicates.FLOODED)
        own = packet.header.origin == self._port.node
        return self._frame(packet) if own or packet.header.hop_limit > 1 else None

    def _frame(self, packet: Packet) -> bytes:
        """What begins here: a packet of our own as it is, another's one hop further."""
        own = packet.header.origin == self._port.node
        stamp = self._port.stamped if own else self._port.forwarded
        return stamp(packet, flags=FLAG_FLOOD)
