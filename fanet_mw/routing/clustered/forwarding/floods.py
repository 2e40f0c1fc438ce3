"""Transmits floods: broadcasts that begin at one node and that every relay passes on once (the phase FLOOD).

Each data packet that the node floods or receives is kept in the store for repair, if the scenario has repair.
"""

from collections.abc import Sequence
from typing import Final

from fanet_mw.airtime import longest_access_ns
from fanet_mw.node.contract import Port
from fanet_mw.node.packet import Packet, is_used_up
from fanet_mw.routing.clustered.forwarding.contention_timing import ContentionTiming
from fanet_mw.routing.packet_repair import Repair
from fanet_mw.units import BROADCAST, S
from fanet_mw.wire import FLAG_FLOOD, Kind

_DATA: Final = int(Kind.DATA)
_UPLINK_NS: Final = 1 * S
"""The time that a packet may take to its head. If a node has heard no flood of a packet one flooding period and this
time after the packet came to it, the packet may be repaired."""


class Floods:
    """Transmits the floods of one node."""

    def __init__(self, port: Port, repair: Repair | None, contention: ContentionTiming) -> None:
        self._port = port
        self._repair = repair
        self._contention = contention
        self._expect_ns = port.scenario.clusters.period_ns + _UPLINK_NS
        self._hop_limit = port.scenario.routing.hop_limit

    def keep(self, packet: Packet, *, flooded: bool, now_ns: int) -> None:
        """Keep a data packet for repair; `flooded` is False if its flood has yet to begin."""
        header = packet.header
        if self._repair and header.kind == _DATA and header.destination == BROADCAST:
            self._repair.hold(packet, flooded=flooded, expect_ns=now_ns + self._expect_ns, now_ns=now_ns)

    def control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """Make a control packet of this node, addressed to all nodes."""
        return self._port.announce(kind, inner, now_ns=now_ns, flags=FLAG_FLOOD, hop_limit=self._hop_limit)

    def contend_control(self, kind: Kind, inner: bytes, *, now_ns: int) -> Packet:
        """Make a control packet of this node, and transmit it in contention as soon as possible."""
        packet = self.control(kind, inner, now_ns=now_ns)
        start_ns = self._contention.start_ns(due_ns=now_ns, now_ns=now_ns, membership=True)
        self._port.transmit(packet.frame, BROADCAST, start_ns=start_ns)
        return packet

    def contend_again(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Transmit again a packet that was due at `due_ns` as soon as it may contend, unless the window is full."""
        if not self._goes_on(packet):  # a packet that goes no farther needs no instant
            return
        start_ns, access_ns = self._contention.start_ns(due_ns=due_ns, now_ns=now_ns), self._access_ns(packet)
        if self._contention.has_room(start_ns, access_ns):
            until_ns = self._contention.ends_ns(start_ns, access_ns)
            self._port.transmit_together([packet], flags=FLAG_FLOOD, at_ns=(start_ns,), until_ns=until_ns)

    def contend(self, packet: Packet, *, due_ns: int, now_ns: int) -> None:
        """Flood a packet that was due at `due_ns` from here, in the first window with room: nobody will ask for it."""
        if self._goes_on(packet):
            due_ns = self._contention.start_ns(due_ns=due_ns, now_ns=now_ns)
            start_ns = self._contention.with_room(due_ns, self._access_ns(packet))
            self._port.transmit_together([packet], flags=FLAG_FLOOD, at_ns=(start_ns,))

    def _access_ns(self, packet: Packet) -> int:
        return longest_access_ns(len(packet.frame), self._port.scenario.radio)

    def beside_turns_ns(self, packets: Sequence[Packet], start_ns: int) -> int:
        """When a frame with these packets may start that has no turn: in a window with room where others have turns."""
        return self._contention.with_room(start_ns, max(self._access_ns(packet) for packet in packets))

    def begin(
        self, packets: Sequence[Packet], *, start_ns: int, again_ns: Sequence[int] = (), flags: int = FLAG_FLOOD
    ) -> None:
        """Begin floods in one frame at `start_ns`, repeated at later instants."""
        for packet in packets:
            self.keep(packet, flooded=True, now_ns=start_ns)
        self._port.transmit_together(packets, flags=flags, at_ns=(start_ns, *again_ns))

    def answer(self, packets: Sequence[Packet], *, start_ns: int) -> None:
        """Transmit packets that neighbors have missed, in one frame."""
        goes = [packet for packet in packets if self._goes_on(packet)]
        self._port.transmit_together(goes, flags=FLAG_FLOOD, at_ns=(start_ns,))

    def _goes_on(self, packet: Packet) -> bool:
        """True if a packet may travel farther hops; if not, this node still counts it as flooded."""
        if packet.header.origin == self._port.node or not is_used_up(packet.header):
            return True
        self._port.mark(packet, flags=FLAG_FLOOD)
        return False
