"""What a node has already handled of each packet, as bits under the packet's key. Bounded: two generations of keys.

A node's key is a hash of all that the origin wrote (`reader.name_of`), so that a forged packet under the same origin
and sequence number takes the place of none. Queues, and radios for their datagrams, tell packets apart by `key_of`.
A key is forgotten after at least `capacity` newer ones, so a packet comes back as new only if its duplicates are
older than that; the packet lifetime ends it long before.
"""

from typing import Final

from fanet_mw.node.packet import Packet

DELIVERED: Final = 1
"""Handed to the application of this node, or originated by it."""
FLOODED: Final = 2
"""Heard (or sent) in its flooding phase: relayed at most once."""
CARRIED: Final = 4
"""Forwarded as unicast towards a head: carried at most once, so that no unicast loop survives."""


_SPREAD: Final = (1 << 32) + 40_503
"""The factor is above 2^32, so that no two pairs of origin and sequence number give one key. It is not 2^32, because a
dict looks for a number by its low bits: packets that all origins send at about one time have about the same number."""


def key_of(origin: int, seq: int) -> int:
    """One number for each pair of origin and sequence number; `seq` has 32 bits."""
    return origin * _SPREAD + seq


def key_of_packet(packet: Packet) -> int:
    """The key of a packet."""
    return key_of(packet.header.origin, packet.header.seq)


class DuplicateSet:
    """The bits of each key."""

    def __init__(self, capacity: int = 32_768) -> None:
        self._capacity = capacity
        self.young: dict[int, int] = {}
        """The newer generation, open to a caller that asks at every reception: it holds all that is known of a key."""
        self.old: dict[int, int] = {}
        """The older one."""

    def bits(self, key: int) -> int:
        """What is known of this packet; 0 for a new one."""
        found = self.young.get(key)
        return self.old.get(key, 0) if found is None else found

    def put(self, key: int, bits: int) -> None:
        """Set what is known of a packet; `mark` for a caller that has just asked for `bits`."""
        if len(self.young) >= self._capacity:
            self.old, self.young = self.young, {}
        self.young[key] = bits

    def forget(self, key: int) -> None:
        """Treat this packet as one that has never been heard."""
        self.young.pop(key, None)
        self.old.pop(key, None)

    def mark(self, key: int, bits: int) -> None:
        if len(self.young) >= self._capacity:
            self.old, self.young = self.young, {}
        self.young[key] = self.bits(key) | bits
