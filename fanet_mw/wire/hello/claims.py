"""FANET_CLAIMS: in a hello, the neighbors that its sender hears, and the slot that each of them claims.

From it each receiver knows its two hops: which nodes are there, which of them hear each other, and which slots are
taken. The rules of relaying by neighbor knowledge (`cds`, `mpr`, `heads`) need only the neighbors; their slots are
"none".
"""

from collections.abc import Sequence
from typing import Final, NamedTuple, Self

from fanet_mw.errors import MalformedFrameError
from fanet_mw.units import MAX_NODES, NodeId
from fanet_mw.wire import CLAIMS, OVERHEAD, VERSION, Packed, decode_every, encode_inner

CAPACITY: Final = 16
"""The number of entries in one message; more neighbors need further messages."""
MESSAGE_BYTES: Final = OVERHEAD + CLAIMS.layout.size
NO_SLOT: Final = 255
MOST_LOTS: Final = 3
_HEARS_US: Final = 4
_RELAY: Final = 8
_KNOWN: Final = MOST_LOTS | _HEARS_US | _RELAY
_MOST: Final = 255


class SlotStatus(NamedTuple):
    """The slot that a node claims for itself, and its superframe."""

    slot: int | None = None
    length: int = 0
    """The number of slots in the superframe in which the slot repeats."""
    crowd: int = 1
    """The number of nodes within two hops, including the node itself."""
    lots: int = 0
    """The number of lots that the node draws in each turn that no node claims."""


class HeardNeighbor(NamedTuple):
    """One neighbor, as the sender of a hello knows it."""

    node: NodeId
    status: SlotStatus
    hears_us: bool
    """True if the link works both ways: the neighbor's own hello names the sender of this hello."""
    relay: bool = False
    """True if the sender has chosen the neighbor as one of its multipoint relays."""


class Claims(NamedTuple):
    """All claims that one hello states."""

    node: NodeId
    own: SlotStatus
    heard: tuple[HeardNeighbor, ...]

    def encode_frames(self, room: int | None = None) -> bytes:
        """One message for each `CAPACITY` neighbors, at least one; neighbors for whom there is no room are left out."""
        most = len(self.heard) if room is None else max(1, room // MESSAGE_BYTES) * CAPACITY
        heard = self.heard[:most]
        starts = range(0, max(1, len(heard)), CAPACITY)
        chunks = (heard[at : at + CAPACITY] for at in starts)
        return b"".join(encode_inner(CLAIMS, self._payload(chunk), node=self.node) for chunk in chunks)

    def _payload(self, chunk: Sequence[HeardNeighbor]) -> bytes:
        unused = (0,) * (CAPACITY - len(chunk))
        return CLAIMS.layout.pack(
            self.node,
            *(h.node for h in chunk), *unused,
            *(_slot(h.status) for h in chunk), *unused,
            *(h.status.length for h in chunk), *unused,
            *(min(h.status.crowd, _MOST) for h in chunk), *unused,
            *(h.status.lots | _HEARS_US * h.hears_us | _RELAY * h.relay for h in chunk), *unused,
            _slot(self.own), self.own.length, min(self.own.crowd, _MOST), self.own.lots, len(chunk), VERSION,
        )  # fmt: skip

    @classmethod
    def decode_frames(cls, packed: Packed) -> Self | None:
        """The claims in a hello; None when it has none. Raises MalformedFrameError."""
        heard: list[HeardNeighbor] = []
        messages = decode_every(CLAIMS, packed)
        if not messages:
            return None
        for node, *lists, slot, length, crowd, lots, count, version in messages:
            if version != VERSION or count > CAPACITY or lots > MOST_LOTS or not 0 < node <= MAX_NODES:
                raise MalformedFrameError(f"claims of version {version}, node {node}, {count} entries, {lots} lots")
            own = _status(slot, length, crowd, lots)
            columns = (lists[at * CAPACITY : at * CAPACITY + count] for at in range(5))
            heard += (_heard(*row) for row in zip(*columns, strict=True))
        return cls(NodeId(node), own, tuple(heard))


def _slot(status: SlotStatus) -> int:
    return NO_SLOT if status.slot is None else status.slot


def _status(slot: int, length: int, crowd: int, lots: int) -> SlotStatus:
    if slot != NO_SLOT and slot >= length:
        raise MalformedFrameError(f"slot {slot} of a superframe of {length}")
    return SlotStatus(None if slot == NO_SLOT else slot, length, crowd, lots)


def _heard(node: int, slot: int, length: int, crowd: int, facts: int) -> HeardNeighbor:
    if not 0 < node <= MAX_NODES or facts & ~_KNOWN:
        raise MalformedFrameError(f"a claim of node {node}, facts {facts}")
    status = _status(slot, length, crowd, facts & MOST_LOTS)
    return HeardNeighbor(NodeId(node), status, bool(facts & _HEARS_US), bool(facts & _RELAY))
