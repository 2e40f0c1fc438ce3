"""The duplicate set: which packets a node has handled already, and in which of their phases.

Keys are hashes of all that a packet's origin wrote (`hash_of`), so a forged packet of the same number is not taken for
the genuine one; queues, and radios for their datagrams, use origin and number (`key_of`). Keys are kept in two
generations: one is forgotten after at least `capacity` newer ones, long after its packet's lifetime.
"""

from typing import Final

from fanet_mw import wire
from fanet_mw.node.packet import Packet

DELIVERED: Final = 1
"""The packet was handed to the applications of this node, or this node is its origin."""
FLOODED: Final = 2
"""The packet was received or sent while it is flooded; a node relays it at most once."""
CARRIED: Final = 4
"""The packet was forwarded as unicast towards a head; a node does so at most once, so that none goes in circles."""
PHASES: Final = {0: DELIVERED, wire.FLAG_FLOOD: FLOODED, wire.FLAG_TO_HEAD: CARRIED}
"""The bit of the duplicate set that belongs to the phase flags of a frame. A node handles a packet at most once per
phase: while it is flooded, while members carry it to their head, and in any other frame."""

_SPREAD: Final = (1 << 32) + 40_503
"""The factor by which `key_of` multiplies the origin. It is above 2^32, so that no two pairs of origin and sequence
number have the same key. It is not 2^32 itself, because a dict finds a number by its low bits, and packets that all
origins send at about the same time have about the same sequence number."""


def hash_of(frame: bytes) -> int:
    """A hash of all that a packet's origin wrote, the same at every hop: a forged packet with a genuine one's number
    has another. Python keys it anew for each process (SipHash), so nobody can forge it; it is only compared, so that no
    run depends on the key.
    """
    return hash(frame[wire.END_TO_END] + frame[wire.HEADER_BYTES :])


def key_of(origin: int, seq: int) -> int:
    """One number for each pair of origin and sequence number; `seq` has 32 bits."""
    return origin * _SPREAD + seq


def origin_and_seq(key: int) -> tuple[int, int]:
    """The pair of which a number is the key."""
    return divmod(key, _SPREAD)


def key_of_packet(packet: Packet) -> int:
    return key_of(packet.header.origin, packet.header.seq)


class DuplicateSet:
    """A map from the key of a packet to the bits of the phases in which it was handled."""

    def __init__(self, capacity: int = 32_768) -> None:
        self._capacity = capacity
        self.young: dict[int, int] = {}
        """The newer generation, with all bits of its keys; public, so that a node looks into it without a call."""
        self.old: dict[int, int] = {}
        """The older generation, which is dropped when the newer one is full."""

    def bits(self, key: int) -> int:
        """The phases in which this packet was handled; 0 for a new packet."""
        found = self.young.get(key)
        return self.old.get(key, 0) if found is None else found

    def put(self, key: int, bits: int) -> None:
        """Replace the bits of a packet; `mark` adds to them."""
        if len(self.young) >= self._capacity:
            self.old, self.young = self.young, {}
        self.young[key] = bits

    def forget(self, key: int) -> None:
        self.young.pop(key, None)
        self.old.pop(key, None)

    def mark(self, key: int, bits: int) -> None:
        if len(self.young) >= self._capacity:
            self.old, self.young = self.young, {}
        self.young[key] = self.bits(key) | bits
