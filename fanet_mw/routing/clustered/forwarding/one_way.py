"""Packets for one receiver: hop by hop along the way back of its last flood, each hop acknowledged by the radio.

    the receiver is a neighbor           -> to it
    a flood of the receiver was heard    -> to the neighbor from which it came first
    neither, or no acknowledgment        -> the packet is flooded from here, in contention
    the receiver hears packets for it flooded -> it floods a word of itself, so that the next ones find a way

A packet with a later birth replaces the way of an earlier one, so each hop leads to a node that knows a way at least as
new, and a shorter one if it is of the same flood: no way goes in circles (as in DSDV).
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import Neighbors
from fanet_mw.node.packet import Packet
from fanet_mw.units import BROADCAST, NodeId, S
from fanet_mw.wire import INNER_ID, Header, Kind
from fanet_mw.wire.frame import RECEIPT

_UNICAST: Final = 0
"""The phase flags of a packet that goes to its receiver."""
_SHOW_NS: Final = 1 * S
"""The least time between two floods by which a node shows the way to itself."""
_new: Final = tuple.__new__  # for what is made once per packet
_RECEIPT: Final = RECEIPT.msgid.to_bytes(3, "little")


def is_receipt(packet: Packet) -> bool:
    """True for receipts: no bound is stated for them, and their sender asks again for those that are lost."""
    return packet.frame[INNER_ID] == _RECEIPT


class Way(NamedTuple):
    """The way to a node: the first copy of a packet of that node came over this neighbor."""

    born_us: int
    hops: int
    neighbor: NodeId


class _Attempt(NamedTuple):
    packet: Packet
    hop: NodeId


class OneWay:
    """The packets of one node that are under way to the next hop to their receiver."""

    def __init__(
        self,
        port: Port,
        neighbors: Neighbors,
        *,
        takes: Callable[[Packet], bool] = lambda _: True,
        not_before: Callable[[int], int] = lambda start_ns: start_ns,
    ) -> None:
        """`takes`: which packets go hop by hop, alike at all nodes. `not_before`: the earliest start of a due frame."""
        self._port = port
        self._neighbors = neighbors
        self._not_before = not_before
        self._takes = takes
        self._ways: dict[int, Way] = {}
        self._under_way: dict[int, _Attempt] = {}
        self._shown_ns = -_SHOW_NS

    def __len__(self) -> int:
        return len(self._under_way)

    def learn(self, header: Header, neighbor: NodeId) -> None:
        origin, born_us = header.origin, header.origin_us
        known = self._ways.get(origin)
        if known is None or born_us > known.born_us or (born_us == known.born_us and header.hops < known.hops):
            self._ways[origin] = _new(Way, (born_us, header.hops, neighbor))

    def takes(self, packet: Packet) -> bool:
        """True if a packet goes hop by hop."""
        header = packet.header
        return header.destination != BROADCAST and header.kind == Kind.DATA and self._takes(packet)

    def must_show(self, header: Header, *, now_ns: int) -> bool:
        """True if the node must flood a word of itself: a packet for it alone was flooded that should go hop by hop."""
        ours = header.destination == self._port.node and header.hops > 0
        if not ours or now_ns < self._shown_ns + _SHOW_NS:
            return False
        self._shown_ns = now_ns
        return True

    def send(self, packet: Packet, *, start_ns: int, now_ns: int) -> bool:
        """Send a packet towards its receiver; False if no way is known."""
        hop = receiver = NodeId(packet.header.destination)
        if not self._neighbors.has(hop, now_ns=now_ns):
            way = self._ways.get(receiver)
            if way is None or way.neighbor == packet.header.prev_hop:
                return False
            hop = way.neighbor
        request = self._port.transmit_to(packet, hop, flags=_UNICAST, start_ns=self._not_before(start_ns))
        self._under_way[request] = _Attempt(packet, hop)
        return True

    def failed(self, status: TxStatus) -> Packet | None:
        """A transmission has ended; returns the packet, to go another way, if it was one of these and failed."""
        attempt = self._under_way.pop(status.seq, None)
        if attempt is None or status.outcome is TxOutcome.ACKED:
            return None
        if status.outcome is not TxOutcome.RETRY_LIMIT:
            return attempt.packet  # it did not leave this radio, which says nothing of the next hop
        self._neighbors.forget(attempt.hop)
        receiver = NodeId(attempt.packet.header.destination)
        way = self._ways.get(receiver)
        if way is not None and way.neighbor == attempt.hop:
            del self._ways[receiver]
        return attempt.packet
