"""The packets that a node originates: numbered without gaps, and in its duplicate set before any copy comes back.

Data and control packets have sequence numbers of their own, so that a gap in the numbers of data shows a lost packet. A
node that starts again must not use its earlier numbers: it begins above all numbers that it had time to use. After the
last number of its kind, 59 hours on, follows the first: nobody remembers a packet for so long.
"""

from typing import Final

from fanet_mw import wire
from fanet_mw.errors import LocalProtocolError
from fanet_mw.node import duplicates
from fanet_mw.node.duplicates import PHASES, DuplicateSet, hash_of
from fanet_mw.node.header_check import CONTROL, NUMBER, RESTART_STEP_NS
from fanet_mw.node.packet import Packet
from fanet_mw.units import US, NodeId
from fanet_mw.wire import Header, Kind

_new: Final = tuple.__new__  # for what is made once per frame


class PacketNumbering:
    """Makes the packets of one node."""

    def __init__(self, node: NodeId, duplicate_set: DuplicateSet, *, most_bytes: int) -> None:
        self._node = node
        self._duplicates = duplicate_set
        self._most_bytes = most_bytes
        """The greatest length of a frame (`radio.max_frame_bytes`)."""
        self._first, self._next = 0, {False: 0, True: 0}
        self.held: set[bytes] = set()
        """The names (`wire.NAME`) of data packets that were accepted, and of which no frame has been announced yet."""

    def start(self, now_ns: int) -> None:
        first = now_ns // RESTART_STEP_NS % CONTROL
        self._first, self._next = first, {False: first, True: first}

    def make(
        self, kind: Kind, inner: bytes, *, destination: NodeId, priority: int, flags: int, hop_limit: int, born_ns: int
    ) -> Packet:
        """The next packet, marked as handled; raises LocalProtocolError if it is longer than a frame may be."""
        size = wire.HEADER_BYTES + len(inner)
        bound = self._most_bytes
        if size > bound:
            raise LocalProtocolError(f"frame of {size} bytes must be <= radio.max_frame_bytes = {bound}")
        control = kind is not Kind.DATA
        number = self._next[control]
        self._next[control] = number + 1 & NUMBER
        seq = number | CONTROL if control else number
        node, hops = self._node, 0
        header = _new(
            Header, (born_ns // US, seq, node, destination, node, kind, hop_limit, hops, priority, flags)
        )  # fmt: skip
        frame = header.encode() + inner
        self._duplicates.put(hash_of(frame), duplicates.DELIVERED | PHASES[flags & wire.PHASE_MASK])
        return _new(Packet, (header, frame))

    def holds(self, seq: int) -> bool:
        """True while no frame of the data packet of this number has been announced, and the node has not dropped it."""
        return seq.to_bytes(4, "little") + self._node.to_bytes(2, "little") in self.held

    def handed_on(self, seq: int) -> bool:
        """True for a data packet originated since the start and handed over: it may come back."""
        return seq < CONTROL and seq - self._first & NUMBER < self._next[False] - self._first & NUMBER
